"""The metadata of channels in our own files: what holds for all frames, and their messages cannot say."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

# Bits of the flags of a frame, and where the length code begins.
_FD, _BITS, _CODE = 8, {"bit rate switch": 16, "error state": 32}, 8
_CODES = {str(code): code << _CODE for code in range(9, 16)}


def flags(about: Mapping[str, str]) -> int:
    """Return the flag bits that all frames have; words that mean nothing here are passed over."""
    if about.get("frames") != "CAN FD":
        return _CODES.get(about.get("length code", ""), 0)
    return _FD | sum({_BITS.get(word, 0) for word in about.get("flags", "").split(", ")})
