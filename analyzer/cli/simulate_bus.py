"""A simulation onto a bus that exists, in real time, and only where nothing can move by accident."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import can

import dissectors
from analyzer.cli import DAMAGED, INTERRUPTED, OK, USAGE, streams
from analyzer.cli.interrupt import graceful
from analyzer.cli.progress import Progress
from analyzer.cli.simulate import NAME
from analyzer.cli.simulate_file import Work, account, missing, shown
from analyzer.live.interfaces import InterfaceError, open_bus
from analyzer.live.safety import Guard, Survey, doubt
from analyzer.live.sender import Pace, Sender
from analyzer.simulate import Simulation
from analyzer.simulate.key import text as key_text
from analyzer.sinks.atomic import Target, TargetError
from analyzer.views.actuation import render
from dissectors.traffic import SECOND

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator

    from analyzer.live.interfaces import Interface
    from analyzer.simulate import Settings
    from dissectors.traffic import Frame

# As much of a simulation is looked at before it is let onto a bus that may be real.
_AHEAD = 10 * SECOND


class _ActuationError(Exception):
    """A command that must not be sent there."""


def run(args: argparse.Namespace, settings: Settings, interface: Interface) -> int:
    """Sends until the end or Ctrl-C, and writes the key; returns the exit status."""
    registry, work = dissectors.load(), Work()
    guard = Guard(registry)
    try:
        with ExitStack() as stack:
            # A SocketCAN name that is not there is another mistake; opening one changes nothing on the bus.
            if interface.kind == "socketcan":
                bus = _opened(interface, stack)
            reason = "" if args.allow_actuation else doubt(interface.kind, interface.channel, interface.options)
            if reason and (table := _table(Simulation(settings, registry), guard)):
                streams.complain(f"{interface.name} may be real: {reason}; this would be sent:", NAME)
                streams.tell(table)
                streams.tell("-- nothing was sent; --allow-actuation sends it: motors have propellers\n")
                return USAGE
            if interface.kind != "socketcan":
                bus = _opened(interface, stack)
            key = stack.enter_context(Target(args.key)) if args.key is not None else None
            sending = _Sending(Simulation(settings, registry), work, bus, interface, guard if reason else None)
            with graceful(lambda: work):
                failure = sending.run()
            if failure is not None and not sending.simulation.recorder.frames:
                raise failure
            if key is not None:
                key.file.write(key_text(sending.simulation.key()).encode())
    except (InterfaceError, TargetError, _ActuationError) as error:
        return _failed(error)
    status = sending.conclude()
    return status if failure is None else _failed(failure)


def _failed(error: Exception) -> int:
    if isinstance(error, _ActuationError):
        streams.complain(str(error), NAME)
        return USAGE
    streams.complain(str(error))
    return DAMAGED


class _Sending:
    """One simulation on its way to a bus; a `guard` lets nothing through that actuates."""

    def __init__(
        self, simulation: Simulation, work: Work, bus: can.BusABC, interface: Interface, guard: Guard | None
    ) -> None:
        self.simulation, self._work = simulation, work
        self._interface, self._guard = interface, guard
        self._fd = _takes_fd(bus, interface)
        self._pace = Pace(simulation.settings.bit_rate, lambda: work.stopped)
        self._sender = Sender(bus, interface.name)
        self._left_out: Counter[str] = Counter()

    def run(self) -> InterfaceError | _ActuationError | None:
        """What ended it before its time, if anything did: what was sent until then has been sent."""
        simulation = self.simulation
        with Progress(simulation) as progress:
            simulation.settings = replace(simulation.settings, start=time.time_ns())
            try:
                for _ in simulation.frames(lambda frames: self._sent(self._pace.over(frames))):
                    progress.step(f"{simulation.recorder.frames:,} frames on {shown(self._interface.name)}")
            except (InterfaceError, _ActuationError) as error:
                return error
        return None

    def conclude(self) -> int:
        """Says what was sent and what was not; the exit status."""
        streams.tell(f"-- {account(self.simulation)} sent on {shown(self._interface.name)}\n")
        if self._left_out:
            texts = (f"{what} ({count:,})" for what, count in self._left_out.items())
            streams.tell(f"-- not sent: {'; '.join(texts)}\n")
        if self._pace.behind:
            streams.tell(f"-- this machine was too slow: the rest came {self._pace.behind / SECOND:.1f} s later\n")
        if self._work.stopped:
            if unused := self.simulation.unused:
                streams.tell(f"-- not happened yet: {', '.join(unused)}\n")
            return INTERRUPTED
        if problem := missing(self.simulation):
            streams.complain(problem, NAME)
            return USAGE
        return OK

    def _sent(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames that this bus can have, sent; the others are no part of a recording of it, either."""
        for frame in frames:
            if frame.error:
                self._left_out["error frames, which only a controller makes"] += 1
            elif frame.bus:
                self._left_out["frames of the second interface"] += 1
            elif frame.fd and not self._fd:
                self._left_out["CAN FD frames"] += 1
            else:
                self._check(frame)
                self._sender.send(message(frame))
                yield frame

    def _check(self, frame: Frame) -> None:
        if self._guard is None:
            return
        verdict = self._guard.judge(frame.id, extended=frame.extended, remote=frame.remote)
        if verdict.actuates:
            raise _ActuationError(
                f"{verdict.name} of node {verdict.node} comes up {frame.t / SECOND:.3f} s after the start: "
                f"not sent on {self._interface.name}, which may be real, without --allow-actuation"
            )


def message(frame: Frame) -> can.Message:
    """As python-can sends it."""
    return can.Message(
        arbitration_id=frame.id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        is_fd=frame.fd,
        bitrate_switch=frame.brs,
        dlc=frame.dlc or 0 if frame.remote else None,
        data=None if frame.remote else frame.data,
    )


def _takes_fd(bus: can.BusABC, interface: Interface) -> bool:
    """The virtual bus takes whatever it is given; a SocketCAN interface says itself what it takes."""
    link = interface.link
    return link.fd if link else interface.kind == "virtual" or bus.protocol is not can.CanProtocol.CAN_20


def _opened(interface: Interface, stack: ExitStack) -> can.BusABC:
    bus = open_bus(interface)
    stack.callback(_close, bus)
    return bus


def _close(bus: can.BusABC) -> None:
    with suppress(Exception):  # a device that has been pulled out
        bus.shutdown()


def _table(simulation: Simulation, guard: Guard) -> str:
    """What would actuate something in the beginning; empty if nothing would."""
    survey = Survey()
    for frame in simulation.frames():
        if frame.t > _AHEAD:
            break
        if not frame.error:
            survey.add(guard.judge(frame.id, extended=frame.extended, remote=frame.remote))
    rows = survey.rows()
    return render(rows, min(simulation.length, _AHEAD) / SECOND) if rows else ""
