"""`tailbyte simulate`: a vehicle's traffic with known faults, to a file or onto a bus, and the key to them."""

from __future__ import annotations

import argparse
import os
import re
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

from analyzer.app.targets import capture_form
from analyzer.cli import status
from analyzer.cli.arguments import buses, options
from analyzer.sinks import form_of

if TYPE_CHECKING:
    from analyzer.live.interfaces.naming import Interface
    from analyzer.simulate import SimulationSettings

NAME = "tailbyte simulate"
# What goes on until somebody ends it ends after a day.
DAY = 86_400 * 10**9
# Names of interfaces that candump text can hold, with room for the number of a second one.
_NAME = r"[\x21\x22\x24-\x7e]{1,60}"
# Times of a capture in ns: fewer seconds than these are no date, and 64 bits end in 2262.
_EARLIEST, _LATEST = 10**17, 1 << 63
_EPILOG = """\
TIME and S are seconds, or 300ms, 10min, 24h. What a file holds depends on nothing but these arguments. Onto a bus:
`tailbyte simulate vcan0` goes on until Ctrl-C (at most a day), at the pace of the clock. Commands for motors and the
like go onto a bus that may be real only with --allow-actuation."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] (-o FILE | IFACE | --list)"
    parser.description = __doc__
    parser.epilog = _EPILOG
    parser.add_argument("-o", "-w", dest="output", metavar="FILE", help="the capture; - is standard output")
    options.add_capture_form(parser)
    parser.add_argument("--list", action="store_true", help="show every fault with its settings, and every scenario")
    group = parser.add_argument_group("what to simulate")
    group.add_argument("--flight", metavar="NAME", help="hover, mission, bench or startup; default: hover")
    group.add_argument("--profile", action=options.OldName, dest="flight", new="--flight")
    group.add_argument("--esc", type=int, default=4, metavar="N", help="ESCs, 1 to 20; default: 4")
    group.add_argument("--duration", metavar="S", help="default: 10, or what the scenario takes; at most a day")
    group.add_argument("--seed", type=_seed, default=1, metavar="K", help="another number, another flight; default: 1")
    group.add_argument("--rate", type=int, metavar="HZ", help="of status messages; default: 30, less on a slow bus")
    group.add_argument("--stock", action="store_true", help="the ESCs speak standard DroneCAN only")
    group.add_argument(
        "--start", metavar="TIME",
        help="time of the beginning: 2026-03-14T12:49:54 (UTC unless it names a zone), or seconds since 1970",
    )  # fmt: skip
    group.add_argument("--bus-name", metavar="NAME", help="of the interface in the capture; default: can0")
    group = parser.add_argument_group("faults")
    group.add_argument(
        "--fault", action="append", default=[], metavar="RULE[@TIME][:key=value...]",
        help="let this happen, at a time or whenever it suits; repeatable",
    )  # fmt: skip
    group.add_argument(
        "--fault-rate", action="append", default=[], metavar="RULE=P",
        help="let it happen with this probability, from 0 to 1, whenever it could; repeatable",
    )  # fmt: skip
    group.add_argument(
        "--scenario", metavar="NAME[:OPTION=yes|no...]", help="a story with faults of its own, see --list"
    )
    group.add_argument("--key", metavar="FILE", help="write what happened where, as JSON; - is standard output")
    group = buses.add_bus(parser)
    group.add_argument("--allow-actuation", action="store_true", help="send commands to a bus that may be real")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run one simulation to its end."""
    if args.list:
        return _list()
    try:
        _check_goal(args)
        bus = buses.bus(args)
        settings = _settings(args, bus)
        form, packing = ("", "") if bus else capture_form(args.output, args.form, args.compression, pipe="candump")
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    if bus is not None:
        from analyzer.cli.simulate.bus import run as send  # noqa: PLC0415

        return send(settings, bus, args.key, actuating=args.allow_actuation, who=NAME)
    from analyzer.cli.simulate.file import SimulationOutput  # noqa: PLC0415
    from analyzer.cli.simulate.file import run as write  # noqa: PLC0415

    output = SimulationOutput(args.output, form, packing, args.compression or "zstd", args.key)
    return write(settings, output, NAME)


def _list() -> int:
    from analyzer.simulate.faults import catalogue  # noqa: PLC0415
    from analyzer.views.faults import render  # noqa: PLC0415

    faults, scenarios = catalogue.faults().values(), catalogue.stories().values()
    sys.stdout.write(render(faults, scenarios, catalogue.COMMON))
    return status.OK


