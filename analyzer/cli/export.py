"""`tailbyte export`: the decoded tables of a capture for other tools: Parquet, Arrow, CSV, or MCAP with telemetry."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from analyzer.cli import INTERRUPTED, USAGE, options, streams

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from contextlib import AbstractContextManager

    from analyzer.cli.progress import Progress
    from analyzer.cli.session import Session
    from analyzer.sinks.atomic import Target, TargetFolder
    from analyzer.sinks.part import Part, PartSelection

_FORMS = ("parquet", "arrow", "csv", "mcap")
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
        "-F", "--format", dest="form", choices=_FORMS, help="default: what the name of the output says, else parquet"
    )
    parser.add_argument(
        "--table", action="append", default=[], metavar="NAME",
        help="only this table: frames, transfers, events, NodeStatus or another type or packet; repeatable",
    )  # fmt: skip
    options.add_window(parser)
    parser.set_defaults(run=run)


@dataclass(frozen=True, slots=True)
class Goal:
    """What is written and where: `tables` by name, all if there are none; `folder` means a file for each."""

    form: str
    path: str
    folder: bool
    tables: tuple[str, ...]


def goal(output: str, form: str | None, tables: Sequence[str]) -> Goal:
    """What the arguments ask for. Raises `ValueError` when they do not go together."""
    suffix = Path(output).suffix.lower()[1:]
    named = suffix if suffix in _FORMS else None
    into = output.endswith("/") or Path(output).is_dir()
    if form is None and output == "-":
        raise ValueError("- says no format: give -F parquet, arrow, csv or mcap")
    if form is not None and named not in (None, form) and not into:
        raise ValueError(f"-o {output} and -F {form} contradict each other")
    form = form or named or "parquet"
    if output == "-" and form != "csv" and sys.stdout.isatty():
        raise ValueError(f"{form} is nothing for a terminal")
    if form == "mcap":
        if "transfers" in tables:
            raise ValueError("MCAP holds messages, frames and events, but no table of transfers")
        return Goal(form, output, folder=False, tables=tuple(tables))
    folder = into or (named is None and output != "-")
    if not folder and len(tables) != 1:
        raise ValueError(f"{output}: one file holds one table: choose it with --table NAME, or give a folder")
    return Goal(form, output, folder, tuple(tables))


def run(args: argparse.Namespace) -> int:
    """Reads the captures once and writes their tables; the output is there whole or not at all."""
    from analyzer.cli.session import Session  # noqa: PLC0415
    from analyzer.sinks.export import resolve  # noqa: PLC0415
    from analyzer.sinks.part import PartSelection  # noqa: PLC0415

    with Session(args) as session:
        try:
            if args.stop in _FORMS:
                return _usage(f"--to is a time: did you mean -F {args.stop}")
            window = options.window(args)
            options.refuse_input(args, args.output)
            tables = dict.fromkeys(resolve(session.registry, name) for name in args.table)
            wanted = goal(args.output, args.form, tuple(tables))
        except (argparse.ArgumentTypeError, LookupError, ValueError) as error:
            return _usage(str(error))
        selection = PartSelection(window, session.again)
        (_telemetry if wanted.form == "mcap" else _tables)(wanted, session, selection)
    return session.status


def _tables(goal: Goal, session: Session, selection: PartSelection) -> None:
    from analyzer.sinks.atomic import Target, TargetFolder  # noqa: PLC0415
    from analyzer.sinks.export import TableExport  # noqa: PLC0415
    from analyzer.sinks.tables import SUFFIXES  # noqa: PLC0415

    place: AbstractContextManager[Target | TargetFolder] = TargetFolder(goal.path) if goal.folder else Target(goal.path)
    with place as target:

        def make(name: str) -> BinaryIO:
            return target.open(name + SUFFIXES[goal.form]) if isinstance(target, TargetFolder) else target.file

        export = TableExport(goal.form, make, session.registry, goal.tables, _scratch(goal.path), _about(session))
        with closing(export), _progress(session) as progress:
            for part in progress.over(_parts(session, selection)):
                export.add(part)
            for _ in progress.over(export.finish()):
                _go_on(session)
        _go_on(session)
    tables = "1 table" if len(export.rows) == 1 else f"{len(export.rows)} tables"
    _account(session, f"{tables} with {sum(export.rows.values())} rows", target.name)
    if goal.folder:
        _say_stale(session, goal, {name + SUFFIXES[goal.form] for name in export.rows})


def _telemetry(goal: Goal, session: Session, selection: PartSelection) -> None:
    from analyzer.sinks.atomic import Target  # noqa: PLC0415
    from analyzer.sinks.telemetry import TelemetryExport  # noqa: PLC0415

    with Target(goal.path) as target:
        export = TelemetryExport(target.file, goal.tables, _about(session))
        with _progress(session) as progress:
            for part in progress.over(_parts(session, selection)):
                export.add(part)
        export.finish()
        _go_on(session)
    _account(session, f"{export.messages} messages and {export.frames} frames", target.name)
    if lost := "; ".join(f"{words} ({count})" for words, count in export.lost.items()):
        streams.tell(f"-- frames in MCAP cannot hold: {lost}\n")


def _progress(session: Session) -> Progress:
    from analyzer.cli.progress import Progress  # noqa: PLC0415

    progress = Progress(session.source)
    session.held = [] if progress.active else None
    return progress


def _parts(session: Session, selection: PartSelection) -> Iterator[Part]:
    """What is inside the window. Raises when there is no use in going on."""
    for part in selection.parts(session.batches()):
        yield part
        _go_on(session)
    _go_on(session)
    session.require(selection.problem)


def _scratch(output: str) -> str | None:
    """Where there is room for temporary files if there is room for the output; None leaves it to the system."""
    path = Path(output)
    if output == "-":
        return None
    return output if path.is_dir() else str(path.parent) if not path.exists() or path.is_file() else None


def _go_on(session: Session) -> None:
    """Raises `KeyboardInterrupt` after Ctrl-C: a part of a file is no export. A pipe ends with it."""
    if session.status == INTERRUPTED and not session.source.live:
        raise KeyboardInterrupt


def _account(session: Session, what: str, where: str) -> None:
    session.release()
    streams.tell(f"-- {what} written to {where}\n")
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

    return {
        "tailbyte.version": version(),
        "tailbyte.capture": session.source.name,
        "tailbyte.times": "UTC; in a capture without dates from an arbitrary start",
    }


def _usage(reason: str) -> int:
    streams.complain(reason, "tailbyte export")
    return USAGE
