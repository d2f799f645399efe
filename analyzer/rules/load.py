"""The load of each interface: frames and bits by the second.

Bits are those on the wire, the stuffing really needed and the gap between frames included. Of a CAN FD frame with a
faster data phase that phase is only estimated, as a fifth of its bits: no capture says how fast it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from dissectors.kit import NO_TIME, SECOND, Seconds, set_back, times_by_bus

if TYPE_CHECKING:
    from dissectors.kit import Array, BusTimes, FrameTable


def bit_times(frames: FrameTable) -> Array:
    """Return how many bits each frame occupies the bus, u16."""
    offsets, data = frames.raw
    base = int(offsets[0])
    places = (offsets - offsets.dtype.type(base)).tobytes()
    wire = data[base : int(offsets[-1])].tobytes()
    return np.frombuffer(_native.frame_bits(frames.id.tobytes(), frames.flags.tobytes(), places, wire), np.uint16)


def split(frames: FrameTable, bits: Array, origin: int) -> Seconds:
    """Return the seconds of a batch, counted from `origin` on, by interface and then in the order of the frames.

    `bits` are those of `bit_times`.
    """
    times = [] if origin == NO_TIME else times_by_bus(frames)
    if not times:
        return Seconds(*(np.empty(0, np.int64) for _ in Seconds._fields))
    parts = [_of_bus(one, frames, bits, origin) for one in times]
    if len(parts) == 1:
        return parts[0]
    return Seconds(*map(np.concatenate, zip(*parts, strict=True)))


def _of_bus(one: BusTimes, frames: FrameTable, bits: Array, origin: int) -> Seconds:
    bus, rows, t = one.bus, one.rows, one.t
    index = (t - origin) // SECOND
    begins = np.ones(len(t), bool)
    np.not_equal(index[1:], index[:-1], out=begins[1:])
    if one.back:
        begins[set_back(t)] = True
    starts = begins.nonzero()[0]
    own = bits if rows is None else bits[rows]
    sums = np.add.reduceat(own, starts, dtype=np.int64)
    counts = np.diff(starts, append=len(t))
    places = starts if rows is None else rows[starts]
    first = origin + index[starts] * SECOND, t[starts], frames.first + places
    return Seconds(np.full(len(starts), bus), *first, counts, sums)
