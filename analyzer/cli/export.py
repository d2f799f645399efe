"""`tailbyte export`: the decoded tables of a capture for other tools: Parquet, Arrow, CSV, or MCAP with telemetry."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from analyzer.cli import USAGE, options, streams
from analyzer.cli.goal import FORMS, goal

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from analyzer.cli.export_findings import Judging
    from analyzer.cli.goal import Goal
    from analyzer.cli.progress import Progress
    from analyzer.cli.session import Session
    from analyzer.sinks.atomic import Target, TargetFolder
    from analyzer.sinks.part import Part
    from analyzer.window import Window

_STALE_SHOWN = 3


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser(
        "export",
        help="decoded tables as Parquet, Arrow, CSV or MCAP",
        description=__doc__,
        usage="%(prog)s [options] CAPTURE... -o DIR|FILE",
    )
    options.add_reader(parser)
    parser.add_argument(
        "-o", "-w", dest="output", required=True, metavar="DIR|FILE",
        help="a folder, which gets a file for each table, or FILE.mcap; with one --table also a file of that table",
    )  # fmt: skip
    parser.add_argument(
        "-F", "--format", dest="form", choices=FORMS, help="default: what the name of the output says, else parquet"
    )
    parser.add_argument(
        "--table", action="append", default=[], metavar="NAME",
        help="only this table: frames, transfers, events, NodeStatus or another type or packet; repeatable; "
        "findings: what `check` finds, into MCAP",
    )  # fmt: skip
    options.add_window(parser)
    parser.set_defaults(run=run)


class _InputError(Exception):
    """A table would be written over a capture."""


def run(args: argparse.Namespace) -> int:
    """Reads the captures once and writes their tables; the output is there whole or not at all."""
    from analyzer.cli.session import Session  # noqa: PLC0415
    from analyzer.sinks.export import BASIC, resolve  # noqa: PLC0415

    with Session(args) as session:
        try:
            if args.stop in FORMS:
                return _usage(f"--to is a time: did you mean -F {args.stop}")
            window = options.window(args)
            tables = dict.fromkeys(resolve(session.registry, name) for name in args.table)
            wanted = goal(args.output, args.form, tuple(tables))
            options.refuse_input(args, args.output)
            for name in (tables or BASIC) if wanted.folder else ():
                options.refuse_input(args, _file(wanted, name))
        except (argparse.ArgumentTypeError, LookupError, ValueError) as error:
            return _usage(str(error))
        reading = _Reading(session, window)
        try:
            if wanted.form == "mcap":
                _telemetry(wanted, session, reading)
            else:
                _tables(wanted, args, session, reading)
        except _InputError as error:
            return _usage(str(error))
    return session.status


class _Reading:
    """The capture part by part, with what is inside the window counted."""

    def __init__(self, session: Session, window: Window) -> None:
        self._session, self.window = session, window
        self._frames = self._transfers = self._events = 0

    def parts(self, judging: Judging | None = None) -> Iterator[Part]:
        """What is inside the window; all is judged. Ends the session when there is no use in going on."""
        from analyzer.sinks.part import PartSelection  # noqa: PLC0415

        selection = PartSelection(self.window, self._session.again)
        batches = self._session.batches()
        for part in selection.parts(batches if judging is None else judging.over(batches)):
            self._frames += len(part.frames)
            self._transfers += len(part.transfers)
            self._events += len(part.events)
            yield part
            self._session.go_on()
        self._session.go_on()
        self._session.require(selection.problem)
        self._session.require_inside(self._frames + self._transfers + self._events, self.window)

    @property
    def outside(self) -> str:
        """What of the capture was left out, in words."""
        frames = self._session.totals.lines["frames"] - self._frames
        transfers = self._session.transfers - self._transfers
        return f", {frames} frames and {transfers} transfers outside the window" if frames or transfers else ""


def _tables(goal: Goal, args: argparse.Namespace, session: Session, reading: _Reading) -> None:
    from analyzer.sinks.atomic import Target, TargetFolder  # noqa: PLC0415
    from analyzer.sinks.export import TableExport  # noqa: PLC0415

    place: AbstractContextManager[Target | TargetFolder] = TargetFolder(goal.path) if goal.folder else Target(goal.path)
    with place as target:

        def make(name: str) -> BinaryIO:
            if not isinstance(target, TargetFolder):
                return target.file
            path = _file(goal, name)
            try:  # which tables there are is known only now
                options.refuse_input(args, path)
            except ValueError as error:
                raise _InputError(str(error)) from None
            return target.open(Path(path).name)

        export = TableExport(goal.form, make, session.registry, goal.tables, _scratch(goal.path), _about(session))
        with closing(export), _progress(session) as progress:
            for part in progress.over(reading.parts()):
                export.add(part)
            for _ in progress.over(export.finish(), "writing frames"):
                session.go_on()
        session.go_on()
    tables = "1 table" if len(export.rows) == 1 else f"{len(export.rows)} tables"
    _account(session, f"{tables} with {sum(export.rows.values())} rows", target.name, reading.outside)
    if goal.folder:
        _say_stale(session, goal, {Path(_file(goal, name)).name for name in export.rows})


def _telemetry(goal: Goal, session: Session, reading: _Reading) -> None:
    from analyzer.cli.export_findings import Judging  # noqa: PLC0415
    from analyzer.sinks import losses  # noqa: PLC0415
    from analyzer.sinks.atomic import Target  # noqa: PLC0415
    from analyzer.sinks.export import FINDINGS  # noqa: PLC0415
    from analyzer.sinks.telemetry import TelemetryExport  # noqa: PLC0415

    judging = Judging(session) if FINDINGS in (goal.tables or [FINDINGS]) else None
    with Target(goal.path) as target:
        export = TelemetryExport(target.file, goal.tables, _about(session))
        with _progress(session) as progress:
            for part in progress.over(reading.parts(judging)):
                export.add(part)
        if judging is not None:
            export.add_findings(judging.report(), windowed=bool(reading.window))
        export.finish()
        session.go_on()
    events = f", {export.events} events" if export.events else ""
    findings = f", {export.findings} findings" if export.findings else ""
    what = f"{export.messages} messages{events}{findings} and {export.frames} frames"
    _account(session, what, target.name, reading.outside)
    if lost := losses(export.lost):
        streams.tell(f"-- frames in MCAP cannot hold: {lost}\n")


def _file(goal: Goal, table: str) -> str:
    """The file of a table in the folder."""
    from analyzer.sinks.tables import SUFFIXES  # noqa: PLC0415

    return str(Path(goal.path, table + SUFFIXES[goal.form]))


def _progress(session: Session) -> Progress:
    from analyzer.cli.progress import Progress  # noqa: PLC0415

    progress = Progress(session.source)
    session.held = [] if progress.active else None
    return progress


def _scratch(output: str) -> str | None:
    """Where there is room for temporary files if there is room for the output; None leaves it to the system."""
    path = Path(output)
    if output == "-":
        return None
    return output if path.is_dir() else str(path.parent) if not path.exists() or path.is_file() else None


def _account(session: Session, what: str, where: str, outside: str) -> None:
    from analyzer.views.terminal import escape  # noqa: PLC0415

    session.release()
    streams.tell(f"-- {what} written to {escape(where)}{outside}\n")
    session.account(None)


def _say_stale(session: Session, goal: Goal, written: set[str]) -> None:
    """Tables of an earlier export, which nobody should take for those of this capture."""
    suffix = next(iter(written)).rpartition(".")[2]
    stale = sorted(path.name for path in Path(goal.path).glob(f"*.{suffix}") if path.name not in written)
    if stale:
        more = "" if len(stale) <= _STALE_SHOWN else f" and {len(stale) - _STALE_SHOWN} more"
        session.complain(f"{goal.path} also holds earlier files: {', '.join(stale[:_STALE_SHOWN])}{more}")


def _about(session: Session) -> dict[str, str]:
    from analyzer.cli import version  # noqa: PLC0415
    from analyzer.views.terminal import escape  # noqa: PLC0415

    return {
        "tailbyte.version": version(),
        "tailbyte.capture": escape(session.source.name),  # may hold bytes that are no text
        "tailbyte.times": "UTC; in a capture without dates from an arbitrary start",
    }


def _usage(reason: str) -> int:
    streams.complain(reason, "tailbyte export")
    return USAGE
