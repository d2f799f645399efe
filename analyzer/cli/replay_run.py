"""One replay: looked through, refused or sent, and accounted for."""

from __future__ import annotations

from contextlib import ExitStack
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from analyzer.cli import INTERRUPTED, OK, sending, streams
from analyzer.cli.progress import Progress, real_time
from analyzer.cli.replay import NAME
from analyzer.cli.replay_reel import Reel, words
from analyzer.cli.session import Session
from analyzer.live.interfaces import InterfaceError
from analyzer.live.outlet import ActuationError, Outlet
from analyzer.live.player import Player, RouteError, Routes, Timeline
from analyzer.live.safety import Guard, Survey
from analyzer.live.sender import SECOND, Pace
from analyzer.tables import numbers
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from analyzer.cli.replay import Order
    from analyzer.live.player import Part

# Bits per second of a bus of which nobody knows them: with twice the fastest of classic CAN a delay is caught up with
# even where the capture is of a full one. A faster replay takes a faster one.
_USUAL = 2_000_000
# A silence of this length is worth a word before it is waited for.
_LONG = 60 * SECOND
_EXTENDED, _REMOTE, _IDENTIFIER = 1 << 31, 1 << 30, (1 << 29) - 1


def run(args: argparse.Namespace, order: Order) -> int:
    """Sends what there is to send; returns the exit status."""
    status = OK
    with Session(args) as session:
        status = _run(session, order)
    return status or session.status


def _run(session: Session, order: Order) -> int:
    replay = _Replay(session, order)
    try:
        with ExitStack() as stack:
            for outlet in replay.outlets:
                stack.enter_context(outlet)
            if not order.pipe and (status := replay.look()):
                return status
            for outlet in replay.outlets:
                outlet.open()
            failure = replay.play()
    except InterfaceError as error:
        return sending.failed(error, NAME)
    replay.conclude()
    if isinstance(failure, RouteError):
        session.reject(str(failure))
        return OK
    return OK if failure is None else sending.failed(failure, NAME)


class _Replay:
    """A capture on its way to buses."""

    def __init__(self, session: Session, order: Order) -> None:
        self._session, self._order = session, order
        self._guard = Guard(session.registry)
        interfaces = {interface.name: interface for interface, _ in order.maps}
        self.outlets = [Outlet(one, None if order.actuating else self._guard) for one in interfaces.values()]
        self._maps: dict[str | None, list[int]] = {}
        for interface, bus in order.maps:
            self._maps.setdefault(bus, []).append([*interfaces].index(interface.name))
        self._reel = Reel(session, order.window, order.filters, order.longest)
        speed = order.speed or Fraction(1)
        self._timeline = Timeline(speed, order.longest)
        usual = int(_USUAL * max(Fraction(1), speed))
        rate = max(one.bit_rate or usual for one in interfaces.values())
        self._pace = Pace(None if order.speed is None else rate, self._stopped)
        self._player = Player(self.outlets, Routes(self._maps), self._timeline, self._pace, order.most)
        self._progress: Progress | None = None

    @property
    def size(self) -> int:
        """Nanoseconds of the capture that have gone by; they do so in silences too."""
        return self._timeline.recorded(max(self._player.position, self._pace.elapsed))

    @property
    def length(self) -> int | None:
        """Those there are to play, if that is known."""
        order = self._order
        known = self._reel.whole and order.loops is not None and order.most is None
        return self._reel.length * (order.loops or 0) if known else None

    def look(self) -> int:
        """Reads ahead, and says what is not to be sent; the exit status if that is the end of it."""
        session, reel = self._session, self._reel
        surveys = [Survey() for _ in self.outlets]
        doubtful = any(outlet.doubt for outlet in self.outlets)
        with Progress(session.source) as progress:
            session.held = [] if progress.active else None
            for _ in progress.over(reel.look(lambda part: self._count(part, surveys), far=doubtful)):
                pass
        session.release()
        if session.status == INTERRUPTED:
            streams.complain("interrupted, nothing is sent")
            return INTERRUPTED
        if reel.whole:
            self._require()
        seconds = float(self._reel.length / SECOND / (self._order.speed or 1))
        found = [
            (outlet, rows) for outlet, survey in zip(self.outlets, surveys, strict=True) if (rows := survey.rows())
        ]
        for outlet, rows in found:
            sending.refuse(outlet, rows, seconds, NAME)
        if reel.silence > _LONG and self._order.speed is not None and not found:
            session.complain(f"a silence of {reel.silence / SECOND:,.0f} s is kept (--max-gap 5s shortens it)")
        return sending.refused() if found else OK

    def play(self) -> InterfaceError | ActuationError | RouteError | None:
        """What ended it before its time, if anything did: what was sent until then has been sent."""
        session, order = self._session, self._order
        with Progress(self, speed=real_time) as self._progress:
            session.held = [] if self._progress.active else None
            try:
                self._player.play(self._reel.rounds(order.loops))
            except (InterfaceError, ActuationError, RouteError) as error:
                return error
        return None

    def conclude(self) -> None:
        """Says what was sent and what was not."""
        session, player, timeline = self._session, self._player, self._timeline
        session.release()
        names = " and ".join(
            escape(outlet.interface.name) + (f" ({outlet.sent:,})" if len(self.outlets) > 1 else "")
            for outlet in self.outlets
        )
        seconds = timeline.recorded(player.position) / SECOND
        streams.tell(f"-- {player.sent:,} frames, {seconds:,.1f} s sent on {names}; {session.sum()}\n")
        left_out = sum((outlet.left_out for outlet in self.outlets), player.left_out)
        if timeline.timeless:
            streams.tell(f"-- without a time, sent right behind the one before: {timeline.timeless:,}\n")
        if timeline.backwards:
            streams.tell(
                f"-- with a time before that of the one before, sent right behind it: {timeline.backwards:,}\n"
            )
        sending.shortfall(left_out, self._pace.behind)
        if not player.sent and session.status == OK:
            session.reject("nothing of it was sent")

    def _require(self) -> None:
        """Ends the session if what there is cannot be sent as it was asked for."""
        reel, session, order = self._reel, self._session, self._order
        if reel.frames:
            try:
                Routes(self._maps).check(reel.buses)
            except RouteError as error:
                session.require(str(error))
        elif session.status == OK:
            passed = "passes the filters" if order.filters else ""
            inside = "is inside the window" if order.window else ""
            session.require(f"no frame {' and '.join(filter(None, (inside, passed))) or 'that could be sent'}")

    def _count(self, part: Part, surveys: Sequence[Survey]) -> None:
        """What of a part would actuate something where that is in doubt."""
        found, buses = words(part.frames), numbers(part.frames.column("bus"))
        for bus, name in enumerate(part.buses):
            to = [k for k in self._maps.get(name, self._maps.get(None, ())) if self.outlets[k].doubt]
            if not to:
                continue
            different, counts = np.unique(found[buses == bus], return_counts=True)
            for word, count in zip(different.tolist(), counts.tolist(), strict=True):
                verdict = self._guard.judge(
                    word & _IDENTIFIER, extended=bool(word & _EXTENDED), remote=bool(word & _REMOTE)
                )
                for k in to:
                    surveys[k].add(verdict, count)

    def _stopped(self) -> bool:
        """Whether somebody has ended it; asked all the time, so that progress shows in silences too."""
        if self._progress is not None:
            self._progress.step("" if self.length else f"{self._player.sent:,} frames")
        return self._session.status == INTERRUPTED
