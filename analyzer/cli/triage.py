"""`tailbyte triage`, or the name of a capture alone: what happened, in one screen."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from typing import TYPE_CHECKING

from analyzer.app.targets import refuse_input
from analyzer.cli import reports, status
from analyzer.cli.arguments import options
from analyzer.cli.arguments.autopilot import LogBeside, add_log
from analyzer.report.triage.formats import FORMATS

if TYPE_CHECKING:
    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.flight.verdict.model import Triage

NAME = "tailbyte triage"
_EPILOG = """\
exit status: 0 done, whatever it found, 2 wrong usage, 3 capture unreadable or damaged (what was readable has been
looked at) or output not writable, 4 nothing to judge in it, 130 interrupted."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE...\n       tailbyte CAPTURE..."
    parser.description = __doc__
    parser.epilog = _EPILOG
    options.add_reader(parser)
    options.add_threads(parser)
    parser.add_argument("--story", action="store_true", help="every event in order, instead of the screen")
    add_log(parser)
    options.add_dialect(parser)
    reports.add(parser, forms=FORMATS, everything="what does not fit on a screen")
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run, filter=None, follow=False)


def run(args: argparse.Namespace) -> int:
    """Read the captures once and say what happened."""
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    try:
        beside = LogBeside(args)
        request = options.request(args)
        files = list(reports.files(args, FORMATS))
        for _, path in files:
            refuse_input(request.names, path)
        with ExitStack() as stack:
            return _answer(request, reports.opened(files, stack), beside, args)
    except (argparse.ArgumentTypeError, LookupError, ValueError) as error:
        return status.usage(error, NAME)
    except TargetError as error:
        return status.damaged(error)


def _answer(
    request: Request, targets: list[reports.Opened], beside: LogBeside, args: argparse.Namespace
) -> int:  # fmt: skip
    from analyzer.app.triage import RunTriage  # noqa: PLC0415
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import reading, watched  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415

    complaints, found = Complaints(), None
    with reading(request, complaints) as run:
        checked(request.rules.readings(), run.registry)
        triage = RunTriage(run, beside.read(), drawn=any(form == "html" for form, *_ in targets))
        with watched(run.source, complaints) as progress:
            for _ in progress.over(triage.over(run.inside())):
                pass
        if run.state == "refused":
            raise SystemExit(status.USAGE)  # no report is left, not even an empty one
        if run.stopped:
            complaints("interrupted: this is of what was read until then")
        found = triage.found()
    if found is None:  # it could not be opened, and that has been said
        raise SystemExit(status.of_run(run))
    written = reports.all_written(targets, found, everything=args.all, forms=FORMATS)
    if not any(target.name == "standard output" for _, target, _ in targets):
        _tell(found, args)
    beside.conclude(found.autopilot)
    return beside.status(_status(run, found, written=written))


def _status(run: Run, found: Triage, *, written: bool) -> int:
    ended = status.of_run(run)
    if ended == status.OK and not written:
        return status.DAMAGED
    return status.NOT_JUDGED if ended == status.OK and found.empty else ended


def _tell(found: Triage, args: argparse.Namespace) -> None:
    from analyzer.report.triage.text import render  # noqa: PLC0415

    reports.tell_text(lambda **shape: render(found, story=args.story, **shape), reports.show_options(args))
