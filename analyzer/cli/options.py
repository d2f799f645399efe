"""Options that several commands share, and what they mean."""

from __future__ import annotations

import argparse
import os
import re
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.window import Window
    from dissectors import Registry


def add_reader(parser: argparse.ArgumentParser) -> None:
    """The capture and the data types to read it with."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("capture", nargs="?", metavar="CAPTURE", help="candump text, gzip or not; - is standard input")
    where.add_argument("-r", dest="capture_", metavar="CAPTURE", help="the same, by letter")
    parser.add_argument(
        "--dissector", action="append", default=[], metavar="DIR",
        help="folder with further data types (DSDL, profile.toml); repeatable, comes before the built-in ones",
    )  # fmt: skip


def add_output(parser: argparse.ArgumentParser) -> None:
    """How results reach a terminal."""
    parser.add_argument("--color", choices=("auto", "always", "never"), default="auto", help="default: auto")
    parser.add_argument("--no-pager", action="store_true", help="do not page long output on a terminal")


def add_window(parser: argparse.ArgumentParser) -> None:
    """Which part of the capture to show."""
    group = parser.add_argument_group(
        "window", "TIME: seconds from the first frame, seconds since 1970, 12:49:54.89 or 2026-03-14T12:49:54 (local)"
    )
    group.add_argument("--from", dest="start", metavar="TIME", help="from this time on")
    group.add_argument("--to", dest="stop", metavar="TIME", help="up to this time")
    group.add_argument("--last", metavar="10s", help="the last part of the capture")
    group.add_argument("--around", metavar="FRAME|TIME[+-1s]", help="near a frame or a time (with . or :)")
    group.add_argument("--frames", metavar="A-B", help="frame numbers A to B, from 1; either may be left out")


def window(args: argparse.Namespace) -> Window:
    """The window asked for. Raises `argparse.ArgumentTypeError` with the option and the reason."""
    from analyzer.window import AROUND, Moment, Window, duration  # noqa: PLC0415

    around, margin = None, AROUND
    if args.around is not None:
        where, sign, width = args.around.replace("+-", "±").partition("±")
        margin = _checked("--around", duration, width) if sign else AROUND
        around = _whole(where) if where.strip().isdecimal() else _checked("--around", Moment.parse, where)
        if around == 0:
            raise argparse.ArgumentTypeError("--around: frame numbers start at 1")
    return Window(
        start=_checked("--from", Moment.parse, args.start),
        stop=_checked("--to", Moment.parse, args.stop),
        last=_checked("--last", duration, args.last),
        around=around,
        margin=margin,
        frames=_checked("--frames", _range, args.frames),
    )


def _checked(option: str, read: Callable[[str], Any], text: str | None) -> Any:
    try:
        return None if text is None else read(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{option}: {error}") from None


def _range(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d*)(-?)(\d*)", text.strip())
    if match is None or not (match[1] or match[3]):
        raise ValueError(f"{text!r} is not a range of frame numbers (100-200, 100-, -200, 100)")
    first = _whole(match[1] or "1")
    last = _whole(match[3]) if match[3] else (sys.maxsize if match[2] else first)
    if first < 1:
        raise ValueError("frame numbers start at 1")
    if first > last:
        raise ValueError(f"{text!r} ends before it starts")
    return first, last


def positive(text: str) -> int:
    """A count of at least 1."""
    if not text.isdecimal() or _whole(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of at least 1")
    return _whole(text)


def _whole(digits: str) -> int:
    """A number as large as anybody can count frames, however many digits it is given with."""
    digits = digits.strip().lstrip("0") or "0"
    return min(int(digits[:20]), sys.maxsize)


def dialect(text: str) -> tuple[int, str]:
    """`24=tm` as node ID and choice."""
    node, equals, choice = text.partition("=")
    if not equals or not choice or not node.isdecimal() or not 1 <= int(node) <= 127:
        raise argparse.ArgumentTypeError(f"{text!r} is not NODE=CHOICE with a node ID from 1 to 127")
    return int(node), choice


def capture_name(args: argparse.Namespace) -> str:
    """The capture, given either way."""
    return args.capture if args.capture is not None else str(args.capture_)


def registry(args: argparse.Namespace) -> Registry:
    """The data types to decode with. Raises `DsdlError` or `ProfileError` for a broken folder."""
    from pathlib import Path  # noqa: PLC0415

    import dissectors  # noqa: PLC0415

    return dissectors.load([Path(folder) for folder in args.dissector])


def colour(args: argparse.Namespace) -> bool:
    """Whether to colour; `auto` asks the terminal and NO_COLOR."""
    if args.color == "auto":
        return sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return bool(args.color == "always")
