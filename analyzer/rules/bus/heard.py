"""When each node, and each type that it sends, was heard: by the identifiers of frames, whatever became of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.rules.bus.sessions import MOST_SESSIONS, bus_frames
from analyzer.tables import EXTENDED, KINDS, REMOTE
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.kit import Array, FrameTable, TransferTable, View

_MOST_GAPS = 256  # of a node, the latest
_NODE_BITS = 7  # below the bus
_MESSAGE = KINDS.index("message")


class SessionBegins(NamedTuple):
    """Transfers of the sessions of a bus as they begin, one session after the other.

    A session has its code, its `place` among all that were ever heard, and so many transfers, one at least. These have
    times, numbers of frames, and how many were left out by their IDs up to there.
    """

    codes: Array
    place: Array
    size: Array
    t: Array
    number: Array
    lost: Array


class Gap(NamedTuple):
    """A time without a frame of a node, and the frame before it: its number, and its line if that is old."""

    start: int
    stop: int
    number: int
    lines: tuple[str, ...] = ()


class HeardNodes:
    """Follows the frames of each node; nodes are at most 127 an interface, and numbers with the bus above 7 bits.

    Of each the latest gaps are known.

    Args:
        least: shorter times without a frame, in ns, are no gaps.
    """

    def __init__(self, least: int) -> None:
        self._native = _native.HeardNodes(least, _MOST_GAPS, EXTENDED | REMOTE, EXTENDED, NO_TIME)
        self._lines: dict[int, dict[int, tuple[str, ...]]] = {}  # of each node, by frame: those before its gaps
        self._silent: dict[int, int] = {}  # and the last frame of each that was silent the last time

    def feed(self, frames: FrameTable) -> None:
        """Add a batch."""
        self._native.feed(frames)

    def keep_lines(self, view: View) -> None:
        """Keep the last frames of nodes that are silent: they may be gone when that is told."""
        told = self._native.fell_silent(view.frames.first)
        if not told:
            return
        lines = view.each_line(np.array([number for _, number, _ in told], np.int64)).tolist()
        for (node, number, was_gap), line in zip(told, lines, strict=True):
            own, before = self._lines.setdefault(node, {}), self._silent.get(node)
            if before is not None and not was_gap:
                own.pop(before, None)
            self._silent[node] = number
            own[number] = (line,) if line else ()
            if len(own) > 2 * _MOST_GAPS:
                oldest = self._native.oldest(node) or 0
                self._lines[node] = {one: kept for one, kept in own.items() if one >= oldest}

    def finish(self, ends: Mapping[int, int]) -> None:
        """Note what is silent up to when each bus was heard last."""
        for bus, end in ends.items():
            self._native.finish(bus, end)

    def gaps(self, bus: int, node: int, start: int, stop: int) -> list[Gap]:
        """Return when a node was not heard between two times."""
        key = bus << _NODE_BITS | node
        lines = self._lines.get(key, {})
        found = self._native.between(key, start, stop)
        return [Gap(begin, end, number, lines.get(number, ())) for begin, end, number in found]

    def longest(self, nodes: Array, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return when the longest gap of each node between two times begins and ends.

        Where there is none it is the second time.
        """
        begins, ends = self._native.longest(nodes, start, stop)
        return cells(begins, np.int64), cells(ends, np.int64)

    def silent(self, nodes: Array, t: Array, end: int) -> Array:
        """Return which nodes that were heard lie in a gap at a time; `end` is the last time so far."""
        return cells(self._native.silent(nodes, t, end), np.bool_)


class HeardSessions:
    """Follows the frames of each message type of a node: at most `MOST_SESSIONS` of these.

    Of the last frame of each it is known whether a transfer goes on behind it, its ID, and how many were left out.
    """

    def __init__(self) -> None:
        self._native = _native.HeardSessions(MOST_SESSIONS)

    def feed(self, frames: FrameTable) -> Iterator[SessionBegins]:
        """Add a batch; yield what began on each bus."""
        for ours in bus_frames(frames).values():
            yield SessionBegins._make(cells(one, np.int64) for one in self._native.feed(ours, frames.first))

    def prove(self, transfers: TransferTable) -> tuple[Array, Array]:
        """Return the places of sessions that have a type now, in the order of their codes, and the codes of the types.

        Those of which no transfer came so far may be another protocol's.
        """
        places, codes = self._native.prove(transfers, _MESSAGE)
        return cells(places, np.int64), cells(codes, np.int64)
