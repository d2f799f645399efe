"""When each node, and each type that it sends, was heard: by the identifiers of frames, whatever became of them."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.bus.keyed import KeyedRows
from analyzer.rules.bus.sessions import MOST_SESSIONS, bus_frames
from analyzer.tables import TAIL_END, TAIL_ID, TAIL_START, TRANSFER_IDS
from dissectors.kit import NO_TIME, groups
from dissectors.kit.order import spans
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.rules.bus.sessions import BusFrames
    from dissectors.kit import Array, FrameTable, View

_MOST_GAPS = 256  # of a node, the latest
_NODE_BITS, _NODE = 7, 0x7F  # below the bus
_AT_ONCE = 256  # times that are compared with them together


class SessionBegins(NamedTuple):
    """Transfers of the sessions of a bus as they begin, one session after the other; of each there is one at least.

    A session has its code, its `place` among all that were ever heard, and where it begins among the transfers; behind
    the last one is where it ends. These have times, numbers of frames, and how many were left out by their IDs up to
    there.
    """

    codes: Array
    place: Array
    first: Array
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
    """When a node was not heard: begin and end of its latest gaps, and the frame before each."""

    # Begin, end and number of the frame before, one gap after the other; lines of such a frame, if it is old.
    _gaps: array[int] = field(default_factory=lambda: array("q"))
    _lines: dict[int, tuple[str, ...]] = field(default_factory=dict)

    @property
    def gaps(self) -> Array:
        """Begin and end of the latest gaps, and the number of the frame before each: a column a gap."""
        latest = self._gaps[-3 * _MOST_GAPS :]  # a copy: what is looked at cannot grow
        return np.frombuffer(latest, np.int64).reshape(-1, 3).T if latest else np.empty((3, 0), np.int64)

    def add(self, gaps: array[int]) -> None:
        """Note more gaps, one after the other; the oldest ones are forgotten."""
        self._gaps.extend(gaps)
        if len(self._gaps) > 6 * _MOST_GAPS:
            del self._gaps[: -3 * _MOST_GAPS]
        if self._lines:
            oldest = self._gaps[max(len(self._gaps) - 3 * _MOST_GAPS, 0) + 2]
            self._lines = {number: lines for number, lines in self._lines.items() if number >= oldest}

    def pause(self, gap: Gap) -> None:
        """Note a gap."""
        self.add(array("q", gap[:3]))
        if gap.lines:
            self._lines[gap.number] = gap.lines

    def between(self, start: int, stop: int) -> list[Gap]:
        """Return the gaps between two times."""
        gaps = self.gaps
        inside = gaps[:, (gaps[0] >= start) & (gaps[1] <= stop)].T.tolist()
        return [Gap(begin, end, number, self._lines.get(number, ())) for begin, end, number in inside]

    def longest(self, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return when the longest gap between each two times begins and ends, the second time where there is none."""
        begins, ends, _ = self.gaps
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

    def silent(self, t: Array) -> Array:
        """Return which times lie in a gap; gaps do not overlap, unless a clock was set back."""
        found = np.zeros(len(t), bool)
        for start, stop, _ in self.gaps.T.tolist():
            found |= (start <= t) & (t < stop)
        return found


