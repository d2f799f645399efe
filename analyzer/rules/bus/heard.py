"""When each node, and each type that it sends, was heard: by the identifiers of frames, whatever became of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.bus.sessions import bus_frames
from analyzer.tables import TAIL_END, TAIL_ID, TAIL_START, TRANSFER_IDS
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.rules.bus.sessions import BusFrames, Session
    from dissectors.kit import Array, FrameTable

_MOST_GAPS = 256  # of a node, the latest
_AT_ONCE = 256  # times that are compared with them together


class SessionBegins(NamedTuple):
    """Transfers of a session as they begin: times, numbers of frames, and how many were left out by their IDs."""

    t: Array
    number: Array
    lost: Array


class Gap(NamedTuple):
    """A time without a frame of a node, and the frame before it: its number, and its line if that is old."""

    start: int
    stop: int
    number: int
    lines: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class HeardNode:
    """A node: its last frame, and when it was not heard."""

    t: int
    number: int
    lines: tuple[str, ...] = ()
    # Begin and end of the latest gaps, and the number of the frame before each: a column a gap.
    _gaps: Array = field(default_factory=lambda: np.empty((3, 0), np.int64))
    _lines: dict[int, tuple[str, ...]] = field(default_factory=dict)  # of such a frame, if it is old

    @property
    def begins(self) -> Array:
        """When gaps begin."""
        found: Array = self._gaps[0]
        return found

    @property
    def ends(self) -> Array:
        """When gaps end."""
        found: Array = self._gaps[1]
        return found

    def add(self, gaps: Array) -> None:
        """Note more gaps; the oldest ones are forgotten."""
        known = np.concatenate((self._gaps, gaps), axis=1)
        self._gaps = known if known.shape[1] <= _MOST_GAPS else known[:, -_MOST_GAPS:].copy()
        if self._lines:
            oldest = self._gaps[2, 0]
            self._lines = {number: lines for number, lines in self._lines.items() if number >= oldest}

    def pause(self, until: int) -> None:
        """Note a gap from its last frame on."""
        self.add(np.array([[self.t], [until], [self.number]], np.int64))
        if self.lines:
            self._lines[self.number] = self.lines

    def between(self, start: int, stop: int) -> list[Gap]:
        """Return the gaps between two times."""
        inside = self._gaps[:, (self.begins >= start) & (self.ends <= stop)].T.tolist()
        return [Gap(begin, end, number, self._lines.get(number, ())) for begin, end, number in inside]

    def longest(self, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return when the longest gap between each two times begins and ends, the second time where there is none."""
        begins, ends = self.begins, self.ends
        if not len(begins):
            return stop, stop
        found = stop.copy(), stop.copy()
        for at in range(0, len(start), _AT_ONCE):
            low, high = start[at : at + _AT_ONCE, None], stop[at : at + _AT_ONCE, None]
            size = np.where((begins >= low) & (ends <= high), ends - begins, -1)
            which = size.argmax(axis=1)
            known = np.flatnonzero(size[np.arange(len(which)), which] >= 0)
            found[0][at + known], found[1][at + known] = begins[which[known]], ends[which[known]]
        return found


@dataclass(slots=True, eq=False)
class _Last:
    """The last frame of a session: whether it was the end of a transfer, its ID, and how many were left out."""

    ended: bool = True
    transfer_id: int = -1
    lost: int = 0


class HeardNodes:
    """Follows the frames of each node; nodes are at most 127 an interface.

    Args:
        least: shorter times without a frame, in ns, are no gaps.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self._nodes: dict[tuple[int, int], HeardNode] = {}

    def all(self) -> Iterable[tuple[int, HeardNode]]:
        """Return all nodes, each with its bus."""
        return [(bus, heard) for (bus, _), heard in self._nodes.items()]

    def gaps(self, bus: int, node: int, start: int, stop: int) -> list[Gap]:
        """Return when a node was not heard between two times."""
        heard = self._nodes.get((bus, node))
        return [] if heard is None else heard.between(start, stop)

    def longest(self, bus: int, node: int, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return the longest times between two others in which a node was not heard, as they begin and end."""
        heard = self._nodes.get((bus, node))
        return (stop, stop) if heard is None else heard.longest(start, stop)

    def silent(self, bus: int, node: int, t: int, end: int) -> bool:
        """Return whether a node that was heard lies in a gap at a time; `end` is the last time so far."""
        heard = self._nodes.get((bus, node))
        if heard is None:
            return False
        last = heard.t <= t and end - heard.t > self._least
        return last or bool(len(heard.begins) and ((heard.begins <= t) & (t < heard.ends)).any())

    def feed(self, frames: FrameTable) -> None:
        """Add a batch."""
        for bus, ours in bus_frames(frames).items():
            self._add(bus, frames.first, ours)

    def _add(self, bus: int, start: int, ours: BusFrames) -> None:
        gaps, nodes = dict(ours.gaps(self._least, _MOST_GAPS, start)), ours.nodes
        columns = nodes.node, ours.times[nodes.first], ours.times[nodes.last], nodes.last
        for k, (node, t, until, last) in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
            heard = self._nodes.get((bus, node))
            if heard is None:
                heard = self._nodes[bus, node] = HeardNode(t, -1)
            elif t - heard.t > self._least:
                heard.pause(t)
            if k in gaps:
                heard.add(np.stack(gaps[k]))
            heard.t, heard.number, heard.lines = until, start + last, ()


class HeardSessions:
    """Follows the frames of each message type of a node: at most `MOST_SESSIONS` of these."""

    def __init__(self) -> None:
        self._last: dict[Session, _Last] = {}

    def feed(self, frames: FrameTable) -> Iterator[tuple[Session, SessionBegins]]:
        """Add a batch; yield what began of each session."""
        for ours in bus_frames(frames).values():
            at, first = ours.begins
            transfer_id = ours.tail[at] & TAIL_ID
            lost = np.zeros(len(at), np.int64)
            np.cumsum(np.maximum(transfer_id[1:] - transfer_id[:-1] & TAIL_ID, 1) - 1, out=lost[1:])
            t, number = ours.times[ours.row[at]], frames.first + ours.row[at]
            messages = [(one, ours.sessions[one]) for one in ours.messages]
            beyond = ours.beyond([session for _, session in messages], self._last)
            for one, session in messages:
                if session in beyond:
                    continue
                last = self._last.setdefault(session, _Last())
                begin, end = ours.first[one], ours.first[one + 1]
                goes_on = not (last.ended or ours.tail[begin] & TAIL_START)
                last.ended = bool(ours.tail[end - 1] & TAIL_END)
                mine = slice(int(first[one]) + goes_on, int(first[one + 1]))
                if mine.start < mine.stop:
                    before = last.lost - int(lost[mine.start])
                    if last.transfer_id >= 0:
                        before += max((int(transfer_id[mine.start]) - last.transfer_id) % TRANSFER_IDS - 1, 0)
                    last.transfer_id = int(transfer_id[mine.stop - 1])
                    yield session, SessionBegins(t[mine], number[mine], lost[mine] + before)
                    last.lost = int(lost[mine.stop - 1]) + before
