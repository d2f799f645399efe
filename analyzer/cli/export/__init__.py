"""`tailbyte export`: the decoded tables of a capture for other tools: Parquet, Arrow, CSV, or MCAP with telemetry."""

from __future__ import annotations

import argparse
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from analyzer.app.process import streams
from analyzer.app.targets import refuse_filled, refuse_input
from analyzer.cli import status
from analyzer.cli.arguments import options, rules
from analyzer.cli.arguments.autopilot import LogBeside, add_log, require
from analyzer.cli.export.target import FORMS, goal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager

    from analyzer.app.criteria import Criteria
    from analyzer.app.filtered.frames import MatchingFrames
    from analyzer.app.found import FoundTable
    from analyzer.app.run import Run
    from analyzer.cli.complaints import Complaints
    from analyzer.cli.export.target import Goal
    from analyzer.decode.engine import Batch
    from analyzer.sinks.atomic import Target, TargetFolder
    from analyzer.window.part import BatchPart

NAME = "tailbyte export"
_STALE_SHOWN = 3


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE... -o DIR|FILE"
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    parser.add_argument(
        "-o", "-w", dest="output", required=True, metavar="DIR|FILE",
        help="a folder, which gets a file for each table, or FILE.mcap; with one --table also a file of that table",
    )  # fmt: skip
    parser.add_argument(
        "-F", "--format", dest="form", choices=FORMS, help="default: what the name of the output says, else parquet"
    )
    parser.add_argument("--force", action="store_true", help="write among the files that the folder holds already")
    parser.add_argument(
        "--table", action="append", default=[], metavar="NAME",
        help="only this table: frames, transfers, events, NodeStatus or another type or packet; repeatable; "
        "all: each of them; in no folder unless they are asked for: findings (what `check` finds), flights and "
        "flight_events (what `events` lists), esc (what each ESC reported, beside what it was commanded)",
    )  # fmt: skip
    add_log(parser)
    group = rules.add_choice(parser, "rules of the findings")
    group.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    options.add_filter(parser)
    options.add_window(parser)
    parser.set_defaults(run=run)


class _InputError(Exception):
    """A table would be written over a capture."""


def run(args: argparse.Namespace) -> int:
    """Read the captures once and write their tables; the output is there whole or not at all."""
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import reading  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415
    from analyzer.sinks.export import BASIC, resolve  # noqa: PLC0415

    if args.stop in FORMS:
        return status.usage(f"--to is a time: did you mean -F {args.stop}?", NAME)
    try:
        beside = LogBeside(args)
        request = replace(options.request(args), rules=rules.choice(args))
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    complaints = Complaints()
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            tables = dict.fromkeys(resolve(run.registry, name) for name in args.table)
            wanted = goal(args.output, args.form, tuple(tables))
            require(args, wanted.tables)
            refuse_input(request.names, args.output)
            for name in (tables or BASIC) if wanted.folder else ():
                refuse_input(request.names, _file(wanted, name))
            if wanted.folder:
                refuse_filled(wanted.path, force=args.force)
            criteria = _criteria(run, wanted)
            chosen = options.choose(run)
        except (argparse.ArgumentTypeError, LookupError, OSError, ValueError) as error:
            return status.usage(error, NAME)
        export = _Export(run, wanted, complaints, criteria, chosen, beside)
        try:
            if wanted.form == "mcap":
                export.telemetry()
            else:
                export.tables()
        except _InputError as error:
            return status.usage(error, NAME)
    return beside.status(status.of_run(run))


def _criteria(run: Run, goal: Goal) -> Criteria | None:
    """Return by what the capture is judged, None if no findings are wanted. Raises what `Criteria` raises."""
    from analyzer.app.request import RuleChoice  # noqa: PLC0415

    if goal.findings:
        return rules.criteria(run.request.rules, run.registry, NAME)
    if replace(run.request.rules, dialects=()) != RuleChoice():
        raise ValueError("rules are chosen, but no findings: give --table findings")
    return None


