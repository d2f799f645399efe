"""Everything that a live session is made of, put together as it is asked for, and what is left at its end."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.browse.live_names import LiveNames
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.hook import FindingHook
from analyzer.app.live.lag import Lag
from analyzer.app.live.list import EventLines, TransferList, said
from analyzer.app.live.overdue import Overdue
from analyzer.app.live.session import LiveSession
from analyzer.app.live.session_recording import SessionRecording
from analyzer.app.live.status import DAY, Status, account
from analyzer.app.live.status_file import StatusFile
from analyzer.app.process import streams
from analyzer.app.process.interrupt import handling
from analyzer.live.capture_loop import CaptureLoop
from analyzer.live.interfaces.hub import Hub
from analyzer.live.interfaces.receiver import open_receiver
from analyzer.live.printer import Printer
from analyzer.rules.named_frames import RecentNames
from analyzer.sinks import losses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.app.browse.live import LiveSupply
    from analyzer.app.criteria import Criteria
    from analyzer.app.live.monitor import Display
    from analyzer.app.live.plot import LivePlot
    from analyzer.app.live.request import LiveRequest
    from analyzer.app.live.session import SessionView
    from analyzer.live.capture_loop import SessionControl
    from analyzer.live.interfaces.receiver import Receiver
    from analyzer.report.model import Report

# Seconds between two batches: as a rule, and at most where that takes long.
_INTERVALS = {"list": (0.2, 0.5), "monitor": (0.4, 1.0), "browser": (0.4, 1.0), "quiet": (0.5, 4.0)}
_AT_ONCE = (0.1, 0.1)
# Seconds at most until what is shown is judged, and that this may hold up what is shown.
_UNTIL_JUDGED, _HELD_UP = 4.0, 0.3


class LiveRun:
    """One session, from opening its interfaces to its verdict.

    `account` are lines about what was received and recorded, `problems` what went wrong, both after it has run.

    Args:
        request: what is asked.
        criteria: what the buses are judged by.
        control: ends the session, or sets marks in it.
    """

    def __init__(self, request: LiveRequest, criteria: Criteria, control: SessionControl) -> None:
        self.account: list[str] = []
        self.problems: list[str] = []
        self._request, self._criteria, self._control = request, criteria, control
        self._several = len(request.buses) > 1
        self._receivers: list[Receiver] = []
        self._views: list[SessionView] = []
        self._plot: LivePlot | None = None
        self._list: TransferList | None = None
        self._display: Display | None = None
        self._browser: LiveSupply | None = None
        self._status_file: StatusFile | None = None
        self._hook: FindingHook | None = None
        self._names = RecentNames() if request.asks_findings else None
        self._live_names = LiveNames()

    def run(self) -> Report | None:
        """Run it; return the verdict, None if the rules have failed.

        Raises `InterfaceError` and `TargetError` if something cannot be opened.
        """
        request = self._request
        with ExitStack() as stack:
            say = printed(stack)
            hub = self._hub(stack)
            recording = SessionRecording(request.plan, stack)
            shortest, longest = _AT_ONCE if request.flush else _INTERVALS[request.mode]
            gathers = request.mode != "quiet" and not request.at_once  # what shows nothing has long batches itself
            loop = CaptureLoop(
                hub, recording.recorder, recording.autostop, self._control, recording.end, recording.header,
                shortest,
            )  # fmt: skip
            session = LiveSession(
                loop, recording, request.name, self._criteria, self._views, BatchInterval(shortest, longest),
                named=self._live_names if request.mode in ("browser", "monitor") else self._names,
                judging=BatchInterval(shortest, _UNTIL_JUDGED, _HELD_UP) if gathers else None, drawn=request.drawn,
            )  # fmt: skip
            self._add_views(stack, session, recording, say)
            with loop:
                self._go(session, say)
            report = self._concluded(session)
            recording.close()
            if self._hook is not None:
                self._hook.close()
                self._hook.look(session)
            if self._status_file is not None:
                self._status_file.end(session)
        if self._list is not None:
            self._list.look(session)
        failed = (f"{one.name}: {one.failed}" for one in self._receivers if one.failed is not None)
        broken = [] if loop.problem is None else [loop.problem]
        self.problems += [*failed, *broken, *session.problems, *recording.problems()]
        self.account += [*account(hub.counts, request.counted), *recording.account(request.bit_rate)]
        if left_out := losses(loop.left_out):
            self.account.append(f"neither recorded nor judged: {left_out}")
        if loop.unjudged:
            self.account.append(f"{loop.unjudged:,} frames are recorded, but not judged: judging was too slow")
        return report

    def _hub(self, stack: ExitStack) -> Hub:
        """Open the interfaces; return the hub that receives from now on."""
        with ExitStack() as opening:
            for interface, filters in self._request.buses:
                self._receivers.append(receiver := open_receiver(interface, filters, hardware=self._request.hardware))
                opening.callback(receiver.close)
            hub = stack.enter_context(Hub(self._receivers))
            opening.pop_all()  # from here on they are the hub's
        return hub

    def _add_views(
        self, stack: ExitStack, session: LiveSession, recording: SessionRecording, say: Callable[[str], None]
    ) -> None:
        request, criteria, tell = self._request, self._criteria, session.tell
        if request.mode == "monitor":
            from analyzer.app.live.monitor import Display  # noqa: PLC0415 - a list does without

            rates = {interface.name: interface.bit_rate for interface, _ in request.buses}
            inside = partial(self._inside, session)
            self._display = Display(criteria, rates, recording.now, self._saved, session.stop, inside)
            self._views.append(self._display)
        elif request.mode == "browser":
            self._browser = stack.enter_context(self._browsing(session.stop))
            self._views.append(self._browser)
        elif request.mode == "list":
            printer = stack.enter_context(Printer())
            self._list = self._listed(printer, say)
            self._views.append(self._list)
        else:
            self._views.append(EventLines(several=self._several, say=say))
        if self._display is None and self._browser is None:
            self._views.append(Overdue(tell))
        self._views.append(Lag(tell))
        self._views.append(Status(request.every, tell, recording.words))
        if request.every < DAY:
            self._views.append(Status(DAY, tell, recording.words, span="in the last day"))
        if request.status_file is not None:
            self._status_file = StatusFile(request.status_file, tell, recording.now)
            self._views.append(self._status_file)
        if request.command is not None:
            self._hook = FindingHook(request.command, tell)
            self._views.append(self._hook)
        if request.plot is not None:
            from analyzer.app.live.plot import LivePlot, opened  # noqa: PLC0415 - Rerun takes its time

            output = opened(request.plot, request.name, stack)
            self._plot = LivePlot(output, criteria, tell, several=self._several)
            self._views.append(self._plot)

    @contextmanager
    def _browsing(self, stop: Callable[[], None]) -> Iterator[LiveSupply]:
        """Make a browser, with a folder for what it shows; `stop` is called when the user has quit."""
        from analyzer.app.browse.live import LiveSupply  # noqa: PLC0415 - a list does without
        from analyzer.app.browse.session import BrowseOptions  # noqa: PLC0415
        from analyzer.browser.store.folder import StoreFolder  # noqa: PLC0415

        request, file = self._request, self._request.plan.file
        chosen = "" if request.filter is None else request.filter.text
        options = BrowseOptions(filter=chosen, time=request.view.time, marks=bool(file))
        with StoreFolder() as folder:
            yield LiveSupply(self._criteria, request.name, folder.path, stop, self._live_names, file, options)

    @contextmanager
    def _inside(self, session: LiveSession) -> Iterator[LiveSupply]:
        """Make a browser that shows what comes while the monitor makes room for it."""
        with self._browsing(lambda: None) as browser:
            browser.look(session)
            browser.take(session.newest.all)
            session.attach(browser)
            try:
                yield browser
            finally:
                session.detach(browser)

    def _listed(self, printer: Printer, say: Callable[[str], None]) -> TransferList:
        """Return the list: one whose rows wait if its filter asks for what comes later."""
        chosen, criteria, names = self._request.filter, self._criteria, self._names
        severities = {rule: page.severity for rule, page in criteria.pages.items()} | {**criteria.settings.severities}
        matcher = None if chosen is None else chosen.matcher(labels=criteria.labels, named=names, severities=severities)
        given, several = (self._request.view, criteria.registry, printer), self._several
        if names is None:
            return TransferList(*given, several=several, say=say, matcher=matcher)
        from analyzer.app.live.waiting import WaitingList  # noqa: PLC0415 - few filters ask for findings

        return WaitingList(*given, several=several, say=say, matcher=matcher, names=names)

    def _go(self, session: LiveSession, say: Callable[[str], None]) -> None:
        """Run until it ends."""
        display = self._display or self._browser
        if display is None:
            session.run()
        else:
            from analyzer.app.live.monitor import show  # noqa: PLC0415

            show(session, display, EventLines(several=self._several, say=say))

    def _concluded(self, session: LiveSession) -> Report | None:
        """Return the verdict, with the last that the views have to show; None if the rules have failed."""
        taken, report = session.conclude(), None
        if taken is not None:
            report = self._criteria.report([taken])
            if self._plot is not None and not self._plot.failed:
                self._plot.end(report, taken.checked.facts)
        if self._list is not None and not self._list.failed:
            self._list.end(() if report is None else report.findings)
        return report

    def _saved(self, session: LiveSession) -> str:
        """Write down what there is to report now, beside where the session was started."""
        path = Path(f"tailbyte-{time.strftime('%Y%m%d-%H%M%S')}.txt")
        found = (said(one, bus=self._several) for one in session.newest.all)
        lines = [*account(session.loop.hub.counts, self._request.counted), "", *found]
        try:
            path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            return f"{path}: {error.strerror or error}"
        return f"{path} written"


def printed(stack: ExitStack) -> Callable[[str], None]:
    """Return what writes to standard error without ever waiting for whoever reads it."""
    try:
        printer = stack.enter_context(Printer(sys.stderr.fileno()))
    except (OSError, ValueError):  # one that has no descriptor takes everything
        return streams.tell
    return printer.put


@contextmanager
def signals(control: SessionControl, *, recorded: bool) -> Iterator[None]:
    """End the session on Ctrl-C and SIGTERM, at once on a second Ctrl-C; set a mark in it on SIGUSR1.

    SIGHUP renews the files of the recording. It ends the session if its terminal is gone, or if nothing is recorded.
    """
    terminal = _has_terminal()

    def stop(number: int, _: object) -> None:
        if control.stopped and number == signal.SIGINT:
            raise KeyboardInterrupt
        if number == signal.SIGTERM:
            control.hurry()
        control.stop()

    def mark(*_: object) -> None:
        control.mark()

    def renew(*_: object) -> None:
        if not recorded or (terminal and not _has_terminal()):
            control.stop()
        else:
            control.renew()

    with handling({"SIGINT": stop, "SIGTERM": stop, "SIGHUP": renew, "SIGUSR1": mark}):
        yield


def _has_terminal() -> bool:
    """Return True unless whoever started this has hung up, or never had a terminal."""
    with suppress(OSError):
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY))
        return True
    return False
