"""The odd ESCs for people: a sentence each."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.stats.table import StatTable
    from analyzer.views.terminal import Palette

NAME = "odd"
_PEERS = "peers"


def odd_lines(
    table: StatTable, *, width: int, buses: int, palette: Palette, moment: Callable[[int], str]
) -> Iterator[str]:
    """Yield each odd ESC as lines of at most `width` columns; `moment` writes a time."""
    rows = table.records()
    whose = [_who(one["ch"], one["node"], escape(one["bus"]) if buses > 1 else "") for one in rows]
    label = max(map(len, whose), default=0)
    for one, who in zip(rows, whose, strict=True):
        always = one["against"] == _PEERS
        text = f"{one['text']}: a fact of the vehicle, no cause" if always else one["text"]
        since = f"z {one['z']:.1f}" if always else f"since {moment(one['since_ns'])}, z {one['z']:.1f}"
        first, *rest = wrap(f"{escape(text)} ({since})", width - label - 4, break_on_hyphens=False)
        yield f"{palette.paint('note' if always else 'bad', f'! {who:<{label}}')}  {first}"
        yield from (f"{'':<{label + 4}}{line}" for line in rest)
    if not rows:
        yield "  none"


def _who(ch: str | None, node: str, bus: str) -> str:
    parts = (bus, f"ch{ch}" if ch else "", f"node {node}")
    return " ".join(part for part in parts if part)
