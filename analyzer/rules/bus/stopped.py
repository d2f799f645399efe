"""Nodes that fall silent, and messages that stop, of those that came at a steady pace."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.bus.heard import Gap, HeardNodes, HeardSessions
from analyzer.rules.bus.sessions import Session, nodes_of
from analyzer.rules.recent import soon_gone
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Break, Occurrence, Pauses, Rule, Starts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.bus.heard import SessionBegins
    from dissectors.kit import Array, PacedReports, Severity, Values, View

_SHARE = 10 * SECOND  # of a silence: where frames are lost in it, the rest proves nothing
_MOST = 4096  # breaks that wait
_MOST_UNPROVED = 16  # of a session that may be another protocol's
_TOOLS = (126, 127)  # which come and go
# Types that are not judged: BUS-020 does, and what is sent when somebody asks.
_LEFT_OUT = (NODE_STATUS, "uavcan.protocol.dynamic_node_id.Allocation")
_MOSTLY = 0.6  # of a break is the node's silence: the last message and the next one lie up to a period around it
_SETTLES = 10 * SECOND  # within which a node that is back sends all its types again


class _Place(NamedTuple):
    """A frame, and how candump writes it."""

    number: int
    lines: tuple[str, ...]


class _Doubt(NamedTuple):
    """A break until all is known that may explain it; `gaps` are those of the node that make up most of it."""

    session: Session
    talk: int  # the place of the session
    found: Break
    place: _Place
    gaps: tuple[Gap, ...]
    ends: bool  # not before the capture does


class _Talks:
    """Sessions so far, in the order in which they were first heard; of each the last report, and what it is.

    `code` is that of its type once a transfer proves that it is DroneCAN's, else -1. The first frame of the last
    transfer has its `number`, and lines once it is about to be forgotten.
    """

    def __init__(self) -> None:
        self.session: Array = np.empty(0, np.int64)
        self.code: Array = np.empty(0, np.int64)
        self.number: Array = np.empty(0, np.int64)
        self._has_lines: Array = np.empty(0, bool)
        self._lines: dict[int, tuple[str, ...]] = {}

    def add(self, places: Array, codes: Array) -> None:
        """Add those that are new."""
        new = places >= len(self.code)
        if new.any():
            none = np.full(np.count_nonzero(new), -1)
            self.session = np.append(self.session, codes[new])
            self.code, self.number = np.append(self.code, none), np.append(self.number, none)
            self._has_lines = np.append(self._has_lines, none > 0)

    def end(self, places: Array, numbers: Array) -> None:
        """Set the last reports of some."""
        self.number[places] = numbers
        old = places[self._has_lines[places]]
        self._has_lines[old] = False
        for place in old.tolist():
            del self._lines[place]

    def keep_lines(self, view: View) -> None:
        """Keep the last frames of those that are silent: they may be gone when that is told."""
        places = np.flatnonzero((self.number < soon_gone(view.frames)) & ~self._has_lines)
        if len(places):
            self._has_lines[places] = True
            lines = view.each_line(self.number[places]).tolist()
            self._lines.update(zip(places.tolist(), ((line,) if line else () for line in lines), strict=True))

    def last(self, view: View, places: Array) -> list[_Place]:
        """Return the last reports of some."""
        numbers = self.number[places]
        lines = zip(places.tolist(), numbers.tolist(), view.each_line(numbers).tolist(), strict=True)
        return [_Place(number, self._lines.get(place) or ((line,) if line else ())) for place, number, line in lines]


class Stopped(Rule):
    """Compares the times of each node and type with its own pace."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-035",)

    def __init__(self) -> None:
        self._nodes: HeardNodes | None = None
        self._sessions = HeardSessions()
        self._pauses = Pauses(0)
        self._starts = Starts()
        self._talks = _Talks()
        self._paces: PacedReports | None = None
        self._doubts: list[_Doubt] = []
        self._unproved: dict[int, list[_Doubt]] = {}  # by place of a session that may be another protocol's
        self._told: dict[tuple[int, int, int], None] = {}  # gaps by bus, node and start, the last ones

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look for breaks, and tell those that nothing can explain any more."""
        if view.start == NO_TIME:
            return
        if self._nodes is None or self._paces is None:
            least = self._least(view)
            self._nodes, self._pauses = HeardNodes(least), Pauses(least)
            periods, fewest, seconds = (view.number("BUS-035", name) for name in ("periods", "min_reports", "min_s"))
            self._paces = view.paced_reports(least, periods, int(fewest), round(seconds * SECOND))
        self._pauses.feed(view)
        self._starts.feed(view)
        self._nodes.feed(view.frames)
        for begun in self._sessions.feed(view.frames):
            self._talks.add(begun.place, begun.codes)
            breaks = self._paces.feed(begun.place, begun.size, begun.t, begun.lost)
            if breaks:
                self._break(view, begun, breaks)
            self._talks.end(begun.place, begun.number[begun.size.cumsum() - 1])
        self._prove(view)
        self._talks.keep_lines(view)
        self._nodes.keep_lines(view)
        yield from self._judge(view, view.end)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Tell what is silent to the end."""
        if self._nodes is None or self._paces is None:
            return
        self._nodes.finish(self._pauses.last)
        buses = [Session.of(code).bus for code in self._talks.session.tolist()]
        until = [self._pauses.last.get(bus, last) for bus, last in zip(buses, self._paces.last.tolist(), strict=True)]
        silences = self._paces.silences(np.array(until, np.int64))
        last = self._talks.last(view, np.array([place for place, _ in silences], np.int64))
        self._doubt(view, [(*one, before) for one, before in zip(silences, last, strict=True)], ends=True)
        yield from self._judge(view, None)

    def _least(self, view: View) -> int:
        return round(view.number("BUS-035", "min_ms") * MILLISECOND)

    def _break(self, view: View, begun: SessionBegins, breaks: Sequence[tuple[int, Break]]) -> None:
        """Keep breaks of sessions, of which each has its place among those that have begun something."""
        first = begun.size.cumsum() - begun.size
        own = [(k, begun.place.item(k), found) for k, found in breaks]
        own = [one for one in own if self._has_room(one[1])]
        new = np.array([begun.number.item(first.item(k) + found.at) for k, _, found in own if found.at >= 0], np.int64)
        lines = zip(new.tolist(), view.each_line(new).tolist(), strict=True)
        before = (_Place(number, (line,) if line else ()) for number, line in lines)
        old = iter(self._talks.last(view, np.array([place for _, place, found in own if found.at < 0], np.int64)))
        self._doubt(view, [(place, found, next(old if found.at < 0 else before)) for _, place, found in own])

    def _waiting(self, place: int) -> tuple[list[_Doubt], int]:
        """Return the breaks that wait like those of a session, and how many may."""
        if self._talks.code.item(place) >= 0:
            return self._doubts, _MOST
        return self._unproved.setdefault(place, []), _MOST_UNPROVED

    def _has_room(self, place: int) -> bool:
        waiting, most = self._waiting(place)
        return len(waiting) < most

    def _doubt(self, view: View, breaks: Sequence[tuple[int, Break, _Place]], *, ends: bool = False) -> None:
        """Keep breaks of sessions, by their places, each behind its last report, as long as there is room."""
        if not breaks or self._nodes is None:
            return
        places, found, _ = zip(*breaks, strict=True)
        codes = self._talks.session[np.array(places)]
        spans = np.array([(one.start, one.stop) for one in found], np.int64).T
        begin, stop = self._nodes.longest(nodes_of(codes), *spans)
        mostly = (stop - begin > _MOSTLY * (spans[1] - spans[0])).tolist()
        for (place, one, last), code, silent in zip(breaks, codes.tolist(), mostly, strict=True):
            waiting, most = self._waiting(place)
            if len(waiting) < most:
                session = Session.of(code)
                meanwhile = self._meanwhile(view, session, one) if silent else ()
                waiting.append(_Doubt(session, place, one, last, meanwhile, ends))

    def _meanwhile(self, view: View, session: Session, found: Break) -> tuple[Gap, ...]:
        """Return the gaps of a session's node that make up most of a break."""
        gaps = self._nodes.gaps(session.bus, session.node, found.start, found.stop) if self._nodes else []
        longest = _MOSTLY * (found.stop - found.start)
        mostly = [gap for gap in gaps if gap.stop - gap.start > longest]
        return tuple(gap._replace(lines=gap.lines or view.lines((gap.number,))) for gap in mostly)

    def _prove(self, view: View) -> None:
        """Note the types of sessions; those that have none may be another protocol's."""
        places, codes = self._sessions.prove(view.transfers)
        self._talks.code[places] = codes
        for place in places.tolist() if self._unproved else ():
            self._doubts += self._unproved.pop(place, ())

    def _judge(self, view: View, now: int | None) -> Iterator[Occurrence]:
        waiting = []
        for one in self._doubts:
            if one.found.due(now):
                yield from self._judged(view, one)
            else:
                waiting.append(one)
        self._doubts = waiting

    def _judged(self, view: View, doubt: _Doubt) -> Iterator[Occurrence]:
        """Yield a break that nothing explains: what of it is the node's silence, and the rest."""
        (bus, node, _), found = doubt.session, doubt.found
        if found.may_be_slower(view.end):
            return
        if self._starts.between(bus, node, found.start, found.stop, found.told):
            return
        limit = max(view.number("BUS-035", "periods") * found.period, self._least(view))
        gaps = [gap for gap in doubt.gaps if self._silent(doubt, gap.start, gap.stop) > limit]
        for gap in gaps:
            if (bus, node, gap.start) not in self._told:
                self._told[bus, node, gap.start] = None
                if len(self._told) > _MOST:
                    del self._told[next(iter(self._told))]
                values = {"what": "nothing of the node", "before": ""}
                yield self._found(doubt, "", (gap.start, gap.stop), values, _Place(gap.number, gap.lines))
        begin, longest, start, until = found.start, 0.0, found.start, found.stop
        for gap in (*gaps, Gap(found.stop, found.stop, -1)):
            silent = self._silent(doubt, begin, gap.start) - (_SETTLES if begin > found.start else 0)
            if silent > longest:
                longest, start, until = silent, begin, gap.start
            begin = gap.stop
        name = view.type_name(self._talks.code.item(doubt.talk))
        if longest > limit and name not in _LEFT_OUT:
            values = {"what": "nothing of it", "before": f", every {found.period / MILLISECOND:.0f} ms before"}
            yield self._found(doubt, name, (start, until), values, doubt.place)

    def _silent(self, doubt: _Doubt, start: int, stop: int) -> float:
        """Return how long others showed that the bus went on."""
        return stop - start - self._pauses.inside(doubt.session.bus, start, stop, doubt.found.period)

    def _found(self, doubt: _Doubt, name: str, silence: tuple[int, int], values: Values, place: _Place) -> Occurrence:
        """Return a finding of a silence, in which pauses of the bus from 1 s on do not count."""
        (bus, node, _), (start, stop) = doubt.session, silence
        seconds = (stop - start - self._pauses.inside(bus, start, stop, SECOND)) / SECOND
        values = {**values, "seconds": seconds, "end": ", to the end" if doubt.ends else ""}
        severity: Severity | None = "note" if node in _TOOLS else None
        return Occurrence(
            "BUS-035", start, bus, node, name, (place.number,), values, severity,
            drops=True, until=min(stop, start + _SHARE), lines=place.lines,
        )  # fmt: skip
