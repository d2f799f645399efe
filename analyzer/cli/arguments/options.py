"""Options that several commands share, and what they mean."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analyzer.app.process import streams
from analyzer.cli import status
from analyzer.cli.usage.numbers import flight_number, frame_range, whole
from analyzer.sinks import COMPRESSIONS, FORMS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.app.filtered.frames import MatchingFrames
    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.sources.merge import Plan
    from analyzer.window.limits import Window


class OldName(argparse.Action):
    """An option's old name: it still works, says so in one line, and is in no help."""

    def __init__(self, option_strings: Sequence[str], dest: str, *, new: str) -> None:
        super().__init__(option_strings, dest, help=argparse.SUPPRESS)
        self._new = new

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        """Take the value as that of the new name."""
        streams.complain(f"{option} is deprecated: the option is called {self._new} now", parser.prog)
        setattr(namespace, self.dest, values)


def add_reader(parser: argparse.ArgumentParser) -> None:
    """Add the captures, and the data types to read them with."""
    add_captures(parser)
    add_dissectors(parser)


def add_dissectors(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add the folders with further data types."""
    parser.add_argument(
        "--dissector", action="append", default=[], metavar="DIR",
        help="folder with further data types (DSDL, profile.toml); repeatable, comes before the built-in ones",
    )  # fmt: skip
    parser.add_argument(
        "--trust-dissector", action=_TrustedFolder, dest="trusted", default=[], metavar="DIR",
        help="the same, and the Python that the folder brings for its rules runs",
    )  # fmt: skip


class _TrustedFolder(argparse.Action):
    """Takes a folder among all folders, and among those that are trusted."""

    def __call__(
        self, _: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, __: str | None = None
    ) -> None:
        """Append it to both."""
        for name in ("dissector", self.dest):
            setattr(namespace, name, [*getattr(namespace, name), values])


def folders(args: argparse.Namespace) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Return the folders with further data types, and those among them that are trusted."""
    return tuple(map(Path, args.dissector)), tuple(map(Path, args.trusted))


def add_captures(parser: argparse.ArgumentParser) -> None:
    """Add the captures: files, patterns, standard input, and how several of them become one."""
    parser.add_argument(
        "capture", nargs="*", metavar="CAPTURE",
        help="candump text, MCAP, pcapng, pcap, ArduPilot or pydronecan log, BLF, ASC, TRC, CSV, MF4, packed or not; "
        "several are merged by time; - is standard input",
    )  # fmt: skip
    parser.add_argument(
        "-r", dest="capture_", action="append", default=[], metavar="CAPTURE", help="the same, by letter"
    )
    group = parser.add_argument_group("several captures")
    group.add_argument(
        "--bus", action="append", default=[], metavar="NAME=WHAT",
        help="name the bus of a capture, of an interface or of CAPTURE:INTERFACE; repeatable",
    )  # fmt: skip
    group.add_argument("--same-bus", action="store_true", help="all captures recorded one bus: drop what repeats")
    group.add_argument(
        "--offset", action="append", default=[], metavar="FILE=+1.5s",
        help="shift the times of a capture; otherwise found from frames that two captures saw; repeatable",
    )  # fmt: skip


def add_threads(parser: argparse.ArgumentParser) -> None:
    """Add how many threads may work."""
    from analyzer.app.process.threads import THREADS  # noqa: PLC0415

    parser.add_argument(
        "--threads", type=positive, default=THREADS, metavar="N",
        help="1: all in one thread; more (default): files are read and decoded ahead; the result is the same",
    )  # fmt: skip


def request(args: argparse.Namespace, who: str = "tailbyte") -> Request:
    """Return what the arguments ask of captures, of rules only how doubtful fields are read.

    Captures that cannot be meant end the command, as `who`. Raises `argparse.ArgumentTypeError` for a window that makes
    no sense.
    """
    from analyzer.app.request import Request, RuleChoice  # noqa: PLC0415
    from analyzer.window.limits import Window  # noqa: PLC0415

    try:
        names, who = captures(args), "tailbyte"
        merging = _merging(args)
    except argparse.ArgumentTypeError as error:
        raise SystemExit(status.usage(error, who)) from None
    asked = window(args) if "around" in args else Window()
    return Request(
        captures=tuple(names),
        merging=merging,
        dissectors=folders(args)[0],
        trusted=folders(args)[1],
        window=asked,
        rules=RuleChoice(dialects=tuple(getattr(args, "dialect", ())), vehicle=getattr(args, "vehicle", None)),
        follow=getattr(args, "follow", False),
        threads=getattr(args, "threads", 1),
        window_words=tuple(_window_words(args)),
        arguments=tuple(_arguments(args)),
        filter=getattr(args, "filter", None),
        frame_list=getattr(args, "frame_list", False),
        wireshark=getattr(args, "number", None) == "wireshark",
        flight=checked("--flight", flight_number, getattr(args, "flight", None)),
    )


def _arguments(args: argparse.Namespace) -> Iterator[str]:
    """Yield what beside the captures' names reads them in the same way."""
    if args.same_bus:
        yield "--same-bus"
    for option, given in (("--bus", args.bus), ("--offset", args.offset), ("--dissector", args.dissector)):
        for value in given:
            trusted = option == "--dissector" and value in args.trusted
            yield from ("--trust-dissector" if trusted else option, value)


def captures(args: argparse.Namespace) -> list[str]:
    """Return the captures given either way, patterns resolved.

    Raises `argparse.ArgumentTypeError` for those that clash.
    """
    from glob import glob  # noqa: PLC0415

    names: list[str] = []
    if "" in (*args.capture, *args.capture_):
        raise argparse.ArgumentTypeError("a capture without a name (an empty variable of the shell?)")
    for given in (*args.capture, *args.capture_):
        exists = given == "-" or "\0" in given or os.path.lexists(given)
        names += [given] if exists else sorted(glob(given)) or [given]  # noqa: PTH207 - any pattern, absolute or not
    if names.count("-") > 1:
        raise argparse.ArgumentTypeError("standard input can be read only once")
    if len(names) > 1 and getattr(args, "follow", False):
        raise argparse.ArgumentTypeError("--follow takes one capture")
    return names


def _merging(args: argparse.Namespace) -> Plan:
    """Return how several captures become one. Raises `argparse.ArgumentTypeError` with the option and the reason."""
    from analyzer.sources.merge import Plan, bus_name  # noqa: PLC0415

    names = dict(checked("--bus", bus_name, text) for text in args.bus)
    offsets = dict(checked("--offset", _offset, text) for text in args.offset)
    return Plan(names, offsets, args.same_bus)


def _offset(text: str) -> tuple[str, int]:
    from analyzer.window.limits import duration  # noqa: PLC0415

    name, equals, shift = text.rpartition("=")
    sign, size = (shift[:1], shift[1:]) if shift[:1] in "+-" else ("+", shift)
    if not equals or not name:
        raise ValueError(f"{text!r} is not FILE=+1.5s")
    return name, int(sign + "1") * duration(size)


def add_colour(parser: argparse.ArgumentParser) -> None:
    """Add the choice of colours."""
    parser.add_argument("--color", choices=("auto", "always", "never"), default="auto", help="default: auto")


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add how results reach a terminal."""
    add_colour(parser)
    parser.add_argument("--no-pager", action="store_true", help="do not page long output on a terminal")


def add_capture_form(parser: argparse._ActionsContainer, name: str = "form") -> None:
    """Add the format of a capture that is written, in the attribute `name`."""
    parser.add_argument(
        "-F", "--format", dest=name, choices=FORMS,
        help="default: what the name says: .log .txt .candump, .mcap, .pcapng, with .gz or .zst behind it",
    )  # fmt: skip
    parser.add_argument("--compression", choices=COMPRESSIONS, help="of MCAP chunks; default: zstd")


def add_filter(parser: argparse.ArgumentParser) -> None:
    """Add the choice of rows by a filter."""
    parser.add_argument(
        "-Y", "--display-filter", dest="filter", metavar="FILTER",
        help="only rows that it holds for, such as 'dronecan.src == 12': see tailbyte help filter, fields",
    )  # fmt: skip
    if "--vehicle" not in parser._option_string_actions:  # noqa: SLF001 - argparse does not tell otherwise
        parser.add_argument("--vehicle", metavar="FILE.toml", help="labels of nodes for filters, and rules of its own")


def choose(run: Run) -> MatchingFrames | None:
    """Hold what a run copies or decodes to what its filter selects, and return that; None without a filter.

    The captures are read for it. Raises what is wrong with the filter.
    """
    if run.request.filter is None:
        return None
    from analyzer.app.filtered.frames import matching_frames  # noqa: PLC0415 - few commands have a filter

    found = matching_frames(run)
    if found is not None:
        found.hold(run)
    return found


def add_window(parser: argparse.ArgumentParser) -> None:
    """Add the choice of a part of the capture."""
    group = parser.add_argument_group(
        "window", "TIME: seconds from the first frame, seconds since 1970, 12:49:54.89 or 2026-03-14T12:49:54 (local)"
    )
    group.add_argument("--from", dest="start", metavar="TIME", help="from this time on")
    group.add_argument("--to", dest="stop", metavar="TIME", help="up to this time")
    group.add_argument("--last", metavar="10s", help="the last part of the capture")
    group.add_argument("--around", metavar="FRAME|TIME[+-1s]", help="near a frame or a time (with . or :)")
    group.add_argument("--frames", metavar="A-B", help="frame numbers A to B, from 1; either may be left out")
    group.add_argument("--flight", metavar="N|last", help="a flight that `events` lists; files are read twice for it")


def window(args: argparse.Namespace) -> Window:
    """Return the window asked for. Raises `argparse.ArgumentTypeError` with the option and the reason."""
    from analyzer.window.limits import AROUND, Moment, Window, duration  # noqa: PLC0415

    around, margin = None, AROUND
    if args.around is not None:
        where, sign, width = args.around.replace("+-", "±").partition("±")
        margin = checked("--around", duration, width) if sign else AROUND
        around = whole(where) if where.strip().isdecimal() else checked("--around", Moment.parse, where)
        if around == 0:
            raise argparse.ArgumentTypeError("--around: frame numbers start at 1")
    first, last = _option(args, "start"), _option(args, "stop")
    start, stop = checked(first, Moment.parse, args.start), checked(last, Moment.parse, args.stop)
    if start is not None and stop is not None and start.kind == stop.kind != "of day" and start.ns > stop.ns:
        raise argparse.ArgumentTypeError(f"{first} {args.start} is after {last} {args.stop}")
    return Window(
        start=start,
        stop=stop,
        last=checked("--last", duration, args.last),
        around=around,
        margin=margin,
        frames=checked("--frames", frame_range, args.frames),
    )


def _option(args: argparse.Namespace, dest: str) -> str:
    """Return the option that set a limit: a command with several captures may have one for each, in `limits`."""
    named: dict[str, str] = {"start": "--from", "stop": "--to", **getattr(args, "limits", {})}
    return named[dest]


def _window_words(args: argparse.Namespace) -> Iterator[str]:
    """Return the window as it was asked for."""
    given = {
        _option(args, "start"): getattr(args, "start", None),
        _option(args, "stop"): getattr(args, "stop", None),
        "--last": getattr(args, "last", None),
        "--around": getattr(args, "around", None),
        "--frames": getattr(args, "frames", None),
        "--flight": getattr(args, "flight", None),
    }
    return (f"{option} {text}" for option, text in given.items() if text is not None)


def checked(option: str, read: Callable[[str], Any], text: str | None) -> Any:
    """Return what `read` makes of the text of an option, None of none.

    Raises `argparse.ArgumentTypeError` with its reason.
    """
    try:
        return None if text is None else read(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{option}: {error}") from None


def positive(text: str) -> int:
    """Return a count of at least 1."""
    if not text.isdecimal() or whole(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of at least 1")
    return whole(text)


def add_dialect(parser: argparse._ActionsContainer) -> None:
    """Add the readings of doubtful fields that stand against the data."""
    parser.add_argument(
        "--dialect", action="append", default=[], type=dialect, metavar="NODE=CHOICE",
        help="how to read a node's doubtful fields, against its own data (24=tm, 24=dronecan, 24=K); repeatable",
    )  # fmt: skip


def dialect(text: str) -> tuple[int, str]:
    """Return `24=tm` as node ID and choice."""
    node, equals, choice = text.partition("=")
    if not equals or not choice or not node.isdecimal() or not 1 <= int(node) <= 127:
        raise argparse.ArgumentTypeError(f"{text!r} is not NODE=CHOICE with a node ID from 1 to 127")
    return int(node), choice


def colour(args: argparse.Namespace) -> bool:
    """Return whether to colour; `auto` asks the terminal and NO_COLOR."""
    if args.color == "auto":
        return sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return bool(args.color == "always")
