"""`tailbyte live`: what is on the bus now, judged as it comes, and recorded."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.cli import decode, reports, status
from analyzer.cli.arguments import buses, options, rules

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.app.criteria import Criteria
    from analyzer.app.live.request import LiveMode
    from analyzer.app.live.run import LiveRun
    from analyzer.filter.compiled import Filter
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface
    from analyzer.report.model import Report

NAME = "tailbyte live"
HOUR = 3600.0
# Seconds that the last words may take after SIGTERM.
_LAST_WORDS = 3.0
_EPILOG = """\
On a terminal a monitor (q ends it, ? tells of its keys); in a pipe, or with an option about what to list, a list. Both
end with Ctrl-C or SIGTERM, which finish the recording; SIGUSR1 sets a mark in it, and SIGHUP begins it anew under its
name, once it was moved away. Findings are told on standard error when they begin, and the verdict at the end is that of
`tailbyte check` on the recording.

COND of -b and -a as dumpcap has them. Times may be written as 10, 10s, 5min, 2h; sizes in kB, or as 100MB.

exit status: that of check: 0 clean, 1 findings at or above --fail-on, 2 wrong usage, 3 an interface that cannot be
opened or is gone for good, or a recording that could not be written, whatever was found, 4 nothing to judge."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options; letters mean what they mean to tshark and dumpcap."""
    parser.usage = "%(prog)s [options] IFACE..."
    parser.description = __doc__
    parser.epilog = _EPILOG
    group = buses.add_buses(parser)
    group.add_argument("-D", dest="interfaces", action="store_true", help="list the interfaces that there are, and end")
    group.add_argument(
        "-f", "--filter", dest="filter", action="append", default=[], metavar="ID:MASK",
        help="capture filter, as candump has it: 123:7FF, ID~MASK, #ERRORMASK; of the kernel on SocketCAN; repeatable",
    )  # fmt: skip
    group.add_argument(
        "--time-stamp-type", dest="stamps", choices=("host", "adapter"), default="host",
        help="of SocketCAN: the kernel's clock (default), or that of the controller, if it has one",
    )  # fmt: skip
    _add_recording(parser)
    show = parser.add_argument_group("what to show")
    decode.add_view(show)
    show.add_argument(
        "-Y", "--display-filter", dest="display", metavar="FILTER",
        help="list only rows that it holds for; what is recorded and judged stays",
    )  # fmt: skip
    show.add_argument("--list", action="store_true", help="a list on a terminal, too")
    show.add_argument(
        "--view",
        dest="browser",
        action="store_true",
        help="list, details and bytes, to look through as with `view`",
    )
    show.add_argument("-q", dest="quiet", action="store_true", help="no list and no monitor: record and judge")
    show.add_argument("-l", dest="flush", action="store_true", help="list ten times a second, not five")
    show.add_argument(
        "--plot", nargs="?", const="", metavar="URL", help="feed a Rerun viewer: a new one, or that of URL"
    )
    show.add_argument("--status", metavar="TIME", help="say so often what has happened; default: 1h, and once a day")
    alone = parser.add_argument_group("while nobody looks")
    alone.add_argument("--status-file", metavar="FILE", help="write every few seconds how it goes, as JSON")
    alone.add_argument(
        "--exec", dest="exec_", metavar="CMD",
        help="run this for each new finding, without a shell: it is JSON on standard input; {rule} {severity} "
        "{category} {bus} {node} {type} {time} {text} stand for what it says",
    )  # fmt: skip
    alone.add_argument(
        "--exec-on", action="append", default=[], metavar="RULE|SEVERITY",
        help="for findings of a rule or layer, or of at least this severity; default: error; repeatable",
    )  # fmt: skip
    group = rules.add_rules(parser)
    options.add_dissectors(group)
    reports.add(parser, ["-o"])
    options.add_colour(parser)
    parser.set_defaults(run=run, around=None, follow=False, no_pager=True)


