"""`tailbyte info`: what a capture holds, who speaks on it, and what it can and cannot show."""

from __future__ import annotations

import argparse
import sys

from analyzer.cli import USAGE, options, streams


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser("info", help="summary of a capture: lines, nodes, types, rates", description=__doc__)
    options.add_reader(parser)
    options.add_window(parser)
    options.add_output(parser)
    parser.add_argument("-T", dest="form", choices=("text", "json"), default="text", help="default: text")
    parser.add_argument("--all", action="store_true", help="every node and identifier, however many")
    options.add_dialect(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Reads the capture once and prints its summary, or that of the window alone."""
    from analyzer.cli.session import Session  # noqa: PLC0415
    from analyzer.facts.summary import Summary  # noqa: PLC0415
    from analyzer.views.info import render, render_json  # noqa: PLC0415

    with Session(args) as session:
        try:
            window, dialects = options.window(args), options.dialects(args, session.registry)
        except (argparse.ArgumentTypeError, ValueError) as error:
            streams.complain(str(error), "tailbyte info")
            return USAGE
        for part in session.source.parts:
            part.hashed = True
        summary = Summary(session.registry, dialects)
        for batch in session.inside(window):
            summary.add(batch)
        if session.status == USAGE:
            return USAGE
        facts = summary.finish(session.source.parts, session.engine)
        text = render_json(facts) if args.form == "json" else render(facts, everything=args.all)
        sys.stdout.write(text)
    return session.status
