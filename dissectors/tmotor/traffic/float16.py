"""The float16 encoder as the document prints it (5.2): what a sender that uses it really sends."""

from __future__ import annotations

import struct

_SIGN, _INFINITY, _LARGEST = 0x8000_0000, 0x7F80_0000, 31 << 23
_SCALE = 2.0**-112
# DEVIATION 5.2: printed ~0xFFFF; an encoder that rounds has ~0xFFF.
_MASK = ~0xFFFF & 0xFFFF_FFFF


def printed(value: float) -> float:
    """Return what the printed encoder makes of `value`, itself exact in float16: up to 0.78 % too large."""
    (bits,) = struct.unpack("<I", struct.pack("<f", value))
    sign = bits & _SIGN
    bits ^= sign
    if bits >= _INFINITY:
        code = 0x7FFF if bits > _INFINITY else 0x7C00
    else:
        (small,) = struct.unpack("<f", struct.pack("<I", bits & _MASK))
        (bits,) = struct.unpack("<I", struct.pack("<f", small * _SCALE))
        code = min(bits - _MASK & 0xFFFF_FFFF, _LARGEST) >> 13
    (found,) = struct.unpack("<e", struct.pack("<H", code | sign >> 16))
    return float(found)
