"""`tailbyte view`: captures to look through: the list, the details and the bytes, filters by a key, marks, findings.

Nothing is written beside the capture but `CAPTURE.marks.toml`, once something is marked. Decoded tables lie in a
temporary folder until the end (TMPDIR says where): up to three times the size of the capture. A bus (can0) is that of
`tailbyte live --view`, which records and judges it, too.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from contextlib import suppress

from analyzer.app.process import streams
from analyzer.cli import status
from analyzer.cli.arguments import options

NAME = "tailbyte view"
_SIGNAL = 128  # and its number: what ended the browser
_TIMES = ("a", "ad", "d", "dd", "e", "r", "u", "ud")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE..."
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    show = parser.add_argument_group("what to show")
    show.add_argument("--at", metavar="FRAME|TIME", default="", help="begin there: 4711, 12.5 or 12:49:54.89")
    show.add_argument(
        "-t", dest="time", choices=_TIMES, default="r", metavar="a|ad|d|dd|e|r|u|ud", help="times, as decode has them"
    )
    show.add_argument(
        "-e", dest="fields", action="append", default=[], metavar="FIELD",
        help="a column beside the usual ones; repeatable; default: those of the last time",
    )  # fmt: skip
    show.add_argument("--colours", "--colors", metavar="FILE", help="colour rules of rows, or `off`; default: yours")
    show.add_argument("--follow", action="store_true", help="show at once what comes; wait at the end of a file")
    show.add_argument("--no-marks", action="store_true", help="neither read nor keep marks beside the capture")
    options.add_dialect(parser)
    options.add_filter(parser)
    options.add_window(parser)
    parser.set_defaults(run=run)


_BUS = re.compile(r"v?can\d+|(?!\w:[\\\\/])\w{3,}:\S*")


def run(args: argparse.Namespace) -> int:
    """Show the captures, or a bus, until the user quits."""
    names = [*args.capture, *args.capture_]
    if names and all(_BUS.fullmatch(name) and not os.path.lexists(name) for name in names):
        return _bus(args, names)
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415

    plain_arrow()
    from analyzer.app.browse.session import BrowseOptions, browse  # noqa: PLC0415 - behind that
    from analyzer.sources import CaptureError  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError, load  # noqa: PLC0415

    try:
        request = options.request(args)
        if args.at:
            _check_place(args.at)
        registry = load(request.dissectors, request.trusted)
        rules = _colours(args, registry)
        _check(args, registry)
    except (argparse.ArgumentTypeError, DsdlError, ProfileError, LookupError, OSError, ValueError) as error:
        return status.usage(error, NAME)
    if "-" in names:
        _keys_beside_pipe()
    if reason := _no_terminal():
        return status.usage(reason, NAME)
    asked = BrowseOptions(args.at, args.filter or "", args.time, tuple(args.fields), not args.no_marks)
    try:
        code, notes, failed, refused = browse(request, asked, rules)
    except (LookupError, ValueError) as error:
        return status.usage(error, NAME)
    except (CaptureError, OSError) as error:
        return status.damaged(error, NAME)
    for note in notes:
        streams.complain(note)
    ended = status.USAGE if refused else status.DAMAGED if code or failed else status.OK
    return code if code > _SIGNAL else ended


def _bus(args: argparse.Namespace, names: list[str]) -> int:
    """Show a bus, which is a matter of another command."""
    from analyzer.cli import main  # noqa: PLC0415

    chosen = [] if args.filter is None else ["-Y", args.filter]
    return main(["live", "--view", "-t", args.time, *chosen, *names])


def _colours(args: argparse.Namespace, registry: object) -> list:  # type: ignore[type-arg]
    from analyzer.views.colours.rules import colour_rules  # noqa: PLC0415

    return [] if os.environ.get("NO_COLOR") else colour_rules(args.colours, registry)  # type: ignore[arg-type]


def _check(args: argparse.Namespace, registry: object) -> None:
    """Raise what is wrong with a filter or a column before anything is read."""
    from analyzer.filter.compiled import compile_filter  # noqa: PLC0415
    from analyzer.views.fields import Fields  # noqa: PLC0415

    if args.filter:
        compile_filter(args.filter, registry)  # type: ignore[arg-type]
    if args.fields:
        Fields(registry, args.fields, lambda _: None)  # type: ignore[arg-type]


def _check_place(text: str) -> None:
    """Raise `ValueError` for what is no frame and no time."""
    from analyzer.window.limits import Moment  # noqa: PLC0415

    if not re.fullmatch(r"#?\d+|\d{1,3}(\.\d+)? ?%", text):
        try:
            Moment.parse(text)
        except ValueError as error:
            raise ValueError(f"--at: {error}") from None


def _keys_beside_pipe() -> None:
    """Take keys from the terminal itself where the capture comes in place of them."""
    if sys.__stdin__ is not None and not sys.__stdin__.isatty():
        with suppress(OSError):
            sys.__stdin__ = open("/dev/tty", encoding="ascii")  # type: ignore[misc]  # noqa: PTH123, SIM115


def _no_terminal() -> str:
    """Return why the browser cannot be shown here, empty if it can."""
    instead = "tailbyte decode lists the same: -V details, -x bytes, -Y a filter"
    if os.environ.get("TERM", "") in ("", "dumb", "unknown"):
        return f"this terminal (TERM={os.environ.get('TERM', '')}) cannot move its cursor: {instead}"
    streams = (sys.__stdin__, sys.__stdout__, sys.__stderr__)
    if not all(stream is not None and stream.isatty() for stream in streams):
        return f"the browser needs a terminal for keys and for the picture: {instead}"
    return ""
