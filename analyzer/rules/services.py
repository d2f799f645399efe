"""Requests and responses: which belong together, and how long answers take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from analyzer.tables import KINDS, STATUSES
from dissectors.conformance import NO_TIME, SECOND, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.conformance import Values, View

REQUEST, RESPONSE = KINDS.index("request"), KINDS.index("response")
ANSWER = SECOND  # when a client gives up
SLOW = SECOND // 2
OPEN = 2 * SECOND  # how long a response belongs to a request
LATE = 5 * SECOND  # a request can come out 2.0 s after its start, if its end was lost
MOST = 4096  # open requests, and responses without one; older ones are left out
_WHOLE = frozenset(STATUSES.index(word) for word in ("ok", "unchecked", "bad crc"))

_Key = tuple[int, int, int, int, int]


class _Part(NamedTuple):
    """A request or response as a transfer."""

    t: int
    t_end: int
    bus: int
    node: int
    type: str
    priority: int
    frames: Sequence[int]


@dataclass(slots=True)
class _Call:
    """A request, its first response, and whether its silence was reported; a damaged one needs no answer."""

    request: _Part
    whole: bool
    response: _Part | None = None
    missed: bool = False


class Services(Watcher):
    """Follows calls by (interface, service, client, server, transfer ID)."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-021", "TRF-022", "TRF-023", "TRF-024", "TRF-025")

    def __init__(self) -> None:
        self._calls: dict[_Key, _Call] = {}
        self._strays: list[tuple[_Key, Occurrence]] = []

    def look(self, view: View) -> Iterator[Occurrence]:
        """Calls of this batch, and those whose time is over."""
        t = view.transfers
        for row in np.flatnonzero(t.kind >= REQUEST).tolist():
            whole, src, dst = int(t.status[row]) in _WHOLE, int(t.src[row]), int(t.dst[row])
            part = _Part(
                int(t.t[row]), int(t.t_end[row]), int(t.bus[row]), src, view.type_name(int(t.code[row])),
                int(t.priority[row]), tuple(t.frames(row)),
            )  # fmt: skip
            nodes = (src, dst) if int(t.kind[row]) == REQUEST else (dst, src)
            key = (part.bus, int(t.type_id[row]), *nodes, int(t.transfer_id[row]))
            if int(t.kind[row]) == REQUEST:
                yield from self._ask(key, part, whole=whole)
            elif whole:
                yield from self._answer(key, part, view)
        yield from self._pass(view.end, LATE)

    def settle(self, view: View) -> Iterator[Occurrence]:
        """What the end of the capture leaves open."""
        yield from self._pass(view.end, 0)

    def _ask(self, key: _Key, part: _Part, *, whole: bool) -> Iterator[Occurrence]:
        if not whole:
            # It may come out behind its response; that one is no stray then.
            self._strays = [one for one in self._strays if one[0] != key or not 0 <= one[1].t - part.t <= OPEN]
        before = self._calls.pop(key, None)
        if before is not None:
            yield from _judged(key, before, part.t)
        if len(self._calls) >= MOST:
            self._calls.pop(next(iter(self._calls)))
        self._calls[key] = _Call(part, whole)

    def _answer(self, key: _Key, part: _Part, view: View) -> Iterator[Occurrence]:
        call = self._calls.get(key)
        if call is None or part.t - call.request.t > OPEN:
            if len(self._strays) < MOST:
                early = part.t == NO_TIME or part.t - view.starts[part.bus] < OPEN
                stray = _about("TRF-021", part, {"transfer_id": key[4], "dst": key[2]})
                self._strays.append((key, replace(stray, severity="note") if early else stray))
            return
        request = call.request
        timed = NO_TIME not in (part.t_end, request.t_end)
        delay = part.t_end - request.t_end if timed else 0
        if call.response is None:
            yield from _judged(key, call, part.t_end)
            call.response = part
            if delay > SLOW:
                yield _about("TRF-023", part, {"seconds": delay / SECOND}, request)
        else:
            yield _about("TRF-024", part, {"transfer_id": key[4]}, call.response)
        if part.priority != request.priority:
            values = {"expected": request.priority, "priority": part.priority}
            yield _about("TRF-025", part, values, request)

    def _pass(self, now: int, late: int) -> Iterator[Occurrence]:
        """Reports what can no longer become right, and forgets what can no longer be answered."""
        for key, call in list(self._calls.items()):
            yield from _judged(key, call, now)
            if now - call.request.t > LATE:
                del self._calls[key]
        kept = []
        for key, stray in self._strays:
            if late and (now == NO_TIME or now - stray.t <= late):
                kept.append((key, stray))
            else:
                yield stray
        self._strays = kept


def _judged(key: _Key, call: _Call, now: int) -> Iterator[Occurrence]:
    """Reports a call once that `now` has waited too long."""
    request = call.request
    if call.whole and call.response is None and not call.missed and NO_TIME not in (now, request.t_end):
        call.missed = now - request.t_end > ANSWER
        if call.missed:
            yield _about("TRF-022", request, {"dst": key[3], "limit_s": ANSWER / SECOND})


def _about(rule: str, part: _Part, values: Values, other: _Part | None = None) -> Occurrence:
    """One breach, with the transfer it is compared with behind it."""
    frames = (*part.frames, *(other.frames if other else ()))
    return Occurrence(rule, part.t, part.bus, part.node or None, part.type, frames, values)


WATCHERS: tuple[type[Watcher], ...] = (Services,)
