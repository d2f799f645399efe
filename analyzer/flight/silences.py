"""Nodes that send evenly and fall silent, or go slower; and how their transfer IDs go on over holes."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.flight.clock import ANEW
from analyzer.flight.log import FlightEvent
from analyzer.flight.robust import of_few
from analyzer.flight.thresholds import lasting, threshold
from analyzer.tables import KINDS
from dissectors.kit.cells import numbers
from dissectors.kit.order import changes, steps
from dissectors.records import dataclass, field
from dissectors.times import MILLISECOND, NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, RowPlaces, Spot
    from dissectors import Registry
    from dissectors.kit import Array

MOST_SESSIONS = 8192
_MESSAGE = KINDS.index("message")


@dataclass(frozen=True, slots=True)
class SenderPace:
    """A type that a node sends: `usual` is its period, 0 if it is not even; `first` and `last` are recorded times."""

    bus: int
    node: int
    type: str
    usual: int
    first: int
    last: int


@dataclass(slots=True)
class _Session:
    """One sender and type. `usual` is its period, `limit` what is too long; 0 while that is not known."""

    bus: int
    node: int
    type: str
    last: Spot | None = None
    first: int = 0
    usual: int = 0
    limit: int = 0
    learned: list[int] = field(default_factory=list)
    pauses: list[FlightEvent] = field(default_factory=list)  # in a row
    holes: int = 0

    def goes_on(self, first: int, least: int, most: int) -> bool:
        """Return whether transfers come as ever: from the first on with at least and at most so much between them."""
        if not self.limit or self.last is None or least < 0:
            return False
        return most <= self.limit and 0 <= first - self.last.ran <= self.limit


class SilenceEvents:
    """Adds up batches; bound: `MOST_SESSIONS`.

    Args:
        registry: the types.
        clock: of the capture, fed before.
        add: takes the events.
        commands: types whose silence is that of commands.
    """

    def __init__(
        self, registry: Registry, clock: RecordedClock, add: Callable[[FlightEvent], None], commands: Collection[str]
    ) -> None:
        self._registry, self._clock, self._add, self._commands = registry, clock, add, commands
        self._sessions: dict[int, _Session] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        transfers = batch.transfers
        kind, src = (numbers(transfers.column(name)) for name in ("kind", "src"))
        rows = np.flatnonzero((kind == _MESSAGE) & (src > 0) & (self._clock.transfers.t != NO_TIME))
        if not len(rows):
            return
        bus, type_id = (numbers(transfers.column(name)).astype(np.uint32) for name in ("bus", "type_id"))
        every = bus << 24 | type_id << 8 | src
        keys, at = (every[rows], self._clock.transfers.take(rows)) if len(rows) < len(every) else (
            every, self._clock.transfers
        )  # fmt: skip
        behind = self._clock.holes_before(at.frame) if self._clock.holes else None
        order, begins = grouped(keys)
        ran = at.ran[order]
        paces = _paces(ran, begins)
        for (start, stop), pace in zip(pairwise([*begins.tolist(), len(order)]), paces, strict=True):
            key, places = int(keys[order[start]]), order[start:stop]
            session = self._sessions.get(key)
            if session is not None and session.goes_on(int(ran[start]), *pace):
                self._calm(session)
                session.last = at.at(int(places[-1]))
                if behind is not None:
                    self._note_holes(session, at.step[places], behind[places], [(0, session.usual)], None)
                continue
            if session is None:
                if len(self._sessions) >= MOST_SESSIONS:
                    continue
                about = self._registry.message(_MESSAGE, key >> 8 & 0xFFFF)
                name = about.table if about is not None else f"type {key >> 8 & 0xFFFF}"
                session = self._sessions[key] = _Session(key >> 24, key & 0xFF, name)
                session.holes = 0 if behind is None else int(behind[places[0]])
            self._take(session, at.take(places), None if behind is None else behind[places])

    def finish(self) -> None:
        """Tell who is silent to the end of the recording."""
        end = self._clock.ran
        for session in self._sessions.values():
            for event in session.pauses:
                self._add(event)
            last = session.last
            if session.limit and end is not None and last is not None and end - last.ran > session.limit:
                self._add(self._silence(session, last, None, end))

    def paces(self) -> list[SenderPace]:
        """Return who sends what, and how evenly."""
        return [
            SenderPace(one.bus, one.node, one.type, one.usual, one.first, one.last.ran)
            for one in self._sessions.values()
            if one.last is not None
        ]

    def _take(self, session: _Session, at: RowPlaces, behind: Array | None) -> None:
        """Take transfers, and how many holes are `behind` each, None while there are none."""
        ran = at.ran
        start = ran[0] if session.last is None else session.last.ran
        gaps, kept, usual = steps(ran, start), None, [(0, session.usual)]
        if gaps.min() < 0:  # a torn transfer is told only when the next one with its ID comes
            kept = ran >= np.maximum(np.maximum.accumulate(ran), start)
        some = at if kept is None else at.take(kept)
        if len(some):
            gaps = gaps if kept is None else steps(some.ran, start)
            k = 0
            if session.last is None:
                session.first, k = int(some.ran[0]), 1
            while k < len(gaps):
                k = self._pauses(session, some, gaps, k) if session.limit else self._learn(session, gaps, k)
                if session.usual != usual[-1][1]:
                    usual.append((k, session.usual))
            session.last = some.at(-1)
        if behind is not None:
            self._note_holes(session, at.step, behind, usual, kept)

    def _note_holes(
        self, session: _Session, step: Array, behind: Array, usual: Sequence[tuple[int, int]], kept: Array | None
    ) -> None:  # fmt: skip
        """Note how IDs go on behind holes in which the sender would have sent, by what was `usual` then.

        That is told behind so many of the transfers that were `kept`, None for all.
        """
        rows = changes(behind, session.holes)
        session.holes = int(behind[-1])
        if not len(rows) or not any(period for _, period in usual):
            return
        taken = rows if kept is None else (np.cumsum(kept) - kept)[rows]
        since, periods = (np.array(column) for column in zip(*usual, strict=True))
        period = periods[np.searchsorted(since, taken, "right") - 1]
        rows = rows[(period > 0) & (np.abs(self._clock.lengths_before(behind[rows])) > 2 * period)]
        for number, how in zip(behind[rows].tolist(), step[rows].tolist(), strict=True):
            self._clock.holes[number - 1].steps[0 if how == 1 else 2 if how == ANEW else 1] += 1

    def _pauses(self, session: _Session, at: RowPlaces, gaps: Array, k: int) -> int:
        """Take gaps until it is known that the sender goes slower; return where to go on."""
        most = threshold("slower_after")
        for place in (np.flatnonzero(gaps[k:] > session.limit) + k).tolist():
            if place > k:
                self._calm(session)
            k = place + 1
            last = at.at(place - 1) if place else session.last
            if last is not None:
                here = at.at(place)
                session.pauses.append(self._silence(session, last, here, here.ran))
            if len(session.pauses) >= most:
                self._slower(session)
                return k
        if k < len(gaps):
            self._calm(session)
        return len(gaps)

    def _learn(self, session: _Session, gaps: Array, k: int) -> int:
        """Take periods until they are enough; return where to go on."""
        wanted = int(threshold("usual_count"))
        some = gaps[k : k + wanted - len(session.learned)].tolist()
        session.learned += some
        if len(session.learned) >= wanted:
            usual = int(of_few(session.learned))
            if usual > 0 and max(session.learned) <= threshold("usual_spread") * usual:
                session.usual = usual
                session.limit = max(int(threshold("silence_factor") * usual), lasting("silence"))
            session.learned = []
        return k + len(some)

    def _calm(self, session: _Session) -> None:
        """Tell the pauses after which it went on as usual."""
        for event in session.pauses:
            self._add(event)
        session.pauses = []

    def _slower(self, session: _Session) -> None:
        """Tell that it goes slower, instead of the pauses that showed it; what is usual now is learned anew."""
        first = session.pauses[0]
        pauses = sorted(event.values["silent_s"] for event in session.pauses)
        text = f"{session.type} comes slower: every {_span(int(pauses[1] * SECOND))}, {_span(session.usual)} before"
        values = {"period_s": pauses[1], "period_before_s": session.usual / SECOND}
        self._add(FlightEvent(
            "rate", text, first.before, first.first, None, session.bus, session.node, None, session.type, "", values
        ))  # fmt: skip
        session.pauses, session.usual, session.limit = [], 0, 0

    def _silence(self, session: _Session, last: Spot, back: Spot | None, end: int) -> FlightEvent:
        """Return that nothing came behind `last`: it was due one period later."""
        pause = end - last.ran
        due = last._replace(t=last.t + session.usual, ran=last.ran + session.usual)
        ordered = session.type in self._commands
        jumped = back is not None and back.step != ANEW and (back.step - 1) % 32 > 0
        nothing = "no command is recorded" if jumped else "nothing is commanded"
        what = nothing if ordered else f"{session.type} stops"
        text = f"{what}, " + ("to the end" if back is None else f"back after {_span(pause)}")
        values: dict[str, float] = {"silent_s": pause / SECOND, "period_s": session.usual / SECOND}
        if back is not None and back.step == ANEW:
            text += ", begins anew"
        elif back is not None:
            missing = (back.step - 1) % 32
            text += ", no transfer ID missing" if not missing else f", transfer IDs jump by {back.step}"
            values["missing"] = float(missing)
        kind = "commands stop" if ordered else "silence"
        return FlightEvent(
            kind, text, last, due, back, session.bus, session.node, None, session.type, "", values
        )  # fmt: skip


def _paces(ran: Array, begins: Array) -> Iterator[tuple[int, int]]:
    """Return the least and the most time from one to the next of each group, 0 of a single one."""
    apart = steps(ran, 0)
    apart[begins] = np.where(np.diff(begins, append=len(ran)) > 1, apart[np.minimum(begins + 1, len(ran) - 1)], 0)
    return zip(np.minimum.reduceat(apart, begins).tolist(), np.maximum.reduceat(apart, begins).tolist(), strict=True)


def _span(ns: int) -> str:
    """Return a duration as people write it."""
    if ns < SECOND:
        return f"{ns / MILLISECOND:.3g} ms"
    return f"{ns / SECOND:.3f} s" if ns < 100 * SECOND else f"{ns / SECOND:.0f} s"