def _add_recording(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("recording")
    group.add_argument("-w", dest="record", metavar="FILE", help="candump text, MCAP or pcapng, by its name")
    options.add_capture_form(group, "record_form")
    group.add_argument("--force", action="store_true", help="write over a file that is there")
    group.add_argument(
        "-b", dest="ring", action="append", default=[], type=_ring, metavar="COND",
        help="begin a new file after duration:TIME, interval:TIME, filesize:KB or packets:N; keep the last files:N",
    )  # fmt: skip
    group.add_argument(
        "-a", dest="autostop", action="append", default=[], metavar="COND",
        help="end after duration:TIME, packets:N, filesize:KB, files:N, or finding:SEVERITY or finding:RULE",
    )  # fmt: skip
    group.add_argument("-c", dest="count", type=_count, metavar="N", help="end after N frames")
    group.add_argument(
        "--trigger", action="append", default=[], metavar="RULE|SEVERITY",
        help="record only around findings: of a rule or layer, or of at least this severity; repeatable",
    )  # fmt: skip
    group.add_argument("--pre", metavar="TIME", help="recorded before each of them; default: 10s")
    group.add_argument("--post", metavar="TIME", help="and after the last; default: 5s")


def run(args: argparse.Namespace) -> int:
    """Run until somebody or a condition ends it."""
    if args.interfaces:
        return _list()
    from analyzer.app.process.start import plain_arrow, plain_can, return_memory  # noqa: PLC0415

    plain_can()
    from analyzer.live.interfaces.naming import InterfaceError  # noqa: PLC0415 - python-can takes its time
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    plain_arrow()
    return_memory()
    try:
        wanted = Wanted(args)
    except (LookupError, ValueError, OSError, argparse.ArgumentTypeError) as error:
        return status.usage(error, NAME)
    try:
        return wanted.run()
    except (DsdlError, ProfileError) as error:  # types are compiled when they occur
        return status.usage(error, NAME)
    except (InterfaceError, TargetError) as error:
        return status.damaged(error)


class Wanted:
    """The arguments, checked before anything is opened. Raises `LookupError`, `ValueError` and `OSError`."""

    def __init__(self, args: argparse.Namespace) -> None:
        import dissectors  # noqa: PLC0415
        from analyzer.app.live.hook import parse_command  # noqa: PLC0415
        from analyzer.app.live.request import LiveRequest  # noqa: PLC0415
        from analyzer.app.live.session_recording import RecordingOptions, SessionPlan  # noqa: PLC0415

        view = decode.view_options(args)
        named = buses.buses(args)
        mode = _mode(args)
        self.files = list(reports.files(args))
        _check_files(args.record, args.status_file, self.files)
        self._text = reports.show_options(args)
        self._recorded = args.record not in (None, "-")
        # Whether standard output belongs to a report, and whether it is full of frames.
        self._silent, self._apart = any(path == "-" for _, path in self.files), mode == "list" or args.record == "-"
        if self._silent and self._apart:
            raise ValueError("standard output is taken: give the report a file, or leave out the list with -q")
        every = HOUR if args.status is None else options.checked("--status", _span, args.status)
        if args.bitrate is None:
            args.bitrate = _common_rate(interface for interface, _ in named)
        registry = dissectors.load(*options.folders(args))
        self._rules = rules.choice(args)
        self.criteria = rules.criteria(self._rules, registry, NAME)
        chosen = _filter(args.display, self.criteria)
        if mode == "list":
            from analyzer.views.writers import writer  # noqa: PLC0415 - only what is needed

            writer(view, registry, None)  # names that do not exist are told before anything is opened
        command = parse_command(args.exec_, args.exec_on, self.criteria.pages)
        recording = RecordingOptions(
            args.record, args.record_form, args.compression, args.force, args.ring, args.autostop, args.count,
            args.trigger, args.pre, args.post,
        )  # fmt: skip
        self.request = LiveRequest(
            buses=tuple(named),
            mode=mode,
            view=view,
            plan=SessionPlan(recording, self.criteria.pages, _header(named)),
            every=every,
            flush=args.flush,
            hardware=args.stamps == "adapter",
            plot=args.plot,
            bit_rate=args.bitrate,
            status_file=args.status_file,
            command=command,
            filter=chosen,
            drawn=any(form == "html" for form, _ in self.files),
        )

    def run(self) -> int:
        """Run the session and report; return the exit status. Raises what opening raises."""
        from analyzer.app.live.run import LiveRun, signals  # noqa: PLC0415 - not before there is something to do
        from analyzer.live.capture_loop import SessionControl  # noqa: PLC0415

        control = SessionControl()
        session = LiveRun(self.request, self.criteria, control)
        with ExitStack() as stack:
            stack.enter_context(signals(control, recorded=self._recorded))
            targets = reports.opened(self.files, stack)
            report = session.run()
            written = report is not None and reports.all_written(targets, report, everything=self._text.everything)
        with streams.bounded(_LAST_WORDS, wanted=control.hurried):
            self._tell(session, report)
        if report is None or session.problems:
            return status.DAMAGED
        return status.of_report(report, complete=written)

    def _tell(self, session: LiveRun, report: Report | None) -> None:
        """Say how it went; the report is None if the rules have failed."""
        for line in session.account:
            streams.tell(f"-- {line}\n")
        for problem in session.problems:
            streams.complain(problem)
        if report is None:
            return
        if self._apart:
            from analyzer.report.text import render  # noqa: PLC0415

            streams.tell(render(report, everything=self._text.everything))
        elif not self._silent:
            reports.tell(report, self._text)
        rules.tell_gate(self._rules, report)


def _filter(text: str | None, criteria: Criteria) -> Filter | None:
    """Return the filter of the list. Raises `FilterError` for one that is wrong."""
    if text is None:
        return None
    from analyzer.app.filtered.run_filter import (  # noqa: PLC0415 - few lists have one
        NO_LABELS,
        check_labels,
        check_rules,
    )
    from analyzer.filter.compiled import compile_filter  # noqa: PLC0415

    chosen = compile_filter(text, criteria.registry)
    if chosen.asks_labels:
        if criteria.choice.vehicle is None:
            raise ValueError(NO_LABELS)
        check_labels(chosen, criteria.labels.values())
    check_rules(chosen, criteria.pages)
    return chosen


def _mode(args: argparse.Namespace) -> LiveMode:
    """Return `list`, `monitor` or `quiet`. Raises `ValueError` for options about a list that there is not to be."""
    asked = {
        "--list": args.list, "-V": args.details, "-O": args.only, "-P": args.summary, "-x": args.bytes,
        f"-T {args.form}": args.form != "text", "-l": args.flush, "-Y": args.display is not None,
    }  # fmt: skip
    if args.browser:
        del asked["-Y"]  # a filter of the browser
    listing = next((option for option, given in asked.items() if given), None)
    if args.quiet or args.record == "-":
        if listing is not None:
            raise ValueError(f"{listing} and {'-q' if args.quiet else '-w -'} contradict each other")
        return "quiet"
    if listing is not None:
        return "list"
    from analyzer.terminal import possible  # noqa: PLC0415

    if args.browser:
        if not (sys.stdout.isatty() and possible()):
            raise ValueError("--view needs a terminal that can move its cursor: --list lists the same")
        return "browser"
    return "monitor" if sys.stdout.isatty() and possible() else "list"


def _header(buses: Sequence[tuple[Interface, Filters]]) -> str:
    """Say what the recording would hold if it happened: only the kernel counts what it drops."""
    from analyzer.facts.recorder import statement  # noqa: PLC0415

    kernel = all(interface.kind == "socketcan" for interface, _ in buses)
    return statement(drops=kernel, errors=kernel and all(filters.errors is None for _, filters in buses))


def _check_files(record: str | None, state: str | None, reports: Iterable[tuple[str, str]]) -> None:
    """Raise `ValueError` for two of them in one file."""
    seen: dict[str, tuple[str, str]] = {}
    for kind, path in (("recording", record), ("state", state), *(("report", path) for _, path in reports)):
        if path in (None, "", "-"):
            continue
        other, first = seen.setdefault(os.path.realpath(path), (kind, path))
        if (other, first) != (kind, path):
            raise ValueError(f"{first}: a {other} and a {kind} cannot be one file")


def _ring(text: str) -> str:
    """Return the condition as it is; others have a bit rate there."""
    digits = text.rstrip("kKM")
    if digits.isdecimal():
        rate = digits + "000" * {"": 0, "M": 2}.get(text[len(digits) :], 1)
        raise argparse.ArgumentTypeError(f"begins new files, as in dumpcap; did you mean --bitrate {rate}?")
    return text


def _count(text: str) -> int:
    """Read a number of frames; others have an interface there."""
    if text[:1].isalpha():
        raise argparse.ArgumentTypeError(f"takes a number; did you mean {NAME} {text}?")
    return options.positive(text)


def _span(text: str) -> float:
    """Read the seconds between two lines."""
    from analyzer.window.limits import duration  # noqa: PLC0415

    seconds = duration(text) / 1e9
    if seconds <= 0:
        raise ValueError("no time at all")
    return seconds


def _common_rate(interfaces: Iterable[Interface]) -> int | None:
    """Return the bit rate of the controllers, if all of them have the same."""
    rates = {interface.bit_rate for interface in interfaces}
    return rates.pop() if len(rates) == 1 else None


def _list() -> int:
    from analyzer.live.interfaces.listing import list_interfaces  # noqa: PLC0415
    from analyzer.live.interfaces.table import render  # noqa: PLC0415

    sys.stdout.write(render(list_interfaces()))
    return status.OK
