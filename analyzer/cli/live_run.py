"""Everything that a live session is made of, put together as the arguments ask, and what is left at its end."""

from __future__ import annotations

import signal
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, OK, reports, streams
from analyzer.cli.live_keeper import Recording
from analyzer.cli.live_list import Lines, List, said
from analyzer.cli.live_overdue import Overdue
from analyzer.cli.live_session import LiveSession
from analyzer.cli.live_status import Status, account
from analyzer.live.hub import Hub
from analyzer.live.printer import Printer
from analyzer.live.pump import Control, Pump
from analyzer.live.receiver import open_receiver
from analyzer.report.build import Taken
from analyzer.report.text import render
from analyzer.sinks import losses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.cli.live import Wanted
    from analyzer.cli.live_monitor import Display
    from analyzer.cli.live_plot import Plot
    from analyzer.cli.live_session import View
    from analyzer.live.receiver import Receiver
    from analyzer.report.model import Report

# Seconds between two batches.
_INTERVALS = {"list": 0.2, "monitor": 0.4, "quiet": 0.5}
_AT_ONCE = 0.1


class Run:
    """One session.

    Args:
        wanted: the arguments, checked.
    """

    def __init__(self, wanted: Wanted) -> None:
        self._wanted, self._args = wanted, wanted.args
        self._several = len(wanted.buses) > 1
        self._receivers: list[Receiver] = []
        self._views: list[View] = []
        self._plot: Plot | None = None
        self._list: List | None = None
        self._display: Display | None = None

    def status(self) -> int:
        """Runs it; the exit status. Raises `InterfaceError` and `TargetError` if something cannot be opened."""
        wanted, control = self._wanted, Control()
        with ExitStack() as whole:
            whole.enter_context(signals(control))
            targets = reports.opened(wanted.files, whole)
            with ExitStack() as stack:
                say = printed(stack)
                hub = self._hub(stack)
                recording = Recording(wanted.plan, stack)
                pump = Pump(
                    hub, recording.keeper, recording.autostop, control, recording.close, recording.header,
                    self._interval(),
                )  # fmt: skip
                session = LiveSession(pump, wanted.judging, self._views, self._interval())
                self._add_views(stack, session, recording, say)
                with pump:
                    self._go(session, say)
                report = self._concluded(session, recording)
            if self._list is not None:
                self._list.look(session)
            written = report is not None and reports.all_written(targets, report, everything=self._args.all)
        failed = (f"{one.name}: {one.failed}" for one in self._receivers if one.failed is not None)
        broken = [] if pump.problem is None else [pump.problem]
        problems = [*failed, *broken, *session.problems, *recording.problems()]
        for line in (*account(hub.counts, wanted.counted), *recording.account(self._args.bitrate)):
            streams.tell(f"-- {line}\n")
        if left_out := losses(pump.left_out):
            streams.tell(f"-- neither recorded nor judged: {left_out}\n")
        if pump.unjudged:
            streams.tell(f"-- {pump.unjudged:,} frames are recorded, but not judged: judging was too slow\n")
        for problem in problems:
            streams.complain(problem)
        if report is None:
            return DAMAGED
        self._verdict(report)
        return report.gate.exit_status or (OK if written and not problems else DAMAGED)

    def _interval(self) -> float:
        return _AT_ONCE if self._args.flush else _INTERVALS[self._wanted.mode]

    def _hub(self, stack: ExitStack) -> Hub:
        """Open, and receiving from now on."""
        hardware = self._args.stamps == "adapter"
        with ExitStack() as opening:
            for interface, filters in self._wanted.buses:
                self._receivers.append(receiver := open_receiver(interface, filters, hardware=hardware))
                opening.callback(receiver.close)
            hub = stack.enter_context(Hub(self._receivers))
            opening.pop_all()  # from here on they are the hub's
        return hub

    def _add_views(
        self, stack: ExitStack, session: LiveSession, recording: Recording, say: Callable[[str], None]
    ) -> None:
        wanted, args = self._wanted, self._args
        registry, tell = wanted.judging.registry, session.tell
        if wanted.mode == "monitor":
            from analyzer.cli.live_monitor import Display  # noqa: PLC0415 - a list does without

            rates = {interface.name: interface.bit_rate for interface, _ in wanted.buses}
            self._display = Display(wanted.judging, rates, recording.now, self._saved, session.stop)
            self._views.append(self._display)
        elif wanted.mode == "list":
            printer = stack.enter_context(Printer())
            self._list = List(args, registry, printer, several=self._several, say=say)
            self._views.append(self._list)
        else:
            self._views.append(Lines(several=self._several, say=say))
        if self._display is None:
            self._views.append(Overdue(tell))
        self._views.append(Status(wanted.every, tell, recording.words))
        if args.plot is not None:
            from analyzer.cli.live_plot import Plot, opened  # noqa: PLC0415 - Rerun takes its time

            output = opened(args.plot, wanted.name, stack)
            self._plot = Plot(output, wanted.judging, tell, several=self._several)
            self._views.append(self._plot)

    def _go(self, session: LiveSession, say: Callable[[str], None]) -> None:
        """Until it ends."""
        if self._display is None:
            session.run()
        else:
            from analyzer.cli.live_monitor import show  # noqa: PLC0415

            show(session, self._display, Lines(several=self._several, say=say))

    def _concluded(self, session: LiveSession, recording: Recording) -> Report | None:
        """The verdict, and the last that the views have to show; None if the rules have failed."""
        checked = session.conclude(recording.stored())
        if checked is None:
            return None
        files = recording.files
        first, *more = files or [self._wanted.name]
        taken = Taken(
            id=recording.name or self._wanted.name,
            path=first,
            checked=checked,
            live=not files,
            arguments=(*more, "--same-bus") if more else (),
        )
        report = self._wanted.judging.build([taken])
        if self._plot is not None and not self._plot.failed:
            self._plot.end(report, checked.facts)
        if self._list is not None and not self._list.failed:
            self._list.end()
        return report

    def _saved(self, session: LiveSession) -> str:
        """Writes down what there is to report now, beside where the session was started."""
        path = Path(f"tailbyte-{time.strftime('%Y%m%d-%H%M%S')}.txt")
        found = (said(one, bus=self._several) for one in session.newest.all)
        lines = [*account(session.pump.hub.counts, self._wanted.counted), "", *found]
        try:
            path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            return f"{path}: {error.strerror or error}"
        return f"{path} written"

    def _verdict(self, report: Report) -> None:
        """On standard output, unless something else is there."""
        if self._wanted.apart:
            streams.tell(render(report, everything=self._args.all))
        else:
            reports.tell(self._args, report, silent=self._wanted.silent)


def printed(stack: ExitStack) -> Callable[[str], None]:
    """What writes to standard error without ever waiting for whoever reads it."""
    try:
        printer = stack.enter_context(Printer(sys.stderr.fileno()))
    except (OSError, ValueError):  # one that has no descriptor takes everything
        return streams.tell
    return printer.put


@contextmanager
def signals(control: Control) -> Iterator[None]:
    """Ctrl-C, SIGTERM and SIGHUP end the session, a second Ctrl-C at once; SIGUSR1 sets a mark in it."""

    def stop(number: int, _: object) -> None:
        if control.stopped and number == signal.SIGINT:
            raise KeyboardInterrupt
        control.stop()

    def mark(*_: object) -> None:
        control.mark()

    chosen: dict[str, Callable[..., None]] = {"SIGINT": stop, "SIGTERM": stop, "SIGHUP": stop, "SIGUSR1": mark}
    before = {}
    with suppress(ValueError):  # not the main thread: signals are somebody else's
        for name, handler in chosen.items():
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)
