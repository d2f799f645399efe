"""Shares of the lines of a terminal among panes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

# What each pane is given in turn while there are lines left: rows besides its head, None for all it has.
_TURNS: tuple[tuple[str, int | None], ...] = (
    ("buses", 1), ("devices", 2), ("nodes", 2), ("findings", 1), ("latched", 0), ("", None),
    ("devices", 8), ("buses", 4), ("findings", 3), ("nodes", 5), ("latched", 1), ("devices", None), ("nodes", 12),
    ("findings", 8), ("latched", 6), ("nodes", None), ("findings", None), ("latched", None), ("buses", None),
)  # fmt: skip


def share(total: int, wanted: Mapping[str, int], focus: str) -> dict[str, int]:
    """Return lines of each pane, its head counted; `wanted` are rows without it. The focused one comes early.

    A pane for which there is no line gets none, and the last one gets those that nobody needs.
    """
    given = dict.fromkeys(wanted, 0)
    left = total
    for name, rows in _TURNS:
        pane = name or focus
        if pane not in wanted:
            continue
        most = wanted[pane] if rows is None else min(rows, wanted[pane])
        more = min(max(0, most + 1 - given[pane]), left)
        given[pane] += more
        left -= more
    last = next((name for name in reversed(given) if given[name]), focus)
    given[last] += left
    return given
