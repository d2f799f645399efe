"""Frames that are equal but for their tail bytes, told by one number each."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array, FrameTable

_WORD = 8  # bytes
_MIX = np.uint64(0x9E37_79B9_7F4A_7C15)
_HALF = np.uint64(32)

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
    ends, raw = frames.raw
    begin, length = ends[:-1].astype(np.int64), frames.length.astype(np.int64)
    data = np.concatenate((np.frombuffer(raw, np.uint8), np.zeros(_WORD, np.uint8)))
    key = _mixed(frames.bus.astype(np.uint64) << _HALF | frames.id, length)
    for at in range(0, int(length.max(initial=0)), _WORD):
        more = np.flatnonzero(length > at + 1)
        words = np.lib.stride_tricks.sliding_window_view(data, _WORD)[begin[more] + at].copy().view(np.uint64)[:, 0]
        spare = np.maximum(_WORD - (length[more] - 1 - at), 0).astype(np.uint64) * np.uint64(_WORD)
        words &= np.uint64(0xFFFF_FFFF_FFFF_FFFF) >> spare
        key[more] = _mixed(key[more], words)
    tail = np.where(length > 0, data[np.maximum(begin + length - 1, 0)].astype(np.int16), np.int16(-1))
    return key, tail


def _mixed(key: Array, more: Array) -> Array:
    """Return numbers that depend on both, however alike these are."""
    mixed = (key ^ more.astype(np.uint64)) * _MIX
    mixed ^= mixed >> _HALF
    mixed *= _MIX
    return mixed ^ mixed >> np.uint64(29)
