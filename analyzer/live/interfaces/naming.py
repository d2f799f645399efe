"""Naming a bus and opening it: `can0`, `TYPE:CHANNEL[@BITRATE]`, python-can's options, files, environment."""

from __future__ import annotations

import difflib
import errno
import json
import logging
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
from can.util import cast_from_string, load_config, load_environment_config, load_file_config

from analyzer.live.interfaces import links
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

# python-can warns of what this program says itself.
logging.getLogger("can").addHandler(logging.NullHandler())

# What the kernel means when a SocketCAN interface cannot be opened.
_REASONS = {
    errno.EAFNOSUPPORT: "this system has no SocketCAN",
    errno.ENODEV: "no such interface (there is none)",
}
# What it means of datagrams to a group, for which even a machine of its own needs a way.
_NO_NETWORK = (errno.ENODEV, errno.ENETUNREACH)
_ALONE = "without a network it takes a route, on Linux: ip route add 239.0.0.0/8 dev lo"
# The two forms of --timing, by the parameters that each of them has.
_TIMINGS: dict[Callable[..., can.BitTiming | can.BitTimingFd], str] = {
    can.BitTiming: "f_clock brp tseg1 tseg2 sjw nof_samples",
    can.BitTimingFd: "f_clock nom_brp nom_tseg1 nom_tseg2 nom_sjw data_brp data_tseg1 data_tseg2 data_sjw",
}


class InterfaceError(Exception):
    """A bus that cannot be opened or used any more; says which and why, in one line."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"{name}: {reason}")
        self.name, self.reason = name, reason

    def __reduce__(self) -> tuple[type[InterfaceError], tuple[str, str]]:
        """Pickle it with its two parts, not with its text."""
        return type(self), (self.name, self.reason)


@dataclass(frozen=True, slots=True)
class Interface:
    """A bus that is not open yet: python-can's `interface`, the channel, and whatever else its class takes."""

    kind: str
    channel: Any
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name that a person calls it by."""
        if self.channel is None:
            return self.kind
        return str(self.channel) if self.kind == "socketcan" else f"{self.kind}:{self.channel}"

    @property
    def bit_rate(self) -> int | None:
        """The bit rate that was asked for, or that the kernel says the controller has; None if nobody knows."""
        timing = self.options.get("timing")
        if timing is not None:
            return int(getattr(timing, "nom_bitrate", None) or timing.bitrate)
        given = self.options.get("bitrate")
        if given is not None:
            return int(given)
        link = self.link
        return link.bit_rate if link else None

    @property
    def link(self) -> links.Link | None:
        """The kernel's knowledge of a SocketCAN interface; None of others, and if it does not know it."""
        if self.kind != "socketcan":
            return None
        return next((link for link in _links() if link.name == self.channel), None)


def resolve(text: str | None, options: Mapping[str, Any]) -> Interface:
    """Find the bus that is meant, as python-can would understand it. Raises `ValueError` with the reason.

    Args:
        text: `can0` (SocketCAN, unless something names another interface) or `TYPE:CHANNEL[@BITRATE]`; None leaves
            everything to `options` and to python-can's configuration.
        options: `interface`, `channel`, `bitrate`, `data_bitrate`, `fd` as python-can takes them, `timing` and
            `bus_kwargs` as lists of `key=value`; what is None was not given.
    """
    config = {name: value for name, value in options.items() if value is not None}
    for name, value in _named(text).items():
        if str(config.setdefault(name, value)) != str(value):
            raise ValueError(f"{text} and --{name} {config[name]} contradict each other")
    kwargs = _kwargs(config.pop("bus_kwargs", ()))
    if "timing" in config:
        config["timing"] = _timing(config["timing"])
    try:
        if "interface" not in config:
            config["interface"] = _configured() or "socketcan"
        loaded: dict[str, Any] = dict(load_config(config={**config, **kwargs}))
    except can.CanInterfaceNotImplementedError:
        raise ValueError(_unknown(str(config["interface"]))) from None
    except (ValueError, TypeError) as error:
        reason = f"is no JSON ({error})" if isinstance(error, json.JSONDecodeError) else str(error)
        raise ValueError(f"python-can's configuration: {reason}") from None
    kind, channel = loaded.pop("interface"), loaded.pop("channel")
    if kind == "socketcan":
        _require_interface(channel)
        loaded.setdefault("fd", True)  # opens classic interfaces as well
    if kind == "udp_multicast":
        loaded.setdefault("hop_limit", 0)  # frames stay in this machine unless somebody asks for more
    return Interface(kind, channel, loaded)


