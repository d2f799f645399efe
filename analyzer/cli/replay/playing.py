"""One replay: looked through, refused or sent, and accounted for."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from analyzer.app.process import streams
from analyzer.app.reel import Reel, words
from analyzer.cli import sending, status
from analyzer.cli.complaints import Complaints
from analyzer.cli.progress import real_time
from analyzer.cli.reading import lines_of, reading, watched
from analyzer.live.interfaces.naming import InterfaceError
from analyzer.live.replay.outlet import ActuationError, Outlet
from analyzer.live.replay.player import Player, RouteError, Routes, Timeline
from analyzer.live.replay.safety import Guard, Survey
from analyzer.live.replay.sender import Pacer
from analyzer.views.terminal import escape
from dissectors.kit.cells import numbers
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.cli.progress import Progress
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface
    from analyzer.live.replay.player import ReplayBatch

# Bits per second of a bus of which nobody knows them: with twice the fastest of classic CAN a delay is caught up with
# even where the capture is of a full one. A faster replay takes a faster one.
_USUAL = 2_000_000
# A silence of this length is worth a word before it is waited for.
_LONG = 60 * SECOND
_EXTENDED, _REMOTE, _IDENTIFIER = 1 << 31, 1 << 30, (1 << 29) - 1


@dataclass(frozen=True, slots=True)
class PlayOrder:
    """The way a capture is to be played, and where to.

    `maps` pairs an interface with the bus whose frames it gets, None for the only one. `speed` is None for as fast as
    the buses take it, `loops` for no end, `longest` (ns) for silences as they are, `most` for all frames.
    """

    maps: tuple[tuple[Interface, str | None], ...]
    filters: Filters
    speed: Fraction | None
    loops: int | None
    longest: int | None
    most: int | None
    actuating: bool
    pipe: bool


def run(request: Request, order: PlayOrder, who: str) -> int:
    """Send what there is to send; return the exit status."""
    complaints, done = Complaints(), status.OK
    with reading(request, complaints) as run:
        done = _run(run, order, complaints, who)
    return done or status.of_run(run)


def _run(run: Run, order: PlayOrder, complaints: Complaints, who: str) -> int:
    replay = _Replay(run, order, complaints, who)
    try:
        with ExitStack() as stack:
            for outlet in replay.outlets:
                stack.enter_context(outlet)
            if done := replay.refuse_pipe() if order.pipe else replay.look():
                return done
            for outlet in replay.outlets:
                outlet.open()
            failure = replay.play()
    except InterfaceError as error:
        return sending.failed(error, who)
    replay.conclude()
    if isinstance(failure, RouteError):
        run.reject(str(failure))
        return status.OK
    return status.OK if failure is None else sending.failed(failure, who)


class _Replay:
    """A capture on its way to buses."""

    def __init__(self, run: Run, order: PlayOrder, complaints: Complaints, who: str) -> None:
        self._run, self._order, self._complaints, self._who = run, order, complaints, who
        self._guard = Guard(run.registry)
        interfaces = {interface.name: interface for interface, _ in order.maps}
        self.outlets = [Outlet(one, None if order.actuating else self._guard) for one in interfaces.values()]
        self._maps: dict[str | None, list[int]] = {}
        for interface, bus in order.maps:
            self._maps.setdefault(bus, []).append([*interfaces].index(interface.name))
        self._reel = Reel(run, order.filters, order.longest)
        speed = order.speed or Fraction(1)
        self._timeline = Timeline(speed, order.longest)
        usual = int(_USUAL * max(Fraction(1), speed))
        rate = max(one.bit_rate or usual for one in interfaces.values())
        self._pace = Pacer(None if order.speed is None else rate, self._stopped)
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

    def refuse_pipe(self) -> int:
        """Refuse a bus that may be real, as a pipe is read once: what it would actuate is known too late."""
        doubtful = [outlet for outlet in self.outlets if outlet.doubt]
        for outlet in doubtful:
            name = escape(outlet.interface.name)
            streams.complain(f"{name} may be real: {outlet.doubt}; a pipe cannot be looked through first", self._who)
        return sending.refused() if doubtful else status.OK

    def look(self) -> int:
        """Read ahead, and say what is not to be sent; return the exit status if that is the end of it."""
        run, reel = self._run, self._reel
        surveys = [Survey() for _ in self.outlets]
        doubtful = any(outlet.doubt for outlet in self.outlets)
        with watched(run.source, self._complaints) as progress:
            for _ in progress.over(reel.look(lambda part: self._count(part, surveys), far=doubtful)):
                pass
        if run.stopped:
            streams.complain("interrupted, nothing is sent")
            return status.INTERRUPTED
        if reel.whole:
            self._require()
        seconds = float(self._reel.length / SECOND / (self._order.speed or 1))
        found = [
            (outlet, rows) for outlet, survey in zip(self.outlets, surveys, strict=True) if (rows := survey.rows())
        ]
        for outlet, rows in found:
            sending.refuse(outlet, rows, seconds, self._who)
        if reel.silence > _LONG and self._order.speed is not None and not found:
            run.complain(f"a silence of {reel.silence / SECOND:,.0f} s is kept (--max-gap 5s shortens it)")
        return sending.refused() if found else status.OK

    def play(self) -> InterfaceError | ActuationError | RouteError | None:
        """Send it; return what ended it before its time, if anything did: what was sent until then has been sent."""
        with watched(self, self._complaints, speed=real_time) as self._progress:
            try:
                self._player.play(self._reel.rounds(self._order.loops))
            except (InterfaceError, ActuationError, RouteError) as error:
                return error
        return None

    def conclude(self) -> None:
        """Say what was sent and what was not."""
        run, player, timeline = self._run, self._player, self._timeline
        names = " and ".join(
            escape(outlet.interface.name) + (f" ({outlet.sent:,})" if len(self.outlets) > 1 else "")
            for outlet in self.outlets
        )
        seconds = timeline.recorded(player.position) / SECOND
        streams.tell(f"-- {player.sent:,} frames, {seconds:,.1f} s sent on {names}; {lines_of(run)}\n")
        left_out = sum((outlet.left_out for outlet in self.outlets), player.left_out)
        if timeline.timeless:
            streams.tell(f"-- without a time, sent right behind the one before: {timeline.timeless:,}\n")
        if timeline.backwards:
            streams.tell(
                f"-- with a time before that of the one before, sent right behind it: {timeline.backwards:,}\n"
            )
        sending.shortfall(left_out, self._pace.behind)
        if not player.sent and run.state == "whole":
            run.reject("nothing of it was sent")

    def _require(self) -> None:
        """End the run if what there is cannot be sent as it was asked for."""
        reel, run, order = self._reel, self._run, self._order
        if reel.frames:
            try:
                Routes(self._maps).check(reel.buses)
            except RouteError as error:
                run.require(str(error))
        elif run.state == "whole":
            passed = "passes the filters" if order.filters else ""
            inside = "is inside the window" if run.request.window else ""
            run.require(f"no frame {' and '.join(filter(None, (inside, passed))) or 'that could be sent'}")

    def _count(self, part: ReplayBatch, surveys: Sequence[Survey]) -> None:
        """Count what of a part would actuate something where that is in doubt."""
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
        """Return whether somebody has ended it; asked all the time, so that progress shows in silences too."""
        if self._progress is not None:
            self._progress.step("" if self.length else f"{self._player.sent:,} frames")
        return self._run.stopped
