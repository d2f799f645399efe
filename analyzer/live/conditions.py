"""Conditions of `-a` and `-b` as dumpcap has them: `NAME:VALUE`, with units where dumpcap has bare numbers."""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

# A bare number of a file size counts kilobytes of 1000 bytes, as in Wireshark since 1.10.
KILOBYTE = 1000
_UNITS = {"b": 1, "kb": 10**3, "mb": 10**6, "gb": 10**9, "kib": 2**10, "mib": 2**20, "gib": 2**30}


def split_condition(option: str, text: str, names: Sequence[str]) -> tuple[str, str]:
    """Return name and value of a condition. Raises `ValueError` if it is none of `names`."""
    name, colon, value = text.partition(":")
    if name not in names:
        near = difflib.get_close_matches(name, names, n=1)
        raise ValueError(f"{option} {text}: {f'did you mean {near[0]}:' if near else 'there are ' + ', '.join(names)}")
    if not colon or not value:
        raise ValueError(f"{option} {text}: {name}: needs a value")
    return name, value


def parse_number(option: str, name: str, value: str) -> int:
    """Read a whole number above 0. Raises `ValueError`."""
    if not re.fullmatch(r"[0-9]{1,18}", value) or int(value) == 0:
        raise ValueError(f"{option} {name}:{value}: {value!r} is not a whole number above 0")
    return int(value)


def parse_seconds(option: str, name: str, value: str) -> int:
    """Read a span of time in nanoseconds, seconds without a unit. Raises `ValueError`."""
    from analyzer.window.limits import duration  # noqa: PLC0415 - takes its time

    try:
        ns = duration(value)
    except ValueError as error:
        raise ValueError(f"{option} {name}:{value}: {error}") from None
    if ns <= 0:
        raise ValueError(f"{option} {name}:{value}: no time at all")
    return ns


def parse_size(option: str, name: str, value: str) -> int:
    """Read a size in bytes, `KILOBYTE`s without a unit. Raises `ValueError`."""
    match = re.fullmatch(r"([0-9]{1,15})([A-Za-z]*)", value)
    unit = _UNITS.get(match[2].lower(), KILOBYTE if not match[2] else 0) if match else 0
    if match is None or not unit or int(match[1]) == 0:
        raise ValueError(f"{option} {name}:{value}: {value!r} is not a size (100 are kB, 20MB, 1GiB)")
    return int(match[1]) * unit
