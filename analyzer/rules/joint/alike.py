"""Frames that are equal but for their tail bytes, told by one number each."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells

if TYPE_CHECKING:
    from dissectors.kit import Array, FrameTable

_known: WeakKeyDictionary[FrameTable, tuple[Array, Array]] = WeakKeyDictionary()


def identities(frames: FrameTable) -> tuple[Array, Array]:
    """Return a number for each frame of a batch, and its tail byte, -1 without one.

    Numbers are equal if interface, identifier, length and the bytes before the tail are; other ones are equal once in
    2^64 pairs.
    """
    if frames not in _known:
        _known[frames] = _made(frames)
    return _known[frames]


def _made(frames: FrameTable) -> tuple[Array, Array]:
    offsets, raw = frames.raw
    key, tail = _native.identities(frames.bus, frames.id, offsets, np.frombuffer(raw, np.uint8))
    return cells(key, np.uint64), cells(tail, np.int16)
