"""`rerun capture.log`: the viewer asks every program called `rerun-importer-*` what it makes of a file.

What is no capture is answered at once, with the exit status that says so, and nothing on standard output.
"""

from __future__ import annotations

import argparse
import os
import sys
from itertools import islice
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rerun.chunk import Chunk

NOT_OURS = 66
_HEAD = 1 << 16
# What formats with weak marks have to say, too, before a reader is asked that takes its time.
_SIGNS = {"Vector ASC": b"base ", "python-can CSV": b"arbitration_id"}
_PIECES = 4  # of a capture, at most, that are read to see what it is


def main(argv: Sequence[str] | None = None) -> int:
    """Writes the recording of the file to standard output; the exit status for the viewer."""
    parser = argparse.ArgumentParser(
        prog="rerun-importer-tailbyte", description=__doc__, epilog="Other options of the viewer are taken and ignored."
    )
    parser.add_argument("file")
    parser.add_argument("--application-id", help="of the recording")
    parser.add_argument("--recording-id", help="of the recording")
    parser.add_argument(
        "--opened-recording-id", help="of the recording that the viewer shows: its layout is left alone"
    )
    parser.add_argument("--entity-path-prefix", default="", help="in front of every path; then without a layout")
    args, _ = parser.parse_known_args(argv)  # a capture has its own times: what the viewer says of time does not matter
    if not is_capture(args.file):
        return NOT_OURS
    from analyzer.cli.start import plain_arrow  # noqa: PLC0415

    try:
        if argv is None:  # nobody else uses this process
            plain_arrow()
        return _import(args)
    except BrokenPipeError:  # the viewer has enough
        return 0
    except KeyboardInterrupt:
        return 130


def is_capture(path: str) -> bool:
    """Whether it is a file of which more can be read as frames than not. Recordings in MCAP are the viewer's own."""
    from analyzer.sources import GZIP, ZSTD, CaptureError, Source  # noqa: PLC0415
    from analyzer.sources.formats import CANDUMP, detect  # noqa: PLC0415
    from analyzer.sources.native import rows  # noqa: PLC0415

    try:
        with open(path, "rb") as file:  # noqa: PTH123 - any path, as it was given
            head = file.read(_HEAD)
    except (OSError, ValueError):
        return False
    form = detect(head, path)
    if form.module is None or form.name == "MCAP" or _SIGNS.get(form.name, b"") not in head:
        return False
    plain = form is CANDUMP and not head.startswith((GZIP, ZSTD))
    if not head or (plain and (b"\0" in head or (len(head) == _HEAD and b"\n" not in head))):
        return False
    frames = others = 0
    try:
        for piece in islice(rows(Source(path).chunks()), _PIECES):
            if not isinstance(piece, bytes):
                frames += piece.frames
                others += piece.lines["unreadable"]
    except (CaptureError, OSError):
        return False
    return frames > others


def _import(asked: argparse.Namespace) -> int:
    from analyzer import cli  # noqa: PLC0415
    from analyzer.cli import streams  # noqa: PLC0415
    from analyzer.plot import LOG_LEVEL  # noqa: PLC0415

    os.environ.setdefault(LOG_LEVEL, "off")
    streams.prepare()
    args = cli.parser().parse_args(["plot", "-o", "-", "-r", os.path.abspath(asked.file)])  # noqa: PTH100 - so no name begins with a dash

    from analyzer.cli.plot_drawing import Drawing, name  # noqa: PLC0415
    from analyzer.cli.session import Session  # noqa: PLC0415
    from analyzer.plot.output import APPLICATION, FileOutput  # noqa: PLC0415 - Rerun takes its time
    from analyzer.sinks.atomic import Target  # noqa: PLC0415
    from analyzer.window import Window  # noqa: PLC0415

    prefix = "/" + asked.entity_path_prefix.strip("/") if asked.entity_path_prefix.strip("/") else ""
    shown = prefix or (asked.opened_recording_id and asked.opened_recording_id == asked.recording_id)
    with Session(args) as session, Target("-") as target:
        where = asked.application_id or APPLICATION
        with FileOutput(target.file, name(args), asked.recording_id, application=where) as output:

            def send(chunks: Sequence[Chunk]) -> None:
                output.send([_below(prefix, chunk) for chunk in chunks] if prefix else chunks)

            drawing = Drawing(args, session, Window())
            drawing.start()
            picture = drawing.draw(send)
            if not shown:
                output.layout(picture.layout())
    return 0 if session.status in {cli.OK, cli.DAMAGED} else session.status


def _below(prefix: str, chunk: Chunk) -> Chunk:
    """A chunk at a path below `prefix`; what it says of the whole recording stays where it is."""
    path = chunk.entity_path
    return chunk if path.startswith("/__") else chunk.with_entity_path(prefix + path)


if __name__ == "__main__":
    sys.exit(main())