class _Export:
    """The capture part by part on its way into the output, with what is inside the window counted.

    It is judged by the criteria, if there are some.
    """

    def __init__(
        self, run: Run, goal: Goal, complaints: Complaints, criteria: Criteria | None, chosen: MatchingFrames | None,
        beside: LogBeside,
    ) -> None:  # fmt: skip
        from analyzer.sinks.extent import Extent  # noqa: PLC0415

        self._beside = beside
        self._inside = Extent() if run.request.window else None
        self._run, self._goal, self._complaints, self._criteria, self._chosen = run, goal, complaints, criteria, chosen
        self._frames = self._transfers = self._events = 0

    def tables(self) -> None:
        """Write a file for each table, or one table."""
        from analyzer.app.happened import HappenedTables  # noqa: PLC0415
        from analyzer.cli.reading import watched  # noqa: PLC0415
        from analyzer.sinks.atomic import Target, TargetFolder  # noqa: PLC0415
        from analyzer.sinks.export import TableExport  # noqa: PLC0415

        run, goal = self._run, self._goal
        place: AbstractContextManager[Target | TargetFolder]
        place = TargetFolder(goal.path) if goal.folder else Target(goal.path)
        found = None if self._criteria is None else self._found(self._criteria)
        happened = HappenedTables(run, goal.tables, self._beside.read())
        with place as target, ExitStack() as stack:
            if found is not None:
                stack.callback(found.close)

            def make(name: str) -> BinaryIO:
                if not isinstance(target, TargetFolder):
                    return target.file
                path = _file(goal, name)
                try:  # which tables there are is known only now
                    refuse_input(run.request.names, path)
                except ValueError as error:
                    raise _InputError(str(error)) from None
                return target.open(Path(path).name)

            about, threaded = _about(run), run.request.threads > 1
            scratch = _scratch(goal.path)
            export = TableExport(goal.form, make, run.registry, goal.tables, scratch, about, threaded=threaded)
            with closing(export), watched(run.source, self._complaints) as progress:
                judged = None if found is None else found.beside
                for part in progress.over(self._parts(judged, happened.beside)):
                    export.feed(part)
                if found is not None:
                    export.feed_found("findings", found.rows(self._inside))
                for name in happened.names:
                    export.feed_found(name, happened.rows(name, self._inside))
                self._beside.conclude(happened.autopilot)
                for _ in progress.over(export.finish(), "writing frames"):
                    run.go_on()
            run.go_on()
        tables = "1 table" if len(export.rows) == 1 else f"{len(export.rows)} tables"
        self._account(f"{tables} with {sum(export.rows.values())} rows", target.name)
        if goal.folder:
            _say_stale(run, goal, {Path(_file(goal, name)).name for name in export.rows})

    def _found(self, criteria: Criteria) -> FoundTable:
        from analyzer.app.found import FoundTable  # noqa: PLC0415 - it brings the rules

        return FoundTable(self._run, criteria, _scratch(self._goal.path), self._chosen)

    def telemetry(self) -> None:
        """Write messages, frames, events and findings into one MCAP file."""
        from analyzer.app.found import FilteredJudge  # noqa: PLC0415
        from analyzer.cli.reading import watched  # noqa: PLC0415
        from analyzer.report.log_messages import log_messages  # noqa: PLC0415
        from analyzer.sinks import losses  # noqa: PLC0415
        from analyzer.sinks.atomic import Target  # noqa: PLC0415
        from analyzer.sinks.telemetry import TelemetryExport  # noqa: PLC0415

        run, goal = self._run, self._goal
        criteria = self._criteria
        judged = None if criteria is None else FilteredJudge(run, criteria, self._chosen)
        with Target(goal.path) as target:
            export = TelemetryExport(target.file, goal.tables, _about(run))
            with watched(run.source, self._complaints) as progress:
                for part in progress.over(self._parts(None if judged is None else judged.beside)):
                    export.feed(part)
            if judged is not None:
                log = log_messages(judged.report(), export.extent, export.capture, windowed=bool(run.request.window))
                export.add_findings(log)
            export.finish()
            run.go_on()
        events = f", {export.events} events" if export.events else ""
        findings = f", {export.findings} findings" if export.findings else ""
        self._account(f"{export.messages} messages{events}{findings} and {export.frames} frames", target.name)
        if lost := losses(export.lost):
            streams.tell(f"-- frames in MCAP cannot hold: {lost}\n")

    def _parts(self, *beside: Callable[[Iterable[Batch]], Iterator[Batch]] | None) -> Iterator[BatchPart]:
        """Yield what is inside the window; all goes through `beside`. Ends the run when there is no use in going on."""
        from analyzer.window.part import TableSelection  # noqa: PLC0415

        run = self._run
        selection = TableSelection(run.request.window, self._again)
        batches = run.ahead(batch.make_tables() for batch in run.batches(early=True))
        for one in beside:
            batches = batches if one is None else one(batches)
        for part in selection.parts(self._with_escs(self._marked(batches))):
            self._frames += len(part.frames)
            self._transfers += len(part.transfers)
            self._events += len(part.events)
            if self._inside is not None:
                self._inside.feed(part)
            yield part
            run.go_on()
        run.go_on()
        run.require(selection.problem)
        run.require_inside(self._frames + self._transfers + self._events)

    def _again(self) -> Iterator[Batch] | None:
        batches = self._run.again()
        return None if batches is None else self._with_escs(self._marked(batches))

    def _marked(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        """Return the batches, with the rows marked that a filter selects."""
        return batches if self._chosen is None else self._chosen.mark(batches)

    def _with_escs(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        """Return the batches, with the table of ESCs if it is wanted."""
        from analyzer.devices import escs  # noqa: PLC0415
        from analyzer.sinks.export import ESCS  # noqa: PLC0415

        return escs.beside(batches, self._run.registry) if ESCS in self._goal.tables else batches

    def _account(self, what: str, where: str) -> None:
        from analyzer.cli.reading import account  # noqa: PLC0415
        from analyzer.views.terminal import escape  # noqa: PLC0415

        run = self._run
        frames, transfers = run.totals.lines["frames"] - self._frames, run.transfers - self._transfers
        where_not = "outside the window" if self._chosen is None else "do not match"
        outside = f", {frames} frames and {transfers} transfers {where_not}" if frames or transfers else ""
        streams.tell(f"-- {what} written to {escape(where)}{outside}\n")
        account(run, None)


def _file(goal: Goal, table: str) -> str:
    """Return the file of a table in the folder."""
    from analyzer.sinks.tables import SUFFIXES  # noqa: PLC0415

    return str(Path(goal.path, table + SUFFIXES[goal.form]))


def _scratch(output: str) -> str | None:
    """Return where there is room for temporary files if there is room for the output; None leaves it to the system."""
    path = Path(output)
    if output == "-":
        return None
    return output if path.is_dir() else str(path.parent) if not path.exists() or path.is_file() else None


def _say_stale(run: Run, goal: Goal, written: set[str]) -> None:
    """Tell of tables of an earlier export, which nobody should take for those of this capture."""
    suffix = next(iter(written)).rpartition(".")[2]
    stale = sorted(path.name for path in Path(goal.path).glob(f"*.{suffix}") if path.name not in written)
    if stale:
        more = "" if len(stale) <= _STALE_SHOWN else f" and {len(stale) - _STALE_SHOWN} more"
        run.complain(f"{goal.path} also holds earlier files: {', '.join(stale[:_STALE_SHOWN])}{more}")


def _about(run: Run) -> dict[str, str]:
    from analyzer.app.version import version  # noqa: PLC0415
    from analyzer.views.terminal import escape  # noqa: PLC0415

    return {
        "tailbyte.version": version(),
        "tailbyte.capture": escape(run.source.name),  # may hold bytes that are no text
        "tailbyte.times": "UTC; in a capture without dates from an arbitrary start",
    }
