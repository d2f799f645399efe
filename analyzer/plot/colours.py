"""One colour a device, the same in every plot: 0xRRGGBBAA."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# Told apart by most eyes on a dark and on a light ground; the first eight by those who see fewer colours, too.
_DEVICES = (
    0x3B8EEAFF, 0xE69F00FF, 0x2FB67CFF, 0xD55E9BFF, 0xC9BC2BFF, 0x8C6CE0FF, 0xE0523EFF, 0x4CC3D9FF,
    0x9C6B3FFF, 0x7FA650FF, 0xB0A0F0FF, 0xF2A38FFF, 0x1F7A8CFF, 0xA83279FF, 0x6B8E9EFF, 0xD4A574FF,
    0x59A14FFF, 0xF28E2BFF, 0x76B7B2FF, 0xB07AA1FF,
)  # fmt: skip
# None of these alarms.
_STATES = (0x3C7D63FF, 0x44689CFF, 0x7A5FA0FF, 0x2F7F8AFF, 0x8A7A3AFF, 0x8C5F7DFF, 0x6B7F45FF, 0x63707CFF)
_BAD = re.compile(r"\b(critical|error|fail|failed|failure|fault)\b", re.IGNORECASE)
_DOUBTFUL = re.compile(r"\b(warning|degraded)\b", re.IGNORECASE)
OFF, ON = 0x50565EFF, 0xE0523EFF
WARNING = 0xB7791FFF
LIMIT = 0xE0523EFF
BROKEN = 0xE0523EFF
CALM = 0x9AA3AEFF


def device(number: int) -> int:
    """Return the colour of a device by its number."""
    return _DEVICES[number % len(_DEVICES)]


def states(names: Iterable[str]) -> list[int]:
    """Return the colours of states in the order of their codes; only what is bad looks so."""
    return [
        ON if _BAD.search(name) else WARNING if _DOUBTFUL.search(name) else _STATES[place % len(_STATES)]
        for place, name in enumerate(names)
    ]


def lighter(colour: int) -> int:
    """Return the same colour, less of it: for what is commanded beside what is reported."""
    return colour & ~0xFF | 0x80
