"""Options that several commands share, and what they mean."""

from __future__ import annotations

import argparse
import os
import re
import stat
import sys
from typing import TYPE_CHECKING, Any

from analyzer.sinks import COMPRESSIONS, FORMS, form_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from analyzer.live.filters import Filters
    from analyzer.live.interfaces import Interface
    from analyzer.sources.merge import Plan
    from analyzer.window import Window
    from dissectors import Registry


def add_reader(parser: argparse.ArgumentParser) -> None:
    """The captures, and the data types to read them with."""
    add_captures(parser)
    parser.add_argument(
        "--dissector", action="append", default=[], metavar="DIR",
        help="folder with further data types (DSDL, profile.toml); repeatable, comes before the built-in ones",
    )  # fmt: skip


def add_captures(parser: argparse.ArgumentParser) -> None:
    """The captures: files, patterns, standard input, and how several of them become one."""
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


def add_bus(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """The bus that exists, with the options of python-can."""
    parser.add_argument(
        "iface", nargs="?", metavar="IFACE",
        help="a SocketCAN interface (vcan0), or TYPE:CHANNEL[@BITRATE] for those of python-can (virtual:demo, "
        "slcan:/dev/ttyACM0@1000000)",
    )  # fmt: skip
    parser.add_argument("-i", dest="iface_", metavar="IFACE", help="the same, by letter")
    return add_python_can(parser)


def add_buses(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Several buses that exist, with the options of python-can."""
    parser.add_argument(
        "iface", nargs="*", metavar="IFACE[,FILTER]",
        help="a SocketCAN interface (can0), or TYPE:CHANNEL[@BITRATE] for those of python-can (virtual:demo, "
        "slcan:/dev/ttyACM0@1000000); with filters as candump has them: can0,123:7FF; default: what python-can's files "
        "and environment name",
    )  # fmt: skip
    parser.add_argument(
        "-i", dest="iface_", action="append", default=[], metavar="IFACE", help="the same, by letter; repeatable"
    )
    return add_python_can(parser)


def add_python_can(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """The options of python-can for the buses of a command."""
    group = parser.add_argument_group("bus, as python-can has it")
    group.add_argument("--interface", metavar="TYPE", help="socketcan, virtual, slcan, pcan, ...")
    group.add_argument("--channel", metavar="CHANNEL", help="of that interface")
    group.add_argument("--bitrate", type=positive, metavar="BITS", help="per second")
    group.add_argument("--data-bitrate", type=positive, metavar="BITS", help="of the data phase of CAN FD")
    group.add_argument("--fd", action="store_true", default=None, help="with CAN FD")
    group.add_argument("--timing", nargs="+", metavar="KEY=VALUE", help="bit timing instead of bit rates")
    group.add_argument("--bus-kwargs", nargs="+", default=(), metavar="KEY=VALUE", help="whatever else it takes")
    return group


def bus(args: argparse.Namespace) -> Interface | None:
    """The bus that is meant, None if none was named. Raises `ValueError` with the reason."""
    from analyzer.live.interfaces import resolve  # noqa: PLC0415 - python-can takes its time

    text = args.iface or args.iface_
    if args.iface and args.iface_:
        raise ValueError(f"{args.iface} and -i {args.iface_}: which one?")
    if text is None and args.interface is None and args.channel is None:
        return None
    return resolve(text, python_can(args))


def buses(args: argparse.Namespace) -> list[tuple[Interface, Filters]]:
    """The buses that are meant, with what is let through; that of python-can's configuration if none was named.

    Raises `ValueError` with the reason.
    """
    from analyzer.live.filters import parse, split  # noqa: PLC0415
    from analyzer.live.interfaces import resolve  # noqa: PLC0415 - python-can takes its time

    named: list[str | None] = [*args.iface, *args.iface_] or [None]
    found: dict[str, tuple[Interface, Filters]] = {}
    for text in named:
        name, own = (None, "") if text is None else split(text)
        interface = resolve(name, python_can(args))
        if interface.name in found:
            raise ValueError(f"{interface.name} is named twice")
        found[interface.name] = interface, parse([*args.filter, own])
    return list(found.values())


def python_can(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of python-can say, by their names; None of those that were not given."""
    names = ("interface", "channel", "bitrate", "data_bitrate", "fd", "timing", "bus_kwargs")
    return {name: getattr(args, name) for name in names}


def add_colour(parser: argparse.ArgumentParser) -> None:
    """Whether results have colours."""
    parser.add_argument("--color", choices=("auto", "always", "never"), default="auto", help="default: auto")


def add_output(parser: argparse.ArgumentParser) -> None:
    """How results reach a terminal."""
    add_colour(parser)
    parser.add_argument("--no-pager", action="store_true", help="do not page long output on a terminal")


def add_capture_form(parser: argparse._ActionsContainer, name: str = "form") -> None:
    """The format of a capture that is written, in the attribute `name`."""
    parser.add_argument(
        "-F", "--format", dest=name, choices=FORMS,
        help="default: what the name says: .log .txt .candump, .mcap, .pcapng, with .gz or .zst behind it",
    )  # fmt: skip
    parser.add_argument("--compression", choices=COMPRESSIONS, help="of MCAP chunks; default: zstd")


def capture_form(args: argparse.Namespace, pipe: str = "") -> tuple[str, str]:
    """Format and packing of the capture `args.output`; `pipe` is the format of standard output if none is given.

    Raises `ValueError` for arguments that do not go together.
    """
    output = args.output
    named, packing = form_of(output)
    form: str = args.form or (pipe if output == "-" else named)
    if not form and not output:
        raise ValueError("the output has no name")
    if named and form != named:
        raise ValueError(f"{output}: the name says {named}, -F says {form}")
    if not form:
        says = "- says" if output == "-" else f"{output}: the name says"
        raise ValueError(f"{says} no format: give -F candump, mcap or pcapng")
    if args.compression is not None and form != "mcap":
        raise ValueError("--compression is for MCAP")
    if output == "-" and form != "candump" and sys.stdout.isatty():
        raise ValueError(f"{form} is nothing for a terminal")
    return form, packing


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
        margin = checked("--around", duration, width) if sign else AROUND
        around = _whole(where) if where.strip().isdecimal() else checked("--around", Moment.parse, where)
        if around == 0:
            raise argparse.ArgumentTypeError("--around: frame numbers start at 1")
    return Window(
        start=checked("--from", Moment.parse, args.start),
        stop=checked("--to", Moment.parse, args.stop),
        last=checked("--last", duration, args.last),
        around=around,
        margin=margin,
        frames=checked("--frames", _range, args.frames),
    )


def window_words(args: argparse.Namespace) -> str:
    """The window as it was asked for."""
    given = {
        "--from": args.start,
        "--to": args.stop,
        "--last": args.last,
        "--around": args.around,
        "--frames": args.frames,
    }
    return " ".join(f"{option} {text}" for option, text in given.items() if text is not None)


def checked(option: str, read: Callable[[str], Any], text: str | None) -> Any:
    """What `read` makes of the text of an option, None of none. Raises `argparse.ArgumentTypeError` with its reason."""
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


def add_dialect(parser: argparse._ActionsContainer) -> None:
    """Which readings of doubtful fields stand against the data."""
    parser.add_argument(
        "--dialect", action="append", default=[], type=dialect, metavar="NODE=CHOICE",
        help="how to read a node's doubtful fields, against its own data (24=tm, 24=dronecan, 24=K); repeatable",
    )  # fmt: skip


def dialects(args: argparse.Namespace, registry: Registry) -> Mapping[int, Collection[str]]:
    """What `--dialect` says, by node ID. Raises `ValueError` for a choice that no field has."""
    from analyzer.facts.dialects import checked  # noqa: PLC0415

    found: dict[int, list[str]] = {}
    for node, choice in args.dialect:
        found.setdefault(node, []).append(choice)
    return checked(found, registry)


def dialect(text: str) -> tuple[int, str]:
    """`24=tm` as node ID and choice."""
    node, equals, choice = text.partition("=")
    if not equals or not choice or not node.isdecimal() or not 1 <= int(node) <= 127:
        raise argparse.ArgumentTypeError(f"{text!r} is not NODE=CHOICE with a node ID from 1 to 127")
    return int(node), choice


def captures(args: argparse.Namespace) -> list[str]:
    """The captures given either way, patterns resolved. Raises `argparse.ArgumentTypeError` for those that clash."""
    from glob import glob  # noqa: PLC0415

    names: list[str] = []
    for given in (*args.capture, *args.capture_):
        exists = given == "-" or "\0" in given or os.path.lexists(given)
        names += [given] if exists else sorted(glob(given)) or [given]  # noqa: PTH207 - any pattern, absolute or not
    if names.count("-") > 1:
        raise argparse.ArgumentTypeError("standard input can be read only once")
    if len(names) > 1 and getattr(args, "follow", False):
        raise argparse.ArgumentTypeError("--follow takes one capture")
    return names


def plan(args: argparse.Namespace) -> Plan:
    """How several captures become one. Raises `argparse.ArgumentTypeError` with the option and the reason."""
    from analyzer.sources.merge import Plan, bus_name  # noqa: PLC0415

    names = dict(checked("--bus", bus_name, text) for text in args.bus)
    offsets = dict(checked("--offset", _offset, text) for text in args.offset)
    return Plan(names, offsets, args.same_bus)


def _offset(text: str) -> tuple[str, int]:
    from analyzer.window import duration  # noqa: PLC0415

    name, equals, shift = text.rpartition("=")
    sign, size = (shift[:1], shift[1:]) if shift[:1] in "+-" else ("+", shift)
    if not equals or not name:
        raise ValueError(f"{text!r} is not FILE=+1.5s")
    return name, int(sign + "1") * duration(size)


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


def refuse_input(args: argparse.Namespace, output: str) -> None:
    """Raises `ValueError` when a command would write over what it reads, or read on what it writes."""
    if same := next((name for name in captures(args) if _is_file(name, output)), None):
        shown = "standard output" if output == "-" else output
        raise ValueError(f"{shown}: is " + ("standard input itself" if same == "-" else f"the capture {same} itself"))


def _is_file(capture: str, output: str) -> bool:
    """Whether both are one regular file; `-` is what the shell made standard input or output."""
    try:
        read, written = (os.stat(number if name == "-" else name) for number, name in enumerate((capture, output)))  # noqa: PTH116
        return stat.S_ISREG(written.st_mode) and os.path.samestat(read, written)
    except (OSError, ValueError):  # whoever opens it will say what is wrong
        return False