def _require_interface(channel: str | None) -> None:
    if not channel:
        raise ValueError("which SocketCAN interface? (can0, vcan0; tailbyte live -D lists them)")
    if Path(channel).is_file():
        raise ValueError(f"{channel} is a file, no bus: decode, view and check read it, replay sends it")


def open_bus(interface: Interface) -> can.BusABC:
    """Open the bus. Raises `InterfaceError`."""
    known = _links() if interface.kind == "socketcan" else []
    if known and interface.link is None:  # python-can would find out with a socket that it leaves open
        names = ", ".join(link.name for link in known)
        raise InterfaceError(interface.name, f"no such interface (there is {names})")
    config = dict(interface.options)
    if interface.channel is not None:
        config["channel"] = interface.channel
    try:
        return can.Bus(interface=interface.kind, ignore_config=True, **config)
    except OSError as error:
        reason = _REASONS.get(error.errno or 0) if interface.kind == "socketcan" else None
        raise InterfaceError(interface.name, reason or error.strerror or first_line(error)) from None
    except Exception as error:  # noqa: BLE001 - each driver fails in its own way
        cause = error.__cause__
        alone = interface.kind == "udp_multicast" and isinstance(cause, OSError) and cause.errno in _NO_NETWORK
        raise InterfaceError(interface.name, _ALONE if alone else first_line(error)) from None


def close_bus(bus: can.BusABC) -> None:
    """Close the bus, whatever its driver says to that: a device may have been pulled out."""
    with suppress(Exception):
        bus.shutdown()


def first_line(error: Exception) -> str:
    """Return what an error of python-can says, without the number behind it."""
    lines = re.sub(r" \[Error Code -?\d+\]$", "", str(error)).splitlines()
    return next(filter(None, map(str.strip, lines)), type(error).__name__)


def _named(text: str | None) -> dict[str, str | int]:
    """Read `can0` or `TYPE:CHANNEL[@BITRATE]`."""
    if text is None:
        return {}
    kind, colon, channel = text.partition(":")
    if not colon:
        kind, channel = "", text
    channel, at, rate = channel.rpartition("@") if re.search(r"@\d+$", channel) else (channel, "", "")
    found: dict[str, str | int] = {"interface": kind} if colon else {}
    if colon and kind not in can.VALID_INTERFACES:
        raise ValueError(f"{text}: {_unknown(kind)}")
    if channel:
        found["channel"] = channel
    if at:
        found["bitrate"] = int(rate[:12])
    return found


def _unknown(kind: str) -> str:
    known = sorted(can.VALID_INTERFACES)
    near = difflib.get_close_matches(kind, known, n=3)
    return f"no interface type is called {kind!r} ({'near' if near else 'there is'}: {', '.join(near or known)})"


def _configured() -> str | None:
    """Return the interface type that python-can's configuration names."""
    sources: tuple[Mapping[str, Any], ...] = (can.rc, load_environment_config(), load_file_config(section="default"))
    return next((name for each in sources for key in ("interface", "bustype") if (name := each.get(key))), None)


def _kwargs(texts: Iterable[str]) -> dict[str, Any]:
    return {name.replace("-", "_"): cast_from_string(value) for name, value in _pairs("--bus-kwargs", texts)}


def _timing(texts: Iterable[str]) -> can.BitTiming | can.BitTimingFd:
    given = dict(_pairs("--timing", texts))
    make = next((make for make, names in _TIMINGS.items() if given.keys() == set(names.split())), None)
    if make is None:
        raise ValueError(f"--timing takes all of {' or all of '.join(_TIMINGS.values())}")
    try:
        return make(**{name: int(value) for name, value in given.items()})
    except ValueError as error:
        raise ValueError(f"--timing: {error}") from None


def _pairs(option: str, texts: Iterable[str]) -> Iterable[tuple[str, str]]:
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not re.fullmatch(r"[A-Za-z_][\w-]*", name):
            raise ValueError(f"{option}: {text!r} is not key=value (what does not belong to it goes in front of it)")
        yield name, value


def _links() -> list[links.Link]:
    try:
        return links.list_links()
    except OSError:
        return []
