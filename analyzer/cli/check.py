"""`tailbyte check`: captures under all rules; the exit status is for machines, the text for people."""

from __future__ import annotations

import argparse
import os
from contextlib import ExitStack
from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, INTERRUPTED, OK, USAGE, check_init, extracting, judging, options, reports, streams

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.cli.session import Session
    from analyzer.facts.periods import Periods
    from analyzer.report.build import Taken
    from analyzer.report.model import Report
    from analyzer.rules.checking import Check, Measured
    from analyzer.window import Window

_EPILOG = """\
Several captures are judged one by one, each with findings of its own in one report; --same-bus, --bus or --offset
merges them into one first, as for the other commands.

A window is judged as a capture of its own, whose start was not seen; its frames keep their numbers in the file.

exit status: 0 clean, 1 findings at or above --fail-on or a vehicle unlike the expected one (--init: no healthy capture,
no file), 2 wrong usage, 3 a capture unreadable or damaged or output not writable, 4 nothing to judge, no selected rule
that could be judged, or less than the vehicle file requires, 130 interrupted. 1 wins over 4, 4 over 3. The report
always states damage."""


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser(
        "check",
        help="judge captures by all rules of the protocol",
        description=__doc__,
        usage="%(prog)s [options] CAPTURE...",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_reader(parser)
    rules = judging.add_rules(parser)
    rules.add_argument(
        "--init",
        action="store_true",
        help="write a file for --profile from a healthy capture to -o FILE instead; "
        "a capture with findings at or above --fail-on, or errors of devices, is none: exit status 1, no file",
    )
    rules.add_argument("--force", action="store_true", help="--init writes over a file, and from any capture")
    rules.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    group = reports.add(parser)
    group.add_argument(
        "--github", action="store_true", help="annotations for GitHub Actions, and the summary of the step"
    )
    group.add_argument(
        "--extract", metavar="DIR", help="the smallest capture that still shows it, of each finding, as candump text"
    )
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


class _UsageError(Exception):
    """Arguments that do not go together."""


def run(args: argparse.Namespace) -> int:
    """Judges every capture, then writes the reports: each is there whole or not at all."""
    from analyzer.cli.start import plain_arrow  # noqa: PLC0415
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    if args.alone:
        plain_arrow()
    try:
        wanted = _Wanted(args)
        if args.init:
            return wanted.initial()
        with ExitStack() as stack:
            targets = reports.opened(wanted.files, stack)
            report, interrupted = wanted.judge()
            written = reports.all_written(targets, report, everything=args.all)
        reports.tell(args, report, silent=wanted.silent)
        if args.github:
            written = reports.tell_github(report, aside=wanted.silent) and written
        if args.extract and not interrupted:
            source = extracting.Origin(args, wanted.groups, wanted.registry, wanted.settings, wanted.window)
            written = extracting.extract(report, source, args.extract) and written
    except (_UsageError, ProfileError, DsdlError) as error:  # a folder's rules are read when they are needed
        streams.complain(str(error), "tailbyte check")
        return USAGE
    except TargetError as error:
        streams.complain(str(error))
        return DAMAGED
    if interrupted:
        return INTERRUPTED
    return report.gate.exit_status or (OK if written else DAMAGED)


class _Wanted:
    """The arguments, checked before anything is read. Raises `_UsageError`."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._args = args
        self._periods: Periods | None = None
        self.groups: dict[str, list[str]] = {}
        try:
            self.names = options.captures(args)
            self.window: Window = options.window(args)
            self.files = [("toml", check_init.target(args))] if args.init else list(reports.files(args))
            for _, path in self.files:
                options.refuse_input(args, path)
            extracting.refuse_streams(args, self.names)
            self._judging = judging.Judging(args, "tailbyte check")
            self.registry, self.settings = self._judging.registry, self._judging.settings
        except LookupError as error:
            raise _UsageError(error.args[0]) from None
        except (argparse.ArgumentTypeError, OSError, ValueError) as error:  # ProfileError and DsdlError are ValueError
            raise _UsageError(str(error)) from None

    @property
    def silent(self) -> bool:
        """Whether standard output belongs to a report."""
        return any(path == "-" for _, path in self.files)

    def judge(self) -> tuple[Report, bool]:
        """The report, and whether the reading was interrupted."""
        taken, interrupted = self._take_all()
        return self._build(taken), interrupted

    def initial(self) -> int:
        """Writes a vehicle file instead of a report; the exit status."""
        from analyzer.facts.periods import Periods  # noqa: PLC0415

        self._periods = Periods()
        taken, interrupted = self._take_all()
        ((_, path),) = self.files
        model = check_init.Model(self._build(taken), taken[0], self.registry, self._periods)
        return check_init.write(path, model, force=self._args.force, interrupted=interrupted)

    def _take_all(self) -> tuple[list[Taken], bool]:
        from analyzer.conformance import ids  # noqa: PLC0415

        merge = bool(self._args.same_bus or self._args.bus or self._args.offset)
        groups = [self.names] if merge else [[name] for name in self.names]
        if self._args.init and len(groups) > 1:
            raise _UsageError("--init takes one capture, or several of one bus with --same-bus")
        self.groups = dict(zip(ids(groups), groups, strict=True))
        taken: list[Taken] = []
        interrupted = False
        for label, group in self.groups.items():
            one, interrupted = self._take(group, label)
            taken.append(one)
            if interrupted:
                break
        return taken, interrupted

    def _build(self, taken: Sequence[Taken]) -> Report:
        return self._judging.build(taken, options.window_words(self._args) if self.window else "")

    def _take(self, names: Sequence[str], label: str) -> tuple[Taken, bool]:
        """One capture, or several as one. Complaints have been made when this is back."""
        from analyzer.cli.session import Session  # noqa: PLC0415
        from analyzer.conformance import damage_of, reason_of  # noqa: PLC0415
        from analyzer.report.build import Taken  # noqa: PLC0415
        from analyzer.rules.checking import Check  # noqa: PLC0415
        from analyzer.sources import CaptureError  # noqa: PLC0415

        args = argparse.Namespace(**{**vars(self._args), "capture": list(names), "capture_": []})
        checking, unopened = Check(self.registry, self.settings), ""
        with Session(args) as session:
            for part in session.source.parts:
                part.hashed = True
            try:
                for measured in self._measured(session, checking):
                    checking.feed(measured)
            except CaptureError as error:
                unopened = reason_of(error, names[0])
                raise
        if session.status == USAGE:
            raise SystemExit(USAGE)
        session.go_on()
        taken = Taken(
            id=label,
            path=names[0],
            checked=checking.finish(session.source.parts, session.engine),
            damage=unopened or damage_of(session.source, session.totals),
            unopened=bool(unopened),
            live=session.source.live,
            arguments=tuple(self._again(names)),
        )
        return taken, session.status == INTERRUPTED

    def _measured(self, session: Session, checking: Check) -> Iterator[Measured]:
        from analyzer.ahead import ahead  # noqa: PLC0415
        from analyzer.cli.progress import Progress  # noqa: PLC0415
        from analyzer.sources import StopReading  # noqa: PLC0415

        decoded = session.inside(self.window)
        batches = checking.measured(decoded if self._periods is None else self._periods.over(decoded))
        if all(os.path.isfile(part.name) for part in session.source.parts):  # noqa: PTH113 - signals end other reading here, in this thread
            batches = ahead(batches)
        with Progress(session.source) as progress:
            session.held = [] if progress.active else None
            try:
                yield from progress.over(batches)
            except StopReading:  # it was being opened
                raise KeyboardInterrupt from None
        session.release()

    def _again(self, names: Sequence[str]) -> Iterator[str]:
        """Arguments behind the first name that read all of it in the same way."""
        args = self._args
        yield from (f"./{name}" if name.startswith("-") and name != "-" else name for name in names[1:])
        if args.same_bus:
            yield "--same-bus"
        for option, given in (("--bus", args.bus), ("--offset", args.offset), ("--dissector", args.dissector)):
            for value in given:
                yield from (option, value)
