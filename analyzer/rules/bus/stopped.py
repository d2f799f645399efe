"""Nodes that fall silent, and messages that stop, of those that came at a steady pace."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, NamedTuple

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.bus.heard import Gap, HeardNode, HeardNodes, HeardSessions
from analyzer.rules.bus.sessions import Session, first_transfers
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Break, Occurrence, PacedReports, Pauses, Rule, Starts
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.bus.heard import SessionBegins
    from dissectors.kit import Severity, Values, View

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
    found: Break
    place: _Place
    gaps: tuple[Gap, ...]
    ends: bool  # not before the capture does


@dataclass(slots=True, eq=False)
class _Talk:
    """A session so far. `code` is that of its type once a transfer proves that it is DroneCAN's."""

    pace: PacedReports
    number: int = -1  # of the first frame of the last transfer
    lines: tuple[str, ...] = ()
    code: int = -1
    unproved: list[_Doubt] = field(default_factory=list)


class Stopped(Rule):
    """Compares the times of each node and type with its own pace."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-035",)

    def __init__(self) -> None:
        self._nodes: HeardNodes | None = None
        self._sessions = HeardSessions()
        self._pauses = Pauses(0)
        self._starts = Starts()
        self._talks: dict[Session, _Talk] = {}
        self._doubts: list[_Doubt] = []
        self._told: dict[tuple[int, int, int], None] = {}  # gaps by bus, node and start, the last ones

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look for breaks, and tell those that nothing can explain any more."""
        if view.start == NO_TIME:
            return
        if self._nodes is None:
            least = self._least(view)
            self._nodes, self._pauses = HeardNodes(least), Pauses(least)
        self._pauses.feed(view)
        self._starts.feed(view)
        self._nodes.feed(view.frames)
        heard = list(self._sessions.feed(view.frames))
        for session, _ in heard:
            if session not in self._talks:
                self._talks[session] = _Talk(self._pace(view))
        talks = [self._talks[session] for session, _ in heard]
        times, lost = [one.t for _, one in heard], [one.lost for _, one in heard]
        breaks = PacedReports.feed_all([talk.pace for talk in talks], times, lost)
        for (session, starts), talk, found in zip(heard, talks, breaks, strict=True):
            for one in found:
                self._doubt(view, (session, talk), one, starts)
            talk.number, talk.lines = int(starts.number[-1]), ()
        self._prove(view)
        self._keep_lines(view)
        yield from self._judge(view, view.end)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Tell what is silent to the end."""
        if self._nodes is None:
            return
        for bus, heard in self._nodes.all():
            end = self._pauses.last.get(bus, heard.t)
            if end - heard.t > self._least(view):
                heard.pause(end)
        paces, ends = [talk.pace for talk in self._talks.values()], self._pauses.last
        until = [ends.get(session.bus, pace.last) for session, pace in zip(self._talks, paces, strict=True)]
        silences = PacedReports.silences(paces, until)
        for (session, talk), found in zip(self._talks.items(), silences, strict=True):
            if found is not None:
                self._doubt(view, (session, talk), found, None)
        yield from self._judge(view, None)

    def _least(self, view: View) -> int:
        return round(view.number("BUS-035", "min_ms") * MILLISECOND)

    def _pace(self, view: View) -> PacedReports:
        periods, fewest, seconds = (view.number("BUS-035", name) for name in ("periods", "min_reports", "min_s"))
        return PacedReports(self._least(view), periods, int(fewest), round(seconds * SECOND))

    def _doubt(self, view: View, who: tuple[Session, _Talk], found: Break, begun: SessionBegins | None) -> None:
        """Keep a break of what began of a session in a batch, or that lasts to the end, if there is room."""
        session, talk = who
        waiting, most = (self._doubts, _MOST) if talk.code >= 0 else (talk.unproved, _MOST_UNPROVED)
        if len(waiting) >= most:
            return
        gaps = self._nodes.gaps(session.bus, session.node, found.start, found.stop) if self._nodes else []
        longest = _MOSTLY * (found.stop - found.start)
        mostly = [gap for gap in gaps if gap.stop - gap.start > longest]
        meanwhile = tuple(gap._replace(lines=gap.lines or view.lines((gap.number,))) for gap in mostly)
        place = _Place(talk.number, talk.lines) if begun is None else _place(view, talk, begun, found)
        waiting.append(_Doubt(session, found, place, meanwhile, ends=begun is None))

    def _prove(self, view: View) -> None:
        """Note the types of sessions; those that have none may be another protocol's."""
        if all(talk.code >= 0 for talk in self._talks.values()):
            return
        for session, row in sorted(first_transfers(view.transfers)):
            talk = self._talks.get(session)
            if talk is not None and talk.code < 0:
                talk.code = int(view.transfers.code[row])
                self._doubts += talk.unproved
                talk.unproved = []

    def _keep_lines(self, view: View) -> None:
        """Keep the last frames of those that are silent: they may be gone when that is told."""
        first = view.frames.first
        silent: list[_Talk | HeardNode] = [*self._talks.values()]
        silent += [] if self._nodes is None else [heard for _, heard in self._nodes.all()]
        for one in silent:
            if one.number < first and not one.lines:
                one.lines = view.lines((one.number,))

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
        name = view.type_name(self._talks[doubt.session].code)
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


def _place(view: View, talk: _Talk, begun: SessionBegins, found: Break) -> _Place:
    """Return the last report before a break."""
    number = talk.number if found.at < 0 else begun.number.item(found.at)
    return _Place(number, talk.lines if found.at < 0 and talk.lines else view.lines((number,)))
