"""Frames by session: what a node sends of one type, and to whom if it is a service."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.tables import EXTENDED, REMOTE
from dissectors.kit import times_by_bus

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.kit import Array, BusTimes, FrameTable

MOST_SESSIONS = 4096  # that a rule remembers
_KEY_BITS = 17
_TYPE = (1 << _KEY_BITS) - 1
_NODE = 0x7F
CODE_BITS = 24  # below the bus


class Session(NamedTuple):
    """A type that a node sends to all, or a service: then the type ID also has whether it asks, and whom."""

    bus: int
    node: int
    type_id: int

    @property
    def code(self) -> int:
        """Return it as one number."""
        return self.bus << CODE_BITS | self.node << _KEY_BITS | self.type_id

    @classmethod
    def of(cls, code: int) -> Session:
        """Return one by its code."""
        return cls(code >> CODE_BITS, code >> _KEY_BITS & _NODE, code & _TYPE)


class BusFrames:
    """Frames of a bus in a batch that have a time and a sender, one session after the other.

    `row` are rows of the batch, of which all have `times`; `place` counts among these frames, and `tail` are their last
    bytes. `codes` are the sessions as `Session.code` has them, `first` is where each begins, and where the last one
    ends. No time of the bus is less than the one before it if these go `forward`.
    """

    def __init__(self, times: BusTimes, frames: FrameTable, rows: Array | None) -> None:
        place, row, tail, first, codes = _native.frames_by_session(times.bus, frames.id, frames.tail, rows)
        self.place, self.row, self.first, self.codes = (cells(one, np.int64) for one in (place, row, first, codes))
        self.tail = cells(tail, np.uint8)
        self.times, self.forward = frames.t, times.steady


_known: WeakKeyDictionary[FrameTable, dict[int, BusFrames]] = WeakKeyDictionary()


def bus_frames(frames: FrameTable) -> Mapping[int, BusFrames]:
    """Return the frames of a batch by bus; several rules ask, all of the same batch."""
    found = _known.get(frames)
    if found is None:
        _known.clear()  # another thread may do so at any time, for a batch of its own
        found = {}
        plain = (frames.flags & (EXTENDED | REMOTE) == EXTENDED) & (frames.id & _NODE != 0)
        all_ = bool(plain.all())
        for one in times_by_bus(frames):
            rows = one.rows
            if not all_:
                rows = np.flatnonzero(plain) if rows is None else rows[plain[rows]]
            if rows is None or len(rows):
                found[one.bus] = BusFrames(one, frames, rows)
        _known[frames] = found
    return found


def node_of(codes: Array) -> Array:
    """Return the nodes of sessions by their codes."""
    found: Array = codes >> _KEY_BITS & _NODE
    return found


def nodes_of(codes: Array) -> Array:
    """Return buses and nodes of sessions by their codes, each in one number: the bus above 7 bits."""
    found: Array = codes >> _KEY_BITS
    return found
