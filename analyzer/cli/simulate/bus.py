"""A simulation onto a bus that exists, in real time, and only where nothing can move by accident."""

from __future__ import annotations

import signal
import time
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

import dissectors
from analyzer.app.process import streams
from analyzer.app.process.interrupt import orderly
from analyzer.cli import sending, status
from analyzer.cli.progress import Progress
from analyzer.cli.simulate.file import Work, account, missing, shown
from analyzer.live.interfaces.naming import InterfaceError
from analyzer.live.replay.outlet import ActuationError, Outlet
from analyzer.live.replay.safety import Guard, Survey
from analyzer.live.replay.sender import Pacer
from analyzer.simulate import Simulation
from analyzer.simulate.key import text as key_text
from analyzer.sinks.atomic import Target, TargetError
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.live.interfaces.naming import Interface
    from analyzer.simulate import SimulationSettings
    from dissectors.traffic import SimulatedFrame

# As much of a simulation is looked at before it is let onto a bus that may be real.
_AHEAD = 10 * SECOND
# Seconds that the last words may take after SIGTERM.
_LAST_WORDS = 3.0


def run(settings: SimulationSettings, interface: Interface, key_path: str | None, *, actuating: bool, who: str) -> int:
    """Send until the end or a signal, and write the key; return the exit status."""
    registry, work = dissectors.load(), Work()
    guard = Guard(registry)
    try:
        with ExitStack() as stack:
            outlet = stack.enter_context(Outlet(interface, None if actuating else guard))
            if outlet.doubt and _refused(Simulation(settings, registry), guard, outlet, who):
                return sending.refused()
            outlet.open()
            key = stack.enter_context(Target(key_path)) if key_path is not None else None
            run_ = _Run(Simulation(settings, registry), work, outlet)
            with orderly(lambda: work) as signals:
                failure = run_.send()
            if failure is not None and not run_.simulation.recorder.frames:
                raise failure
            if key is not None:
                key.file.write(key_text(run_.simulation.key()).encode())
    except TargetError as error:
        return status.damaged(error)
    except (InterfaceError, ActuationError) as error:
        return sending.failed(error, who)
    done = status.INTERRUPTED
    with streams.bounded(_LAST_WORDS, wanted=bool(signals) and signals[0] != signal.SIGINT):
        done = run_.conclude(who)
    if signals and done == status.INTERRUPTED:
        done = 128 + signals[0]
    return done if failure is None else sending.failed(failure, who)


class _Run:
    """One simulation on its way to a bus."""

    def __init__(self, simulation: Simulation, work: Work, outlet: Outlet) -> None:
        self.simulation, self._work, self._outlet = simulation, work, outlet
        self._pace = Pacer(simulation.settings.bit_rate, lambda: work.stopped)

    def send(self) -> InterfaceError | ActuationError | None:
        """Send it; return what ended it before its time, if anything did: what was sent until then has been sent."""
        simulation = self.simulation
        with Progress(simulation) as progress:
            simulation.settings = replace(simulation.settings, start=time.time_ns())
            try:
                for _ in simulation.frames(lambda frames: self._sent(self._pace.over(frames))):
                    progress.step(f"{simulation.recorder.frames:,} frames on {shown(self._outlet.interface.name)}")
            except (InterfaceError, ActuationError) as error:
                return error
        return None

    def conclude(self, who: str) -> int:
        """Say what was sent and what was not; return the exit status."""
        streams.tell(f"-- {account(self.simulation)} sent on {shown(self._outlet.interface.name)}\n")
        sending.shortfall(self._outlet.left_out, self._pace.behind)
        if self._work.stopped:
            if unused := self.simulation.unused:
                streams.tell(f"-- not happened yet: {', '.join(unused)}\n")
            return status.INTERRUPTED
        if problem := missing(self.simulation):
            return status.usage(problem, who)
        return status.OK

    def _sent(self, frames: Iterable[SimulatedFrame]) -> Iterator[SimulatedFrame]:
        """Send and yield the frames that this bus can have; the others are no part of a recording of it, either."""
        for frame in frames:
            if frame.error:
                self._outlet.left_out[sending.ERROR_FRAMES] += 1
            elif frame.bus:
                self._outlet.left_out["frames of the second interface"] += 1
            elif self._outlet.send(frame):
                yield frame


def _refused(simulation: Simulation, guard: Guard, outlet: Outlet, who: str) -> bool:
    """Return whether something would be actuated in the beginning; say what."""
    survey = Survey()
    for frame in simulation.frames():
        if frame.t > _AHEAD:
            break
        if not frame.error:
            survey.add(guard.judge(frame.id, extended=frame.extended, remote=frame.remote))
    if rows := survey.rows():
        sending.refuse(outlet, rows, min(simulation.length, _AHEAD) / SECOND, who)
    return bool(rows)
