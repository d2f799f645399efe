"""`tailbyte replay`: a capture on a bus once more, at its own pace or another one."""

from __future__ import annotations

import argparse
import os
import re
import stat
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import buses, options
from analyzer.sinks import form_of

if TYPE_CHECKING:
    from analyzer.app.request import Request
    from analyzer.cli.replay.playing import PlayOrder

NAME = "tailbyte replay"
_EPILOG = """\
`tailbyte replay x.log vcan0` sends what one bus of a capture holds; `tailbyte replay x.log vcan0=can0 vcan1=can1` says
which bus of the capture goes where, as canplayer does: the interface, and the bus whose frames it gets. Error frames
cannot be sent. Commands for motors and the like go onto a bus that may be real only with --allow-actuation."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE... (IFACE | IFACE=BUS...)"
    parser.description = __doc__
    parser.epilog = _EPILOG
    options.add_reader(parser)
    parser.add_argument(
        "-i", dest="iface_", action="append", default=[], metavar="IFACE",
        help="a SocketCAN interface (vcan0), TYPE:CHANNEL[@BITRATE] for those of python-can, or IFACE=BUS; repeatable; "
        "else what stands behind the captures",
    )  # fmt: skip
    group = parser.add_argument_group("how to play")
    group.add_argument("--speed", default="1", metavar="X", help="times as fast; max: as fast as the bus takes it")
    group.add_argument("--loop", default="1", metavar="N", help="play it N times; inf: until Ctrl-C")
    group.add_argument("--max-gap", metavar="S", help="shorten silences (of the capture) to this: 5s, 200ms")
    group.add_argument("-c", dest="count", type=options.positive, metavar="N", help="stop after N frames")
    group.add_argument(
        "-f", dest="filters", action="append", default=[], metavar="ID:MASK",
        help="only such frames, as candump has it (ID~MASK: all others; several with commas); repeatable",
    )  # fmt: skip
    options.add_window(parser)
    group = buses.add_python_can(parser)
    group.add_argument("--allow-actuation", action="store_true", help="send commands to a bus that may be real")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play the capture to its end, or until Ctrl-C."""
    try:
        request, order = _asked(args)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    from analyzer.cli.replay import playing  # noqa: PLC0415

    return playing.run(request, order, NAME)


def _asked(args: argparse.Namespace) -> tuple[Request, PlayOrder]:
    """Return what the arguments say; takes the interfaces out of the captures. Raises `ValueError` with the reason."""
    texts = _targets(args)
    from analyzer.cli.replay.playing import PlayOrder  # noqa: PLC0415
    from analyzer.live.interfaces.filters import parse_filters  # noqa: PLC0415
    from analyzer.live.interfaces.naming import resolve  # noqa: PLC0415 - python-can takes its time
    from analyzer.window.limits import duration  # noqa: PLC0415

    named = options.captures(args)
    if not named:
        raise ValueError("which capture? give a file, or - for standard input")
    pipe = len(named) == 1 and _is_pipe(named[0])
    if pipe:
        args.follow = True  # frames go on as they come
    loops = _loops(args.loop)
    if pipe and loops != 1:
        raise ValueError(f"{named[0]} can be read only once: --loop needs a file")
    order = PlayOrder(
        maps=tuple((resolve(text, buses.python_can(args)), bus) for text, bus in dict.fromkeys(texts)),
        filters=parse_filters(args.filters),
        speed=_speed(args.speed),
        loops=loops,
        longest=options.checked("--max-gap", duration, args.max_gap),
        most=args.count,
        actuating=args.allow_actuation,
        pipe=pipe,
    )
    return options.request(args, NAME), order


def _targets(args: argparse.Namespace) -> list[tuple[str | None, str | None]]:
    """Return interfaces, each with the bus whose frames it gets; no interface if the options of python-can name it."""
    maps = [text for text in args.capture if "=" in text and not os.path.lexists(text)]
    given = [*maps, *args.iface_]
    args.capture = [text for text in args.capture if text not in maps]
    if not given:
        return [(_last(args), None)]
    found: list[tuple[str | None, str | None]] = [_map(text) if "=" in text else (text, None) for text in given]
    if len({bus is None for _, bus in found}) > 1:
        raise ValueError(f"{' and '.join(given)}: either interfaces alone, or with a bus each")
    return found


def _last(args: argparse.Namespace) -> str | None:
    """Return the interface behind the captures."""
    last = args.capture[-1] if args.capture else ""
    wanted = bool(last) and args.channel is None
    if wanted and last != "-" and not form_of(last)[0] and not Path(last).exists():
        return str(args.capture.pop())
    if args.channel is None and args.interface is None:
        known = f": {last} is none (-i takes any name as one)" if wanted else ""
        raise ValueError(f"where to? give an interface such as vcan0 behind the captures{known}")
    return None


def _map(text: str) -> tuple[str, str]:
    interface, _, bus = text.rpartition("=")
    if not interface or not bus:
        raise ValueError(f"{text!r} is not IFACE=BUS, as in vcan0=can0")
    return interface, bus


def _is_pipe(name: str) -> bool:
    """Return whether its frames may come one by one."""
    try:
        mode = os.stat(0 if name == "-" else name).st_mode  # noqa: PTH116 - a descriptor, too
    except (OSError, ValueError):  # whoever opens it will say what is wrong
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)


def _speed(text: str) -> Fraction | None:
    if text == "max":
        return None
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9})?", text, re.ASCII):
        raise ValueError(f"--speed: {text!r} is no number (0.5, 10, or max)")
    return Fraction(text) or None


def _loops(text: str) -> int | None:
    if text in ("inf", "i"):
        return None
    try:
        return options.positive(text)
    except argparse.ArgumentTypeError as error:
        raise ValueError(f"--loop: {error}, nor inf") from None
