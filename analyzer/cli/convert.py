"""`tailbyte convert`: captures as candump text, MCAP or pcapng, whole or cut, and what the new format cannot hold."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from analyzer.cli import USAGE, options, streams
from analyzer.sinks import FORMS, losses

if TYPE_CHECKING:
    from analyzer.cli.session import Session
    from analyzer.window import Window


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser(
        "convert",
        help="captures as candump text, MCAP or pcapng",
        usage="%(prog)s [options] CAPTURE... OUT",
        description=__doc__,
    )
    options.add_captures(parser)
    parser.add_argument(
        "-o", "-w", dest="output", metavar="OUT", help="the output, else the last argument; - is standard output"
    )
    options.add_capture_form(parser)
    options.add_window(parser)
    parser.set_defaults(run=run, dissector=[])


def run(args: argparse.Namespace) -> int:
    """Reads the captures once and writes them anew; the output is there whole or not at all."""
    from analyzer.cli.session import Session  # noqa: PLC0415

    try:
        if args.output is None:
            args.output = args.capture.pop() if args.capture else ""
        form, packing = _form(args)
        window = options.window(args)
    except (argparse.ArgumentTypeError, ValueError) as error:
        streams.complain(str(error), "tailbyte convert")
        return USAGE
    with Session(args) as session:
        _convert(args, session, window, form, packing)
    return session.status


def _form(args: argparse.Namespace) -> tuple[str, str]:
    """Format and packing of the output. Raises `ValueError` for arguments that do not go together."""
    if args.stop in FORMS:
        raise ValueError(f"--to is a time: did you mean -F {args.stop}")
    if not args.capture and not args.capture_:
        raise ValueError("a capture and an output are needed: tailbyte convert CAPTURE OUT")
    found = options.capture_form(args)
    options.refuse_input(args, args.output)
    return found


def _convert(args: argparse.Namespace, session: Session, window: Window, form: str, packing: str) -> None:
    from analyzer.cli.progress import Progress  # noqa: PLC0415
    from analyzer.sinks import open_sink  # noqa: PLC0415
    from analyzer.sinks.atomic import Target  # noqa: PLC0415
    from analyzer.sinks.packed import packed  # noqa: PLC0415
    from analyzer.views.terminal import escape  # noqa: PLC0415

    inside = frames = 0
    shown = args.output == "-" and sys.stdout.isatty()
    with Target(args.output) as target, packed(target.file, packing) as file:
        with Progress(session.source, wanted=not shown) as progress:
            session.held = [] if progress.active else None
            sink = open_sink(form, file, compression=args.compression or "zstd")
            for piece in progress.over(session.pieces_inside(window)):
                inside += sum(piece.lines[kind] for kind in ("frames", "error_frames", "drops", "comments"))
                frames += piece.frames
                sink.write(piece)
                session.go_on()
        session.require_inside(inside, window)
        sink.close()
        session.go_on()
    session.release()
    outside = session.totals.lines["frames"] - frames
    streams.tell(
        f"-- {sink.frames} frames written to {escape(target.name)}"
        + (f", {outside} outside the window" if outside else "")
        + f"; {session.sum()}\n"
    )
    if lost := losses(sink.lost):
        streams.tell(f"-- {form} cannot hold: {lost}\n")
