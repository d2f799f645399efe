"""Requests and responses: which belong together, and how long answers take."""

from __future__ import annotations

from bisect import insort
from operator import attrgetter
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.bus.heard import HeardNodes
from analyzer.tables import EXTENDED, KINDS, STATUSES, distinct
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, Rule, by_key
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.kit import Array, Values, View

REQUEST, RESPONSE = KINDS.index("request"), KINDS.index("response")
ANSWER = SECOND  # when a client gives up
SLOW = SECOND // 2
OPEN = 2 * SECOND  # how long a response belongs to a request
_GONE = 2 * SECOND  # a server that sends nothing for so long lives no more
LATE = 3 * SECOND  # a request can come out 2.0 s after its start, if its end was lost
MOST = 256  # transfers of a link that wait
MOST_LINKS = 1024  # older ones are left out
_WHOLE = frozenset(STATUSES.index(word) for word in ("ok", "unchecked", "bad crc"))
_NODES = 128
# Of the identifier of a service frame: that it is one, that it asks, and all but the priority and these.
_SERVICE, _ASKS, _LINK = 1 << 7, 1 << 15, 0xFF_7F7F

_Link = tuple[int, int, int, int]


@dataclass(slots=True, eq=False)
class _Part:
    """A request or response as a transfer; they are put in the order of their first frames.

    `lines` are those of a transfer of an earlier batch, whose frames may be gone when it is told.
    """

    frames: Sequence[int]
    kind: int
    t: int
    t_end: int
    bus: int
    node: int
    code: int
    priority: int
    transfer_id: int
    whole: bool
    lines: tuple[str, ...] | None = None

    @property
    def first(self) -> int:
        """The number of the first frame."""
        return self.frames[0]

    def evidence(self, view: View) -> tuple[str, ...]:
        """Return it as candump writes it."""
        return view.lines(self.frames) if self.lines is None else self.lines


@dataclass(slots=True)
class _Call:
    """A request, its first response, and whether its silence was reported; a damaged one needs no answer."""

    request: _Part
    server: int
    response: _Part | None = None
    missed: bool = False

    @property
    def waits(self) -> bool:
        """Return whether its silence may be reported."""
        one = self.request
        return one.whole and self.response is None and not self.missed and one.t_end != NO_TIME


@dataclass(slots=True)
class _Talk:
    """The calls of one client and one server for one service: what waits, and calls by transfer ID."""

    client: int
    server: int
    waiting: list[_Part] = field(default_factory=list)
    calls: dict[int, _Call] = field(default_factory=dict)
    asked: bool = False
    answered: bool = False

    def add(self, part: _Part) -> None:
        """Add a transfer to those that wait."""
        if self.waiting and part.first < self.waiting[-1].first:
            insort(self.waiting, part, key=_first)
        else:
            self.waiting.append(part)

    def keep_lines(self, view: View) -> None:
        """Keep the lines of what is not told yet."""
        both = (part for call in self.calls.values() for part in (call.request, call.response) if part is not None)
        for part in (*self.waiting, *both):
            if part.lines is None:
                part.lines = view.lines(part.frames)


_first = attrgetter("first")


