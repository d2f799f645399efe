"""What a capture shows of the vehicle as a whole: its ESCs by index, whether motors turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Exercise, View, Watcher

WATCHERS: tuple[type[Watcher], ...] = ()
EXERCISES: tuple[type[Exercise], ...] = ()


def labels(_view: View) -> Iterator[tuple[int, int, str]]:
    """Nodes by the channel that people call them."""
    yield from ()
