"""`tailbyte events`: the flights of a capture, and what happened in them."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from typing import TYPE_CHECKING, Any

from analyzer.cli import status
from analyzer.cli.arguments import options
from analyzer.cli.arguments.autopilot import LogBeside, add_log
from analyzer.flight.kinds import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.app.run import Run
    from analyzer.app.statistics import RunStatistics
    from analyzer.stats.table import StatTable

NAME = "tailbyte events"
FORMS = ("text", "json", "jsonl", "csv")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE..."
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    parser.add_argument("-T", dest="form", choices=FORMS, default="text", help="default: text")
    parser.add_argument(
        "--kind", action="append", default=[], choices=KINDS, metavar="KIND",
        help="only events of this kind, such as fault or silence; repeatable; all of them: tailbyte help events",
    )  # fmt: skip
    add_log(parser)
    options.add_dialect(parser)
    options.add_filter(parser)
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read the capture once and print its flights and events."""
    try:
        beside = LogBeside(args)
        request = options.request(args)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    from analyzer.app.statistics import RunStatistics  # noqa: PLC0415
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.cli.reading import reading, watched  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415

    complaints = Complaints()
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            found = RunStatistics(run, ["flights", "events"], autopilot=beside.read())
        except (LookupError, OSError, ValueError) as error:
            return status.usage(error, NAME)
        with watched(run.source, complaints) as progress:
            for _ in progress.over(found.over(run.inside())):
                pass
        if run.state == "refused":
            return status.USAGE
        if run.stopped:
            complaints("interrupted: these are of what was read until then")
        found.conclude()
        with paged(wanted=not args.no_pager) as out:
            for text in _texts(run, found, args):
                out.write(text)
        beside.conclude(found.autopilot)
    return beside.status(status.of_run(run))


def _texts(run: Run, found: RunStatistics, args: argparse.Namespace) -> Iterator[str]:
    from analyzer.views.stats.machine import render_csv  # noqa: PLC0415
    from analyzer.views.stats.story import EventStory  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415
    from dissectors.records import replace  # noqa: PLC0415

    flights, events = found.tables()
    if args.kind:
        place = events.names.index("kind")
        events = replace(events, rows=[row for row in events.rows if row[place] in args.kind])
    if args.form == "json":
        both: dict[str, Any] = {"flights": list(_flights(flights)), "events": list(_events(events))}
        if found.autopilot is not None:
            both["autopilot"] = found.autopilot
        yield json.dumps({**found.head().plain(), **both, "notes": [*flights.notes, *events.notes]}, indent=2) + "\n"
    elif args.form == "jsonl":
        yield from (json.dumps(event) + "\n" for event in _events(events))
    elif args.form == "csv":
        yield from render_csv([events])
    else:
        width = shutil.get_terminal_size((80, 0)).columns if sys.stdout.isatty() else 80
        story = EventStory(width, found.start, buses=len(run.engine.buses), palette=Palette(options.colour(args)))
        yield from (f"{line}\n" for line in found.head().lines())
        yield from (f"{line}\n" for line in ("", *story.flights(flights), "", *story.events(events)))


def _flights(table: StatTable) -> Iterator[Mapping[str, Any]]:
    """Yield flights for programs; channels are numbers."""
    for one in table.records():
        yield {**one, "chs": [int(ch) for ch in one["chs"].split(",") if ch]}


def _events(table: StatTable) -> Iterator[Mapping[str, Any]]:
    """Yield events for programs; nodes and channels are numbers, None for nobody."""
    for one in table.records():
        numbers = {name: None if one[name] is None else int(one[name]) for name in ("node", "ch")}
        yield {**one, **numbers, "values": json.loads(one["values"])}
