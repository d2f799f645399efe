"""Frames that are equal but for their tail bytes, told by one number each."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from analyzer._native import Identities

if TYPE_CHECKING:
    from dissectors.kit import FrameTable

_known: WeakKeyDictionary[FrameTable, Identities] = WeakKeyDictionary()


def identities(frames: FrameTable) -> Identities:
    """Return a number for each frame of a batch, and its tail byte, for the core.

    Numbers are equal if interface, identifier, length and the bytes before the tail are; other ones are equal once in
    2^64 pairs.
    """
    found = _known.get(frames)
    if found is None:
        offsets, raw = frames.raw
        found = _known[frames] = Identities(frames.bus, frames.id, offsets, np.frombuffer(raw, np.uint8))
    return found
