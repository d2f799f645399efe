"""Requests and responses: which belong together, and how long answers take."""

from __future__ import annotations

from bisect import insort
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from analyzer.rules.bus.heard import HeardNodes
from analyzer.tables import EXTENDED, KINDS, STATUSES, distinct
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, by_key
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

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


class _Part(NamedTuple):
    """A request or response as a transfer; they are put in the order of their first frames."""

    frames: Sequence[int]
    kind: int
    t: int
    t_end: int
    bus: int
    node: int
    type: str
    priority: int
    transfer_id: int
    whole: bool
    lines: tuple[str, ...]


@dataclass(slots=True)
class _Call:
    """A request, its first response, and whether its silence was reported; a damaged one needs no answer."""

    request: _Part
    response: _Part | None = None
    missed: bool = False


@dataclass(slots=True)
class _Talk:
    """The calls of one client and one server for one service: what waits, and calls by transfer ID."""

    client: int
    server: int
    waiting: list[_Part] = field(default_factory=list)
    calls: dict[int, _Call] = field(default_factory=dict)
    asked: bool = False
    answered: bool = False


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

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield calls of this batch, and those whose time is over."""
        self._note_held(view)
        self._nodes.feed(view.frames)
        t = view.transfers
        if not len(t):
            return
        now = np.maximum.accumulate(np.maximum(t.t_end, self._now))
        new = _first_heard(t.bus.astype(np.int64) * _NODES + t.src)
        rows = np.flatnonzero(t.kind >= REQUEST)
        columns = t.src, t.dst, t.type_id, t.kind, t.t, t.t_end, t.bus, t.code, t.priority, t.transfer_id, t.status
        parts = (column[rows].tolist() for column in (now, *columns))
        for row, (latest, src, dst, type_id, *cells) in zip(rows.tolist(), zip(*parts, strict=True), strict=True):
            while new and new[-1][0] < row:
                self._heard.add(new.pop()[1])
            self._now, (kind, at, end, bus, code, priority, transfer_id, status) = latest, cells
            frames = tuple(t.frames(row))
            part = _Part(
                frames, kind, at, end, bus, src, view.type_name(code), priority, transfer_id, status in _WHOLE,
                view.lines(frames),
            )  # fmt: skip
            client, server = (src, dst) if kind == REQUEST else (dst, src)
            link = (bus, type_id, client, server)
            if link not in self._talks and len(self._talks) >= MOST_LINKS:
                yield from self._settled(self._talks.pop(next(iter(self._talks))), view)
            talk = self._talks.setdefault(link, _Talk(client, server))
            yield from self._release(talk, link, view)
            insort(talk.waiting, part)
            talk.asked |= kind == REQUEST
            talk.answered |= kind == RESPONSE
            if len(talk.waiting) > MOST:
                yield from self._next(talk, talk.waiting.pop(0), view)
        self._heard.update(node for _, node in new)
        self._now = int(now[-1])
        for link, talk in self._talks.items():
            yield from self._release(talk, link, view)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield what the end of the capture leaves open."""
        for talk in self._talks.values():
            yield from self._settled(talk, view)

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
        for key, call in list(talk.calls.items()):
            yield from self._judged(talk, call, until, view)
            if until - call.request.t > OPEN:
                del talk.calls[key]

    def _settled(self, talk: _Talk, view: View) -> Iterator[Occurrence]:
        """Yield all that waits, and what is still open at the end."""
        for part in talk.waiting:
            yield from self._next(talk, part, view)
        for call in talk.calls.values():
            yield from self._judged(talk, call, view.end, view)

    def _next(self, talk: _Talk, part: _Part, view: View) -> Iterator[Occurrence]:
        """Take the next transfer in the order of the capture."""
        call = talk.calls.get(part.transfer_id)
        if part.kind == REQUEST:
            if call is not None:
                yield from self._judged(talk, call, part.t, view)
            talk.calls[part.transfer_id] = _Call(part)
        elif part.whole:
            yield from self._answer(talk, call, part, view)

    def _answer(self, talk: _Talk, call: _Call | None, part: _Part, view: View) -> Iterator[Occurrence]:
        if call is None or part.t - call.request.t > OPEN:
            begun = NO_TIME if part.t == NO_TIME else max(view.starts[part.bus], view.resumed(part.t))
            early = part.t == NO_TIME or part.t - begun < OPEN
            if early and view.cut_in:
                return
            stray = _about("TRF-021", part, {"transfer_id": part.transfer_id, "dst": talk.client})
            yield replace(stray, severity="note" if early else None, drops=True, since=part.t - OPEN)
            return
        request = call.request
        timed = NO_TIME not in (part.t_end, request.t_end)
        delay = part.t_end - request.t_end if timed else 0
        if call.response is None:
            yield from self._judged(talk, call, part.t_end, view)
            call.response = part
            if delay > SLOW:
                yield _about("TRF-023", part, {"seconds": delay / SECOND}, request)
        else:
            yield _about("TRF-024", part, {"transfer_id": part.transfer_id}, call.response)
        if part.priority != request.priority:
            values = {"expected": request.priority, "priority": part.priority}
            yield _about("TRF-025", part, values, request)

    def _judged(self, talk: _Talk, call: _Call, now: int, view: View) -> Iterator[Occurrence]:
        """Report a call once that `now` has waited too long; its answer may have come in a gap."""
        request = call.request
        if request.whole and call.response is None and not call.missed and NO_TIME not in (now, request.t_end):
            call.missed = now - request.t_end > ANSWER
            until = request.t_end + ANSWER
            gone = self._nodes.silent(request.bus, talk.server, until, view.end)
            if call.missed and not gone and not view.paused(request.t_end, until):
                silent = _about("TRF-022", request, {"dst": talk.server, "limit_s": ANSWER / SECOND})
                yield replace(silent, drops=True, until=until)


def _first_heard(who: Array) -> list[tuple[int, int]]:
    """Return the first row of each node, and the node; the last first."""
    order, begins = by_key(who)
    rows = order[begins]
    return sorted(zip(rows.tolist(), who[rows].tolist(), strict=True), reverse=True)


def _about(rule: str, part: _Part, values: Values, other: _Part | None = None) -> Occurrence:
    """Return one breach, with the transfer it is compared with behind it."""
    frames, lines = part.frames, part.lines
    if other is not None:
        frames, lines = (*frames, *other.frames), (*lines, *other.lines)
    return Occurrence(rule, part.t, part.bus, part.node or None, part.type, frames, values, lines=lines)
