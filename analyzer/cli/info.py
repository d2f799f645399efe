"""`tailbyte info`: what a capture holds, who speaks on it, and what it can and cannot show."""

from __future__ import annotations

import argparse
import shutil
import sys

from analyzer.cli import status
from analyzer.cli.arguments import options

NAME = "tailbyte info"


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE..."
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    options.add_window(parser)
    options.add_output(parser)
    parser.add_argument("-T", dest="form", choices=("text", "json"), default="text", help="default: text")
    parser.add_argument("--types", action="store_true", help="also the types that each node sends")
    parser.add_argument("--all", action="store_true", help="every node and identifier, however many")
    options.add_dialect(parser)
    options.add_filter(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read the capture once and print its summary, or that of the window alone."""
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import reading, watched  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415
    from analyzer.facts.summary import Summary  # noqa: PLC0415
    from analyzer.facts.traffic import ForeignIds  # noqa: PLC0415
    from analyzer.views.info import WIDTH, render, render_json  # noqa: PLC0415

    try:
        request = options.request(args)
    except argparse.ArgumentTypeError as error:
        return status.usage(error, NAME)
    complaints = Complaints()
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            options.choose(run)
        except (LookupError, OSError, ValueError) as error:
            return status.usage(error, NAME)
        for part in run.source.parts:
            part.hashed = True
        summary = Summary(run.registry, ForeignIds())
        with watched(run.source, complaints) as progress:
            for batch in progress.over(run.inside(alone=run.chosen is not None)):
                summary.feed(batch)
        if run.state == "refused":
            return status.USAGE
        facts = summary.finish(run.source.parts, run.engine)
        if args.form == "json":
            text = render_json(facts)
        else:
            width = max(WIDTH, shutil.get_terminal_size((WIDTH, 0)).columns if sys.stdout.isatty() else WIDTH)
            text = render(facts, everything=args.all, types=args.types, width=width)
        sys.stdout.write(text)
    return status.of_run(run)
