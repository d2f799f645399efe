"""`tailbyte convert`: captures as candump text, MCAP or pcapng, whole or cut, and what the new format cannot hold."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.app.targets import capture_form, refuse_input
from analyzer.cli import status
from analyzer.cli.arguments import options
from analyzer.sinks import FORMS, losses

if TYPE_CHECKING:
    from analyzer.app.marked import MarkedFrames
    from analyzer.app.run import Run
    from analyzer.cli.complaints import Complaints

NAME = "tailbyte convert"


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE... OUT"
    parser.description = __doc__
    options.add_captures(parser)
    options.add_threads(parser)
    parser.add_argument(
        "-o", "-w", dest="output", metavar="OUT", help="the output, else the last argument; - is standard output"
    )
    options.add_capture_form(parser)
    options.add_filter(parser)
    options.add_dissectors(parser)
    options.add_window(parser)
    parser.set_defaults(run=run)


@dataclass(frozen=True, slots=True)
class _Output:
    """The capture that is written."""

    path: str
    form: str
    packing: str
    compression: str


def run(args: argparse.Namespace) -> int:
    """Read the captures once and write them anew; the output is there whole or not at all."""
    from analyzer.app.marked import MarkedFrames  # noqa: PLC0415
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import reading  # noqa: PLC0415
    from analyzer.facts.frame_marks import comments_beside  # noqa: PLC0415

    try:
        if args.output is None:
            args.output = args.capture.pop() if args.capture else ""
        output = _output(args)
        request = options.request(args, NAME)
        refuse_input(request.names, output.path)
        comments = comments_beside(request.names)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    complaints = Complaints()
    with reading(request, complaints) as run:
        try:
            options.choose(run)
        except (LookupError, OSError, ValueError) as error:
            return status.usage(error, NAME)
        _convert(run, output, complaints, MarkedFrames(comments))
    return status.of_run(run)


def _output(args: argparse.Namespace) -> _Output:
    """Return what is to be written. Raises `ValueError` for arguments that do not go together."""
    if args.stop in FORMS:
        raise ValueError(f"--to is a time: did you mean -F {args.stop}?")
    if not args.capture and not args.capture_:
        raise ValueError("a capture and an output are needed: tailbyte convert CAPTURE OUT")
    form, packing = capture_form(args.output, args.form, args.compression)
    return _Output(args.output, form, packing, args.compression or "zstd")


def _convert(run: Run, output: _Output, complaints: Complaints, marked: MarkedFrames) -> None:
    from analyzer.cli.reading import lines_of, watched  # noqa: PLC0415
    from analyzer.sinks import open_sink  # noqa: PLC0415
    from analyzer.sinks.atomic import Target  # noqa: PLC0415
    from analyzer.sinks.packed import packed  # noqa: PLC0415
    from analyzer.views.terminal import escape  # noqa: PLC0415

    inside = frames = errors = 0
    shown = output.path == "-" and sys.stdout.isatty()
    with Target(output.path) as target, packed(target.file, output.packing) as file:
        with watched(run.source, complaints, wanted=not shown) as progress:
            sink = open_sink(output.form, file, compression=output.compression)
            for batch in progress.over(run.ahead(run.frame_batches_inside(over=marked.over))):
                inside += sum(batch.lines[kind] for kind in ("frames", "error_frames", "drops", "comments"))
                frames += batch.frames
                errors += batch.lines["error_frames"]
                sink.write(batch, marked.rows(batch))
                run.go_on()
        run.require_inside(inside)
        sink.close()
        run.go_on()
    outside = run.totals.lines["frames"] - frames
    beside = f" and {errors} error frame{'s' * (errors > 1)}" if errors and outside else ""
    streams.tell(
        f"-- {sink.frames} frames{beside} written to {escape(target.name)}"
        + (f", {outside} {'do not match' if run.chosen is not None else 'outside the window'}" if outside else "")
        + f"; {lines_of(run)}\n"
    )
    if lost := losses(sink.lost):
        streams.tell(f"-- {output.form} cannot hold: {lost}\n")
