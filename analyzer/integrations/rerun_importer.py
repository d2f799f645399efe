"""`rerun capture.log`: the viewer asks every program called `rerun-importer-*` what it makes of a file.

What is no capture is answered at once, with the exit status that says so, and nothing on standard output.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from analyzer.app.process import streams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rerun.chunk import Chunk

    from analyzer.app.run import RunState

# What the viewer is told: no capture, and how the reading of one has ended.
NOT_OURS = 66
_STATUSES: dict[RunState, int] = {"whole": 0, "damaged": 0, "refused": 2, "interrupted": 130}
_HEAD = 1 << 16
# What formats with weak marks have to say, too, before a reader is asked that takes its time.
_SIGNS = {"Vector ASC": b"base ", "python-can CSV": b"arbitration_id"}
_PIECES = 4  # of a capture, at most, that are read to see what it is


@dataclass(frozen=True, slots=True)
class _Asked:
    """The viewer's wishes, as its documentation names them."""

    file: str
    application_id: str | None
    recording_id: str | None
    opened_recording_id: str | None
    entity_path_prefix: str


def main(argv: Sequence[str] | None = None) -> int:
    """Write the recording of the file to standard output; return the exit status for the viewer."""
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
    from analyzer.app.process.start import alone, plain_arrow  # noqa: PLC0415

    try:
        if argv is None:  # nobody else uses this process
            alone()
        plain_arrow()
        return _import(_Asked(**vars(args)))
    except BrokenPipeError:  # the viewer has enough
        return 0
    except KeyboardInterrupt:
        return 130


def is_capture(path: str) -> bool:
    """Return whether more of the file can be read as frames than not. Recordings in MCAP are the viewer's own."""
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


def _import(asked: _Asked) -> int:
    from analyzer.plot import LOG_LEVEL  # noqa: PLC0415

    os.environ.setdefault(LOG_LEVEL, "off")
    streams.prepare()

    from analyzer.app.drawing import Drawing, name  # noqa: PLC0415
    from analyzer.app.process.interrupt import graceful  # noqa: PLC0415
    from analyzer.app.request import Request  # noqa: PLC0415
    from analyzer.app.run import Run  # noqa: PLC0415
    from analyzer.plot.output import APPLICATION, FileOutput  # noqa: PLC0415 - Rerun takes its time
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    prefix = "/" + asked.entity_path_prefix.strip("/") if asked.entity_path_prefix.strip("/") else ""
    shown = prefix or (asked.opened_recording_id and asked.opened_recording_id == asked.recording_id)
    request = Request((os.path.abspath(asked.file),))  # noqa: PTH100 - so that - is a file, too
    run = Run(request, streams.complain)
    with graceful(lambda: run), run, Target("-") as target:
        where = asked.application_id or APPLICATION
        with FileOutput(target.file, name(request), asked.recording_id, application=where) as output:

            def send(chunks: Sequence[Chunk]) -> None:
                output.send([_below(prefix, chunk) for chunk in chunks] if prefix else chunks)

            drawing = Drawing(run)
            drawing.start()
            picture = drawing.draw(send)
            drawing.finish(picture)
            if not shown:
                output.layout(picture.layout())
    return _STATUSES[run.state]


def _below(prefix: str, chunk: Chunk) -> Chunk:
    """Return a chunk at a path below `prefix`; what it says of the whole recording stays where it is."""
    path = chunk.entity_path
    return chunk if path.startswith("/__") else chunk.with_entity_path(prefix + path)


if __name__ == "__main__":
    sys.exit(main())