def _check_goal(args: argparse.Namespace) -> None:
    """Raise `ValueError` unless there is one goal, and every option is for it."""
    iface = args.iface or args.iface_
    named = iface or args.interface or args.channel
    if args.output is None and named is None:
        raise ValueError("where to? give -o FILE, or an interface such as vcan0; or --list")
    if iface and form_of(iface)[0]:
        raise ValueError(f"{iface} is no interface: did you mean -o {iface}?")
    if args.output is not None and named is not None:
        raise ValueError(f"to the file {args.output} or onto the bus {named}: which one?")
    if args.key is not None and args.output is not None and _same(args.key, args.output):
        raise ValueError("the capture and its key need a file each")
    for_files = {"-F": args.form, "--compression": args.compression, "--start": args.start, "--bus-name": args.bus_name}
    given = {name for name in ("data_bitrate", "fd", "timing", "bus_kwargs", "allow_actuation") if getattr(args, name)}
    wrong = (name for name, value in for_files.items() if value is not None and named)
    if named is None:
        wrong = (f"--{name.replace('_', '-')}" for name in sorted(given))
    if found := next(wrong, None):
        raise ValueError(f"{found} is for {'a file' if named else 'a bus'}")


def _same(one: str, other: str) -> bool:
    return one == other or (one != "-" != other and os.path.realpath(one) == os.path.realpath(other))


def _settings(args: argparse.Namespace, bus: Interface | None) -> SimulationSettings:
    """Return what to simulate. Raises `ValueError` with the option and the reason."""
    from analyzer.simulate import START, SimulationSettings  # noqa: PLC0415
    from analyzer.simulate.faults import catalogue  # noqa: PLC0415
    from dissectors.times import SECOND  # noqa: PLC0415
    from dissectors.tmotor.traffic import BUS_RATES, FLIGHT_PLANS  # noqa: PLC0415

    story = catalogue.scenario(args.scenario) if args.scenario is not None else None
    if story is not None:
        catalogue.story_options(args.scenario)
    flight = args.flight or (story.flight if story else FLIGHT_PLANS[0])
    if flight not in FLIGHT_PLANS:
        raise ValueError(f"no flight is called {flight!r} (there is {', '.join(FLIGHT_PLANS)})")
    for name, value, most in (("--esc", args.esc, 20), ("--rate", args.rate, 400)):
        if value is not None and not 1 <= value <= most:
            raise ValueError(f"{name} {value} is outside 1 to {most}")
    if story is not None and args.esc < story.least:
        raise ValueError(f"--scenario {story.name} takes at least {story.least} ESCs")
    bit_rate = (bus.bit_rate if bus else args.bitrate) or BUS_RATES[0]
    if bit_rate not in BUS_RATES:
        raise ValueError(f"--bitrate {bit_rate} is none of {', '.join(map(str, BUS_RATES))}")
    usual = round((story.seconds if story else 10) * SECOND)
    endless = bus is not None and story is None and args.duration is None
    given = None if args.duration is None else _time("--duration", args.duration)
    duration = DAY if endless else usual if given is None else given
    if not duration:
        raise ValueError("--duration is nothing")
    orders = (*map(catalogue.order, args.fault), *map(catalogue.rate, args.fault_rate))
    for order in orders:
        if order.t is not None and order.t >= duration:
            raise ValueError(f"--fault {order.text}: that is after the end, {duration / SECOND:g} s")
    return SimulationSettings(
        flight=flight,
        scenario=args.scenario or "",
        escs=args.esc,
        duration=duration,
        seed=args.seed,
        bit_rate=bit_rate,
        rate=args.rate,
        stock=args.stock,
        start=START if args.start is None else _start(args.start, duration),
        bus=_bus_name(args.bus_name, bus),
        orders=orders,
        span=usual if endless else 0,
    )


def _seed(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:20]!r} is not a whole number") from None


def _time(option: str, text: str) -> int:
    from analyzer.simulate.faults.catalogue import nanoseconds  # noqa: PLC0415

    try:
        return nanoseconds(text)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None


def _start(text: str, duration: int) -> int:
    """Return nanoseconds since 1970, whole microseconds as candump text has them; a date without a zone is UTC."""
    from datetime import UTC, datetime, timedelta  # noqa: PLC0415

    found = 0
    if re.fullmatch(r"\d{1,12}(\.\d{1,12})?", text, re.ASCII):
        seconds, _, part = text.partition(".")
        found = int(seconds) * 1_000_000 + int(f"{part:0<6}"[:6])
    else:
        with suppress(ValueError):
            moment = datetime.fromisoformat(text)
            moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
            found = (moment - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1)
    if not _EARLIEST <= found * 1000 < _LATEST - duration:
        raise ValueError(f"--start: {text!r} is no date (2026-03-14T12:49:54, or seconds since 1970)")
    return found * 1000


def _bus_name(given: str | None, bus: Interface | None) -> str:
    name = str(bus.channel) if bus else "can0" if given is None else given
    if re.fullmatch(_NAME, name):
        return name
    if bus:
        return bus.kind
    raise ValueError(f"--bus-name: {name!r} is not a name of printable characters without spaces and #, at most 60")