class HeardNodes:
    """Follows the frames of each node; nodes are at most 127 an interface.

    Args:
        least: shorter times without a frame, in ns, are no gaps.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self._nodes: dict[tuple[int, int], HeardNode] = {}
        # Time and number of the last frame of each node, by bus and node in one number; its lines, if it is old.
        self._t: Array = np.empty(0, np.int64)
        self._number: Array = np.empty(0, np.int64)
        self._lines: dict[int, tuple[str, ...]] = {}

    def keep_lines(self, view: View) -> None:
        """Keep the last frames of nodes that are silent: they may be gone when that is told."""
        for code in np.flatnonzero((self._t != NO_TIME) & (self._number < view.frames.first)).tolist():
            if code not in self._lines:
                self._lines[code] = view.lines((self._number.item(code),))

    def finish(self, ends: Mapping[int, int]) -> None:
        """Note what is silent up to when each bus was heard last."""
        for (bus, node), heard in self._nodes.items():
            t, number, lines = self._last(bus << _NODE_BITS | node)
            end = ends.get(bus, t)
            if end - t > self._least:
                heard.pause(Gap(t, end, number, lines))

    def _last(self, code: int) -> tuple[int, int, tuple[str, ...]]:
        return self._t.item(code), self._number.item(code), self._lines.get(code, ())

    def gaps(self, bus: int, node: int, start: int, stop: int) -> list[Gap]:
        """Return when a node was not heard between two times."""
        heard = self._nodes.get((bus, node))
        return [] if heard is None else heard.between(start, stop)

    def longest(self, bus: int, node: int, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return the longest times between two others in which a node was not heard, as they begin and end."""
        heard = self._nodes.get((bus, node))
        return (stop, stop) if heard is None else heard.longest(start, stop)

    def all_silent(self, bus: Array, node: Array, t: Array, end: int) -> Array:
        """Return which nodes that were heard lie in a gap at a time; `end` is the last time so far."""
        found = np.zeros(len(t), bool)
        for key, some in groups(bus.astype(np.int64) << _NODE_BITS | node):
            heard = self._nodes.get((key >> _NODE_BITS, key & _NODE))
            if heard is not None:
                since = self._t.item(key)
                last = (since <= t[some]) & (end - since > self._least)
                found[some] = last | heard.silent(t[some])
        return found

    def feed(self, frames: FrameTable) -> None:
        """Add a batch."""
        for bus, ours in bus_frames(frames).items():
            self._add(bus, frames.first, ours)

    def _add(self, bus: int, start: int, ours: BusFrames) -> None:
        gaps, nodes = ours.gaps(self._least, _MOST_GAPS), ours.nodes
        more = ((bus + 1) << _NODE_BITS) - len(self._t)
        if more > 0:
            self._t, self._number = (np.append(known, np.full(more, NO_TIME)) for known in (self._t, self._number))
        code, t = bus << _NODE_BITS | nodes.node, ours.times[nodes.first]
        before = self._t[code]
        new = before == NO_TIME
        for node in nodes.node[new].tolist():
            self._nodes[bus, node] = HeardNode()
        for k in np.flatnonzero(~new & (t - before > self._least)).tolist():
            since, number, lines = self._last(code.item(k))
            self._nodes[bus, nodes.node.item(k)].pause(Gap(since, t.item(k), number, lines))
        if self._lines:
            for one in self._lines.keys() & set(code.tolist()):
                del self._lines[one]
        self._t[code], self._number[code] = ours.times[nodes.last], nodes.last + start
        each = array("q", np.stack((gaps.since, gaps.until, gaps.row + start), axis=1).tobytes())
        for k, begin, end in spans(gaps.of):
            self._nodes[bus, nodes.node.item(k)].add(each[3 * begin : 3 * end])


class HeardSessions:
    """Follows the frames of each message type of a node: at most `MOST_SESSIONS` of these.

    Of the last frame of each it is known whether a transfer goes on behind it, its ID, and how many were left out.
    """

    def __init__(self) -> None:
        self._last = KeyedRows({"place": -1, "goes_on": 0, "transfer_id": -1, "lost": 0}, MOST_SESSIONS)

    def places(self, codes: Array) -> Array:
        """Return the places of sessions among all that were heard, by their codes; -1 for others."""
        return self._last.look_up("place", codes)

    def feed(self, frames: FrameTable) -> Iterator[SessionBegins]:
        """Add a batch; yield what began on each bus."""
        for ours in bus_frames(frames).values():
            yield self._begins(frames, ours)

    def _begins(self, frames: FrameTable, ours: BusFrames) -> SessionBegins:
        """Return what began on a bus; what that is made of is large, and gone when somebody looks at it."""
        at, first = ours.begins
        transfer_id = (ours.tail[at] & TAIL_ID).astype(np.int64)
        lost = np.zeros(len(at), np.int64)
        np.cumsum(np.maximum(transfer_id[1:] - transfer_id[:-1] & TAIL_ID, 1) - 1, out=lost[1:])
        some = ours.messages[~ours.beyond(ours.messages, self._last)]
        codes = ours.codes[some]
        rows = self._known(codes)
        place, going, before, left = self._last.cells(rows)
        goes_on = (going != 0) & (ours.tail[ours.first[some]] & TAIL_START == 0)
        begin, end = first[some] + goes_on, first[some + 1]
        self._last.put(rows, goes_on=ours.tail[ours.first[some + 1] - 1] & TAIL_END == 0)
        new = np.flatnonzero(begin < end)
        rows, codes, place, begin, end = (column[new] for column in (rows, codes, place, begin, end))
        missed = np.maximum((transfer_id[begin] - before[new]) % TRANSFER_IDS - 1, 0)
        left = left[new] + np.where(before[new] >= 0, missed, 0) - lost[begin]
        self._last.put(rows, transfer_id=transfer_id[end - 1], lost=lost[end - 1] + left)
        stop = np.cumsum(end - begin)
        begun = np.arange(stop[-1] if len(stop) else 0) + np.repeat(end - stop, end - begin)
        number, more = ours.row[at[begun]], np.repeat(left, end - begin)
        return SessionBegins(
            codes, place, np.append(0, stop), ours.times[number], frames.first + number, lost[begun] + more
        )

    def _known(self, codes: Array) -> Array:
        """Return the rows of sessions, which are there from now on."""
        rows = self._last.find(codes)
        new = np.flatnonzero(rows < 0)
        if not len(new):
            return rows
        self._last.add(codes[new], place=np.arange(len(new)) + len(self._last))
        return self._last.find(codes)
