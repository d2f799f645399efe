"""Every fault and every scenario by name, and how somebody asks for one: `RULE[@TIME][:key=value...]`."""

from __future__ import annotations

import difflib
from functools import cache
from typing import TYPE_CHECKING

import dissectors
from analyzer.simulate import scenarios
from analyzer.simulate.faults import bus, frames, lengths, recording, transfers, values
from analyzer.simulate.faults.context import FaultOrder
from dissectors.times import MICROSECOND, MILLISECOND, SECOND
from dissectors.tmotor import traffic

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dissectors.traffic import Fault, Scenario, Setting

# What every fault takes: who sends it, which type of transfer, how often in a row. None has no default.
COMMON: Mapping[str, type] = {"node": int, "type": str, "count": int}
_UNITS = {"s": SECOND, "ms": MILLISECOND, "us": MICROSECOND, "min": 60 * SECOND, "h": 3600 * SECOND}
_LAYERS = ("CAN", "TRF", "TYP", "PUSH", "BUS", "CAP")
# The least and the most of settings that mean the same in every fault; of others what 32 bits hold, signed or not.
_LIMITS: Mapping[str, tuple[float, float]] = {
    "node": (1, 127),
    "count": (1, 10_000),
    "times": (1, 10_000),
    "commands": (1, 1_000_000),
    "seconds": (0.01, 86_400),
    "period": (0.001, 60),
    "pause": (0.001, 3600),
    "after": (0.001, 3600),
    "lost": (1, 1000),
    "frame": (1, 64),
    "bytes": (0, 60_000),
    "priority": (0, 31),
    "channel": (0, 19),
    "signature": (0, 2**64 - 1),
}
_WIDE = (-(2**31), 2**32 - 1)
_ANSWERS = {"yes": True, "no": False}
# No time is later than this: a day.
_LONGEST = 86_400 * SECOND


@cache
def faults() -> dict[str, Fault]:
    """Return every fault by its rule, in the order of the catalogue."""
    every = (
        *frames.FAULTS, *transfers.FAULTS, *lengths.FAULTS, *values.FAULTS, *bus.FAULTS, *recording.FAULTS,
        *traffic.FAULTS,
    )  # fmt: skip
    return {fault.rule: fault for fault in sorted(every, key=_place)}


@cache
def stories() -> dict[str, Scenario]:
    """Return every scenario by its name."""
    return {story.name: story for story in (*traffic.SCENARIOS, *scenarios.SCENARIOS)}


def scenario(text: str) -> Scenario:
    """Return the scenario that `NAME[:option=yes...]` names. Raises `ValueError` with what comes near."""
    name = text.partition(":")[0]
    found = stories().get(name)
    if found is None:
        raise ValueError(f"no scenario is called {name!r}{_near(name, stories())}")
    return found


def story_options(text: str) -> dict[str, bool]:
    """Return what `NAME:option=yes:option=no` asks for. Raises `ValueError` with what there is."""
    story, found = scenario(text), {}
    for part in text.split(":")[1:]:
        name, _, word = part.partition("=")
        if name not in story.options or word not in _ANSWERS:
            there = ", ".join(f"{option}=yes or no" for option in story.options) or "it takes none"
            raise ValueError(f"{story.name}: {part!r} is no setting ({there})")
        found[name] = _ANSWERS[word]
    return found


def order(text: str) -> FaultOrder:
    """Read `TRF-003@2.5:node=11:count=3` as an order. Raises `ValueError` with the reason."""
    head, *settings = text.split(":")
    rule, at, time = head.partition("@")
    fault = _fault(rule)
    if at and fault.early:
        raise ValueError(f"{fault.rule}: holds from the start of the capture, it takes no time")
    return FaultOrder(fault, nanoseconds(time) if at else None, _settings(fault, settings), text=text)


def rate(text: str) -> FaultOrder:
    """Read `TRF-003=0.01` as an order. Raises `ValueError` with the reason."""
    rule, equals, share = text.partition("=")
    fault = _fault(rule)
    try:
        value = float(share)
    except ValueError:
        value = -1.0
    if not equals or not 0 <= value <= 1:
        raise ValueError(f"{text!r} is not RULE=P with a probability from 0 to 1")
    return FaultOrder(fault, None, _settings(fault, []), rate=value, text=text)


def nanoseconds(text: str) -> int:
    """Read a time or a duration: `2.5`, `2.5s`, `300ms`, `40us`, `10min`, `24h`. Raises `ValueError`."""
    unit = next((unit for unit in ("min", "ms", "us", "s", "h") if text.endswith(unit)), "")
    digits = text.removesuffix(unit)
    if not digits or not digits.replace(".", "", 1).isdecimal() or not digits.isascii():
        raise ValueError(f"{text!r} is not a time (2.5, 2.5s, 300ms, 10min)")
    whole, _, part = digits.partition(".")
    scale = _UNITS[unit or "s"]
    found = int(whole[-20:] or "0") * scale + int((part + "0" * 12)[:12]) * scale // 10**12
    if found > _LONGEST or len(whole) > 20:
        raise ValueError(f"{text!r} is more than a day")
    return found


def _place(fault: Fault) -> tuple[int, str]:
    layer, _, number = fault.rule.partition("-")
    return _LAYERS.index(layer), number


def _fault(rule: str) -> Fault:
    found = faults().get(rule.upper())
    if found is None:
        raise ValueError(f"no fault is called {rule!r}{_near(rule.upper(), faults())}; --list shows all")
    return found


def _settings(fault: Fault, texts: Iterable[str]) -> dict[str, Setting]:
    settings: dict[str, Setting] = dict(fault.options)
    kinds = {**{name: type(value) for name, value in fault.options.items()}, **COMMON}
    for text in texts:
        name, equals, value = text.partition("=")
        if name not in kinds or not equals:
            raise ValueError(f"{fault.rule}: {text!r} is no setting ({', '.join(f'{name}=' for name in kinds)})")
        settings[name] = _setting(fault, name, kinds[name], value)
    return settings


@cache
def _types() -> dissectors.Registry:
    return dissectors.load()


def _setting(fault: Fault, name: str, kind: type, text: str) -> Setting:
    try:
        value: Setting = int(text[:20], 0) if kind is int else float(text) if kind is float else text
    except ValueError:
        raise ValueError(f"{fault.rule}: {name}={text} is not a number") from None
    if name == "type":
        try:
            value = _types().resolve(text).table
        except dissectors.UnknownNameError as error:
            raise ValueError(f"{fault.rule}: type={text}: {error}") from None
    low, high = fault.limits.get(name) or _LIMITS.get(name, _WIDE)
    if not isinstance(value, str) and not low <= value <= high:  # NaN is nowhere
        raise ValueError(f"{fault.rule}: {name}={text} is not {low} to {high}")
    if name in fault.choices and value not in fault.choices[name]:
        raise ValueError(f"{fault.rule}: {name}={text} is none of {', '.join(fault.choices[name])}")
    return value


def _near(name: str, names: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, names, n=3)
    return f" (near: {', '.join(near)})" if near else ""
