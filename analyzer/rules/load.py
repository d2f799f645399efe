"""How full each interface is: frames and bits by the second.

Bits are those on the wire, the stuffing really needed and the gap between frames included. Of a CAN FD frame with a
faster data phase that phase is only estimated, as a fifth of its bits: no capture says how fast it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.tables import distinct
from dissectors.conformance import NO_TIME, SECOND

if TYPE_CHECKING:
    from analyzer.rules.columns import Frames
    from dissectors.conformance import Words


class Second(NamedTuple):
    """Frames of an interface one after the other in one second; `start` is where the second begins.

    `t` and `frame` are those of the first. A second that a batch or a step back in time cuts has several of these.
    """

    bus: int
    start: int
    t: int
    frame: int
    frames: int
    bits: int


def bit_times(frames: Frames) -> Words:
    """How many bits each frame occupies the bus, u16."""
    offsets, data = frames.raw
    base = int(offsets[0])
    places = (offsets - offsets.dtype.type(base)).tobytes()
    wire = data[base : int(offsets[-1])].tobytes()
    return np.frombuffer(_native.frame_bits(frames.id.tobytes(), frames.flags.tobytes(), places, wire), np.uint16)


def split(frames: Frames, bits: Words, origin: int) -> list[Second]:
    """The seconds of a batch, counted from `origin` on, by interface and then in the order of the frames.

    `bits` are those of `bit_times`.
    """
    if not len(frames) or origin == NO_TIME:
        return []
    buses = distinct(frames.bus)
    timed = frames.t != NO_TIME
    whole = bool(timed.all())
    found = []
    for bus in buses:
        rows = None if len(buses) == 1 and whole else np.flatnonzero((frames.bus == bus) & timed)
        found += _of_bus(bus, frames, bits, rows, origin)
    return found


def _of_bus(bus: int, frames: Frames, bits: Words, rows: Words | None, origin: int) -> list[Second]:
    t = frames.t if rows is None else frames.t[rows]
    if not len(t):
        return []
    index = (t - origin) // SECOND
    starts = np.concatenate(([0], np.flatnonzero(index[1:] != index[:-1]) + 1))
    own = bits if rows is None else bits[rows]
    sums = np.add.reduceat(own, starts, dtype=np.int64).tolist()
    counts = np.diff(starts, append=len(t)).tolist()
    places = starts if rows is None else rows[starts]
    columns = (origin + index[starts] * SECOND, t[starts], frames.first + places)
    listed = zip(*(column.tolist() for column in columns), counts, sums, strict=True)
    return [Second(bus, start, first, frame, n, total) for start, first, frame, n, total in listed]
