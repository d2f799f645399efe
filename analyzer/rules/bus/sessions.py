"""Frames and transfers by session: what a node sends of one type, and to whom if it is a service."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from analyzer.tables import EXTENDED, KINDS, REMOTE, TAIL_END, TAIL_START
from dissectors.kit import by_key, times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dissectors.kit import Array, BusTimes, FrameTable, TransferTable

MOST_SESSIONS = 4096  # that a rule remembers
_SERVICE, _ASKS = 1 << 16, 1 << 7
_KEY_BITS = 17
_KEY = (1 << _KEY_BITS) - 1
_NODE = 0x7F
_MESSAGE, _REQUEST, _RESPONSE = (KINDS.index(name) for name in ("message", "request", "response"))


class Session(NamedTuple):
    """A type that a node sends to all, or a service: then the type ID also has whether it asks, and whom."""

    bus: int
    node: int
    type_id: int

    @property
    def of_responses(self) -> bool:
        """Return whether these are answers."""
        return self.type_id & (_SERVICE | _ASKS) == _SERVICE

    @property
    def of_service(self) -> bool:
        """Return whether these are requests or answers."""
        return bool(self.type_id & _SERVICE)


class BusFrames:
    """Frames of a bus in a batch that have a time and a sender, one session after the other.

    `row` are rows of the batch, of which all have `times`; `place` counts among these frames. `first` is where each
    session begins, and where the last one ends.
    """

    def __init__(self, times: BusTimes, frames: FrameTable, rows: Array | None) -> None:
        identifier = frames.id if rows is None else frames.id[rows]
        codes = (identifier & _NODE) << _KEY_BITS | identifier >> 7 & _KEY
        self.place, first = by_key(codes)
        self.row = self.place if rows is None else rows[self.place]
        self.tail = _tails(frames)[self.row]
        self.times, self._forward = frames.t, times.steady
        self.first: Sequence[int] = [*first.tolist(), len(codes)]
        begin = codes[self.place[first]].tolist()
        self.sessions = [_session(times.bus, code >> _KEY_BITS, code & _KEY) for code in begin]

    @cached_property
    def begins(self) -> tuple[Array, Array]:
        """Where transfers begin or go on from an earlier batch, and where each session begins among these."""
        begins = self.tail & TAIL_START != 0
        begins[1:] |= self.tail[:-1] & TAIL_END != 0
        begins[self.first[:-1]] = True
        at = np.flatnonzero(begins)
        return at, np.searchsorted(at, self.first)

    @cached_property
    def by_node(self) -> Mapping[int, Sequence[int]]:
        """Places of sessions by node."""
        found: dict[int, list[int]] = {}
        for k, session in enumerate(self.sessions):
            found.setdefault(session.node, []).append(k)
        return found

    def ends(self, sessions: Sequence[int]) -> tuple[int, int]:
        """Return the first and the last row of some sessions."""
        first = min(int(self.row[self.first[one]]) for one in sessions)
        return first, max(int(self.row[self.first[one + 1] - 1]) for one in sessions)

    def gaps(self, sessions: Sequence[int], least: int) -> Iterator[tuple[int, int, int]]:
        """Yield times in which some sessions have no frame: since when, until when, the row of the frame before.

        Args:
            sessions: places of them.
            least: shorter times are left out.
        """
        ends = self.ends(sessions)
        # Where no clock was set back, a session without gaps shows that its node has none.
        if self._forward and any(self._fills(one, ends, least) for one in sessions):
            return
        rows = np.sort(np.concatenate([self.row[self.first[one] : self.first[one + 1]] for one in sessions]))
        t = self.times[rows]
        for k in np.flatnonzero(t[1:] - t[:-1] > least).tolist():
            yield int(t[k]), int(t[k + 1]), int(rows[k])

    @cached_property
    def _begun(self) -> Array:
        """Times of transfers as they begin, in the order of sessions."""
        return self.times[self.row[self.begins[0]]]

    @cached_property
    def _widest(self) -> Array:
        """The longest time between two transfers of each session."""
        apart = np.append(np.diff(self._begun), 0)
        first = self.begins[1]
        apart[first[1:] - 1] = 0
        return np.maximum.reduceat(apart, first[:-1])

    def _fills(self, one: int, ends: tuple[int, int], least: int) -> bool:
        """Return whether a session has no gap, nor leaves one to the first and last row of others."""
        first, last = ends
        t = self._begun[self.begins[1][one : one + 2] - (0, 1)]
        early, late = t[0] - self.times[first] <= least, self.times[last] - t[1] <= least
        return bool(self._widest[one] <= least and early and late)


_known: WeakKeyDictionary[FrameTable, Mapping[int, BusFrames]] = WeakKeyDictionary()


def bus_frames(frames: FrameTable) -> Mapping[int, BusFrames]:
    """Return the frames of a batch by bus; several rules ask."""
    if frames not in _known:
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
    return _known[frames]


def first_transfers(
    t: TransferTable, good: Array | None = None, most: int = 1, *, services: bool = False
) -> Iterator[tuple[Session, int]]:
    """Yield the first rows of each session, at most so many, as they follow each other: messages that are `good`.

    They prove that a session is DroneCAN's, and no other protocol's. Requests and responses are in sessions, too, if
    `services` are wanted.
    """
    wanted = t.kind == _MESSAGE
    if services:
        wanted = wanted | (t.kind == _REQUEST) | (t.kind == _RESPONSE)
    rows = np.flatnonzero(wanted if good is None else wanted & good)
    kind, type_id = t.kind[rows], t.type_id[rows].astype(np.uint32)
    key = type_id << 1
    if services:
        asked = type_id << 9 | (kind == _REQUEST) * np.uint32(_ASKS << 1) | t.dst[rows].astype(np.uint32) << 1 | 1
        key = np.where(kind == _MESSAGE, key, asked)
    codes = (t.bus[rows].astype(np.uint32) << 7 | t.src[rows] & _NODE) << _KEY_BITS | key
    order, first = by_key(codes)
    places = first[:, None] + np.arange(most)
    some = order[places[places < np.append(first[1:], len(order))[:, None]]]
    some.sort()
    for code, row in zip(codes[some].tolist(), rows[some].tolist(), strict=True):
        yield _session(code >> _KEY_BITS + 7, code >> _KEY_BITS & _NODE, code & _KEY), row


def _session(bus: int, node: int, key: int) -> Session:
    """Return a session by its key: the type ID, in front of it what `Session` says of a service, behind it a bit."""
    return Session(bus, node, key >> 1 | (key & 1) * _SERVICE)


def _tails(frames: FrameTable) -> Array:
    """Return the last byte of each frame; that of an empty one says nothing."""
    ends, data = frames.raw
    if not len(data):
        return np.zeros(len(frames), np.uint8)
    last = np.frombuffer(data, np.uint8).take(ends[1:] - 1, mode="clip")
    last[frames.length == 0] = 0
    return last