class Services(Rule):
    """Follows calls by (interface, service, client, server, transfer ID).

    The core holds a session back until it is proven, so a request can come out long after its response. Each transfer
    waits for `LATE`, and a response for the first request of its session, a request for a sign of its server and for a
    response that may have been sent, but is held back.
    """

    rules: ClassVar[tuple[str, ...]] = ("TRF-021", "TRF-022", "TRF-023", "TRF-024", "TRF-025")

    def __init__(self) -> None:
        self._talks: dict[_Link, _Talk] = {}
        self._heard: set[int] = set()
        self._held: set[_Link] = set()
        self._nodes = HeardNodes(_GONE)
        self._now = NO_TIME
        self._missed: list[_Call] = []  # with this batch

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield calls of this batch, and those whose time is over."""
        self._note_held(view)
        self._nodes.feed(view.frames)
        t = view.transfers
        if not len(t):
            return
        now = np.maximum.accumulate(np.maximum(t.t_end, self._now))
        new = _first_heard(t.bus.astype(np.int64) * _NODES + t.src)
        rows = np.flatnonzero(t.kind >= REQUEST)
        ends, numbers = t.frame_lists
        columns = t.src, t.dst, t.type_id, t.kind, t.t, t.t_end, t.bus, t.code, t.priority, t.transfer_id, t.status
        parts = (rows, ends[rows], ends[rows + 1], now[rows], *(column[rows] for column in columns))
        talks = self._talks
        changed: dict[_Link, None] = {}
        for row, begin, end, self._now, src, dst, type_id, *cells in zip(
            *(column.tolist() for column in parts), strict=True
        ):
            while new and new[-1][0] < row:
                self._heard.add(new.pop()[1])
            kind, at, at_end, bus, code, priority, transfer_id, status = cells
            frames = tuple(numbers[begin:end].tolist())
            part = _Part(frames, kind, at, at_end, bus, src, code, priority, transfer_id, status in _WHOLE)
            client, server = (src, dst) if kind == REQUEST else (dst, src)
            link = (bus, type_id, client, server)
            talk = talks.get(link)
            if talk is None:
                if len(talks) >= MOST_LINKS:
                    yield from self._settled(talks.pop(next(iter(talks))), view)
                talk = talks[link] = _Talk(client, server)
            changed[link] = None
            yield from self._release(talk, link, view)
            talk.add(part)
            talk.asked |= kind == REQUEST
            talk.answered |= kind == RESPONSE
            if len(talk.waiting) > MOST:
                yield from self._next(talk, talk.waiting.pop(0), view)
        self._heard.update(node for _, node in new)
        self._now = int(now[-1])
        for link, talk in talks.items():
            yield from self._release(talk, link, view)
        yield from self._unanswered(view)
        for link in changed:
            if link in talks:
                talks[link].keep_lines(view)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what the end of the capture leaves open."""
        for talk in self._talks.values():
            yield from self._settled(talk, view)
        yield from self._unanswered(view)

    def _note_held(self, view: View) -> None:
        """Note links with frames that look like a response, whether or not that is out yet."""
        frames = view.frames
        rows = np.flatnonzero((frames.id & (_SERVICE | _ASKS) == _SERVICE) & (frames.flags & EXTENDED != 0))
        for code in distinct(frames.bus[rows].astype(np.int64) << 32 | frames.id[rows] & _LINK):
            if len(self._held) < MOST_LINKS:
                self._held.add((code >> 32, code >> 16 & 0xFF, code >> 8 & 0x7F, code & 0x7F))

    def _release(self, talk: _Talk, link: _Link, view: View) -> Iterator[Occurrence]:
        """Judge what has waited long enough, and reports calls that can no longer be answered."""
        if self._now == NO_TIME or not talk.asked:
            return
        if not talk.answered and (link in self._held or link[0] * _NODES + talk.server not in self._heard):
            return
        until = self._now - LATE
        while talk.waiting and talk.waiting[0].t < until:
            yield from self._next(talk, talk.waiting.pop(0), view)
        if not talk.calls:
            return
        for call in talk.calls.values():
            self._judge(call, until, view)
        talk.calls = {key: call for key, call in talk.calls.items() if until - call.request.t <= OPEN}

    def _settled(self, talk: _Talk, view: View) -> Iterator[Occurrence]:
        """Yield all that waits, and what is still open at the end."""
        for part in talk.waiting:
            yield from self._next(talk, part, view)
        for call in talk.calls.values():
            self._judge(call, view.end, view)

    def _next(self, talk: _Talk, part: _Part, view: View) -> Iterable[Occurrence]:
        """Take the next transfer in the order of the capture; return what is wrong about it."""
        call = talk.calls.get(part.transfer_id)
        if part.kind == REQUEST:
            if call is not None:
                self._judge(call, part.t, view)
            talk.calls[part.transfer_id] = _Call(part, talk.server)
        elif part.whole:
            return self._answer(talk, call, part, view)
        return ()

    def _answer(self, talk: _Talk, call: _Call | None, part: _Part, view: View) -> Iterator[Occurrence]:
        if call is None or part.t - call.request.t > OPEN:
            begun = NO_TIME if part.t == NO_TIME else max(view.starts[part.bus], view.resumed(part.t))
            early = part.t == NO_TIME or part.t - begun < OPEN
            if early and view.cut_in:
                return
            stray = _about(view, "TRF-021", part, {"transfer_id": part.transfer_id, "dst": talk.client})
            yield replace(stray, severity="note" if early else None, drops=True, since=part.t - OPEN)
            return
        request = call.request
        timed = NO_TIME not in (part.t_end, request.t_end)
        delay = part.t_end - request.t_end if timed else 0
        if call.response is None:
            self._judge(call, part.t_end, view)
            call.response = part
            if delay > SLOW:
                yield _about(view, "TRF-023", part, {"seconds": delay / SECOND}, request)
        else:
            yield _about(view, "TRF-024", part, {"transfer_id": part.transfer_id}, call.response)
        if part.priority != request.priority:
            values = {"expected": request.priority, "priority": part.priority}
            yield _about(view, "TRF-025", part, values, request)

    def _judge(self, call: _Call, now: int, view: View) -> None:
        """Note a call once that `now` has waited too long; its answer may have come in a gap."""
        if not call.waits or now == NO_TIME:
            return
        request = call.request
        call.missed = now - request.t_end > ANSWER
        if call.missed:
            until = request.t_end + ANSWER
            gone = self._nodes.silent(request.bus, call.server, until, view.end)
            if not gone and not view.paused(request.t_end, until):
                self._missed.append(call)

    def _unanswered(self, view: View) -> Iterator[Occurrences]:
        """Report the calls that were noted."""
        if not self._missed:
            return
        missed, self._missed = self._missed, []
        parts = [call.request for call in missed]
        cells = ((one.t, one.bus, one.node or NOBODY, one.code, one.first, one.t_end + ANSWER) for one in parts)
        t, bus, node, code, frame, until = (np.array(column, np.int64) for column in zip(*cells, strict=True))
        yield Occurrences(
            rule="TRF-022", t=t, bus=bus, node=node, type=code, frame=frame,
            values=lambda k: {"dst": missed[k].server, "limit_s": ANSWER / SECOND},
            frames=lambda k: parts[k].frames, drops=True, until=until, each_named=True,
            lines=lambda k: parts[k].evidence(view),
        )  # fmt: skip


def _first_heard(who: Array) -> list[tuple[int, int]]:
    """Return the first row of each node, and the node; the last first."""
    order, begins = by_key(who)
    rows = order[begins]
    return sorted(zip(rows.tolist(), who[rows].tolist(), strict=True), reverse=True)


def _about(view: View, rule: str, part: _Part, values: Values, other: _Part | None = None) -> Occurrence:
    """Return one breach, with the transfer it is compared with behind it."""
    frames, lines = part.frames, part.evidence(view)
    if other is not None:
        frames, lines = (*frames, *other.frames), (*lines, *other.evidence(view))
    type_ = view.type_name(part.code)
    return Occurrence(rule, part.t, part.bus, part.node or None, type_, frames, values, lines=lines)
