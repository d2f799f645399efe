"""A simulation as a capture: written as fast as it goes, there whole or not at all, its key beside it."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

import dissectors
from analyzer.app.process import streams
from analyzer.app.process.interrupt import graceful
from analyzer.cli import status
from analyzer.cli.progress import Progress, real_time
from analyzer.simulate import Simulation
from analyzer.simulate.key import text as key_text
from analyzer.simulate.text import line
from analyzer.sinks import losses, open_sink
from analyzer.sinks.atomic import Target, TargetError
from analyzer.sinks.packed import packed
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.simulate import SimulationSettings

# Frames that are written at once.
_CHUNK = 1 << 10


@dataclass(frozen=True, slots=True)
class SimulationOutput:
    """The capture and its key, if that is wanted."""

    path: str
    form: str
    packing: str
    compression: str
    key: str | None


@dataclass(slots=True)
class Work:
    """The work of a simulation, until somebody ends it."""

    stopped: bool = False
    waits: bool = False


class _RefusedError(Exception):
    """Something that was asked for did not happen."""


def run(settings: SimulationSettings, output: SimulationOutput, who: str) -> int:
    """Simulate into the output; return the exit status."""
    simulation, work = Simulation(settings, dissectors.load()), Work()
    try:
        with graceful(lambda: work), ExitStack() as stack:
            # The last one takes its place first: a key is never newer than its capture.
            key = stack.enter_context(Target(output.key)) if output.key is not None else None
            target = stack.enter_context(Target(output.path))
            with packed(target.file, output.packing) as file:
                lost = _write(output, simulation, work, file)
            _refuse(missing(simulation))
            target.settle()
            if key is not None:
                key.file.write(key_text(simulation.key()).encode())
                key.settle()
    except _RefusedError as error:
        return status.usage(error, who)
    except TargetError as error:
        return status.damaged(error)
    streams.tell(f"-- {account(simulation)} written to {shown(target.name)}\n")
    if lost:
        streams.tell(f"-- {output.form} cannot hold: {lost}\n")
    return status.OK


def _refuse(problem: str) -> None:
    if problem:
        raise _RefusedError(problem)


def missing(simulation: Simulation) -> str:
    """Return what was asked for and has not happened; empty if all of it has."""
    time = f"in {simulation.settings.duration / SECOND:g} s"
    if simulation.unused:
        return f"no occasion {time} for {', '.join(simulation.unused)}"
    if simulation.scenario is not None and simulation.untold:
        return f"the scenario {simulation.scenario.name} does not happen {time}: no {', '.join(simulation.untold)}"
    return "" if simulation.recorder.frames else f"nothing is sent {time}"


def account(simulation: Simulation) -> str:
    """Return frames, time and faults, in words."""
    recorder, faults = simulation.recorder, len(simulation.world.context.answers)
    errors = (
        f", {recorder.error_frames:,} error frame{'s' * (recorder.error_frames != 1)}" if recorder.error_frames else ""
    )
    seconds = min(simulation.world.now, simulation.length) / SECOND
    return f"{recorder.frames:,} frames{errors}, {seconds:,.1f} s, {faults:,} fault{'s' * (faults != 1)}"


def shown(name: str) -> str:
    """Return a name that is harmless to a terminal."""
    from analyzer.views.terminal import escape  # noqa: PLC0415 - only at the end

    return escape(name)


def _write(output: SimulationOutput, simulation: Simulation, work: Work, file: BinaryIO) -> str:
    """Write; return what the format could not hold, in words."""
    on_terminal = output.path == "-" and sys.stdout.isatty()
    with Progress(simulation, wanted=not on_terminal, speed=real_time) as progress:
        chunks = _chunks(simulation, work, whole=output.path != "-")
        if output.form == "candump":
            for chunk in progress.over(chunks):  # noqa: FURB122 - the compressor has no writelines
                file.write(chunk)
            return ""
        from analyzer.sources.native import rows  # noqa: PLC0415 - only who needs the native core

        sink = open_sink(output.form, file, compression=output.compression)
        for piece in rows(progress.over(chunks)):
            if not isinstance(piece, bytes):
                sink.write(piece)
        sink.close()
    return losses(sink.lost)


def _chunks(simulation: Simulation, work: Work, *, whole: bool) -> Iterator[bytes]:
    """Yield the lines of the capture; `KeyboardInterrupt` ends them early."""
    start, buses = simulation.settings.start, simulation.settings.buses
    lines: list[str] = []
    for frame in simulation.frames():
        lines.append(line(frame, start, buses))
        if len(lines) == _CHUNK:
            yield "".join(lines).encode()
            lines.clear()
            _go_on(work, whole=whole)
    yield "".join(lines).encode()
    _go_on(work, whole=whole)


def _go_on(work: Work, *, whole: bool) -> None:
    if work.stopped:
        if whole:
            streams.complain("interrupted, nothing is written")
        raise KeyboardInterrupt
