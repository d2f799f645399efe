"""Options of buses that exist, with those of python-can, and the interfaces that they mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.cli.arguments.options import positive

if TYPE_CHECKING:
    import argparse

    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface


def add_bus(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add the bus that exists, with the options of python-can."""
    parser.add_argument(
        "iface", nargs="?", metavar="IFACE",
        help="a SocketCAN interface (vcan0), or TYPE:CHANNEL[@BITRATE] for those of python-can (virtual:demo, "
        "slcan:/dev/ttyACM0@1000000)",
    )  # fmt: skip
    parser.add_argument("-i", dest="iface_", metavar="IFACE", help="the same, by letter")
    return add_python_can(parser)


def add_buses(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add several buses that exist, with the options of python-can."""
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
    """Add the options of python-can for the buses of a command."""
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
    """Return the bus that is meant, None if none was named. Raises `ValueError` with the reason."""
    from analyzer.live.interfaces.naming import resolve  # noqa: PLC0415 - python-can takes its time

    text = args.iface or args.iface_
    if args.iface and args.iface_:
        raise ValueError(f"{args.iface} and -i {args.iface_}: which one?")
    if text is None and args.interface is None and args.channel is None:
        return None
    return resolve(text, python_can(args))


def buses(args: argparse.Namespace) -> list[tuple[Interface, Filters]]:
    """Return the buses that are meant, with what is let through; that of python-can's configuration if none was named.

    Raises `ValueError` with the reason.
    """
    from analyzer.live.interfaces.filters import parse_filters, split_filters  # noqa: PLC0415
    from analyzer.live.interfaces.naming import resolve  # noqa: PLC0415 - python-can takes its time

    named: list[str | None] = [*args.iface, *args.iface_] or [None]
    found: dict[str, tuple[Interface, Filters]] = {}
    for text in named:
        name, own = (None, "") if text is None else split_filters(text)
        interface = resolve(name, python_can(args))
        if interface.name in found:
            raise ValueError(f"{interface.name} is named twice")
        found[interface.name] = interface, parse_filters([*args.filter, own])
    return list(found.values())


def python_can(args: argparse.Namespace) -> dict[str, Any]:
    """Return the options of python-can by their names; None of those that were not given."""
    names = ("interface", "channel", "bitrate", "data_bitrate", "fd", "timing", "bus_kwargs")
    return {name: getattr(args, name) for name in names}
