"""Frames and transfers by session: what a node sends of one type, and to whom if it is a service."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.tables import EXTENDED, KINDS, REMOTE, TAIL_END, TAIL_START
from dissectors.kit import times_by_bus

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.rules.bus.keyed import KeyedRows
    from dissectors.kit import Array, BusTimes, FrameTable, TransferTable

MOST_SESSIONS = 4096  # that a rule remembers
_SERVICE, _ASKS = 1 << 16, 1 << 7
_KEY_BITS = 17
_KEY = _TYPE = (1 << _KEY_BITS) - 1
_NODE = 0x7F
CODE_BITS = 24  # below the bus
_ROW_BITS = 40
_ROW = (1 << _ROW_BITS) - 1
_MESSAGE = KINDS.index("message")


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


class NodeRows(NamedTuple):
    """Nodes in a batch: where the frames of each begin and end by session, its first and its last row.

    `of_session` says which of them each session is of.
    """

    node: Array
    of_session: Array
    begin: Array
    end: Array
    first: Array
    last: Array


class NodeGaps(NamedTuple):
    """Times in which nodes have no frame, those of a node in their order.

    `of` is the place of the node among those of the batch, `row` that of the frame in front.
    """

    of: Array
    since: Array
    until: Array
    row: Array


class BusFrames:
    """Frames of a bus in a batch that have a time and a sender, one session after the other.

    `row` are rows of the batch, of which all have `times`; `place` counts among these frames. `codes` are the sessions
    as `Session.code` has them, `first` is where each begins, and where the last one ends; `messages` are places of
    those that are no services.
    """

    def __init__(self, times: BusTimes, frames: FrameTable, rows: Array | None) -> None:
        identifier = frames.id if rows is None else frames.id[rows]
        keys = (identifier & _NODE) << _KEY_BITS | identifier >> 7 & _KEY
        self.place, first = grouped(keys)
        self.row = self.place if rows is None else rows[self.place]
        self.tail = frames.tail[self.row]
        self.times, self.forward = frames.t, times.steady
        self.first = np.append(first, len(keys))
        begin = keys[self.place[first]].astype(np.int64)
        self.codes = _codes(times.bus, begin >> _KEY_BITS, begin & _KEY)
        self.messages = np.flatnonzero(begin & 1 == 0)

    @cached_property
    def begins(self) -> tuple[Array, Array]:
        """Where transfers begin or go on from an earlier batch, and where each session begins among these."""
        begins = self.tail & TAIL_START != 0
        begins[1:] |= self.tail[:-1] & TAIL_END != 0
        begins[self.first[:-1]] = True
        at = np.flatnonzero(begins)
        return at, np.searchsorted(at, self.first)

    @cached_property
    def nodes(self) -> NodeRows:
        """The nodes of these frames, in order."""
        node, first = node_of(self.codes), self.first
        begins = np.flatnonzero(np.diff(node, prepend=-1))
        ends = np.append(begins[1:], len(node))
        return NodeRows(
            node[begins], np.repeat(np.arange(len(begins)), ends - begins), first[begins], first[ends],
            np.minimum.reduceat(self.row[first[:-1]], begins), np.maximum.reduceat(self.row[first[1:] - 1], begins),
        )  # fmt: skip

    def beyond(self, some: Array, held: KeyedRows) -> Array:
        """Return a mask of the sessions, by their places, that there is no room for beside the ones that are `held`.

        Those that were heard first go first, whatever their nodes and types are.
        """
        codes = self.codes[some]
        found: Array = ~held.has(codes)
        new = np.flatnonzero(found)
        if len(new) > held.room:
            new = new[np.argsort(self.place[self.first[some[new]]], kind="stable")]
        found[new[: held.room]] = False
        return found

    def gaps(self, least: int, most: int) -> NodeGaps:
        """Return times in which nodes have no frame, those longer than `least`: so many of a node, the last ones."""
        some = np.flatnonzero(~self._without_gaps(least))
        begin, size = self.nodes.begin[some], self.nodes.end[some] - self.nodes.begin[some]
        of = np.repeat(np.arange(len(some)), size)
        stop = np.cumsum(size)
        rows = self.row[np.arange(len(of)) + np.repeat(begin + size - stop, size)]
        in_turn = of << _ROW_BITS | rows
        in_turn.sort()
        rows = in_turn & _ROW
        t = self.times[rows]
        at = np.flatnonzero((t[1:] - t[:-1] > least) & (of[1:] == of[:-1]))
        if len(at) > most:
            at = at[np.searchsorted(of[at], of[at], "right") - np.arange(len(at)) <= most]
        return NodeGaps(some[of[at]], t[at], t[at + 1], rows[at])

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

    def _without_gaps(self, least: int) -> Array:
        """Return which nodes have a session without a gap, that leaves none to the node's first and last row either.

        Where a clock was set back, that shows nothing.
        """
        nodes, first = self.nodes, self.begins[1]
        if not self.forward:
            return np.zeros(len(nodes.node), bool)
        if self.times[nodes.last.max()] - self.times[nodes.first.min()] <= least:
            return np.ones(len(nodes.node), bool)
        early = self._begun[first[:-1]] - self.times[nodes.first][nodes.of_session] <= least
        late = self.times[nodes.last][nodes.of_session] - self._begun[first[1:] - 1] <= least
        found = np.zeros(len(nodes.node), bool)
        found[nodes.of_session[early & late & (self._widest <= least)]] = True
        return found


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


def first_rows(t: TransferTable) -> tuple[Array, Array]:
    """Return the first row of each session of messages, as they follow each other.

    In front of them are the codes of their sessions.
    """
    rows = np.flatnonzero(t.kind == _MESSAGE)
    sender = t.bus[rows].astype(np.uint32) << 7 | t.src[rows] & _NODE
    keys = sender << _KEY_BITS | t.type_id[rows].astype(np.uint32) << 1
    order, first = grouped(keys)
    some = np.sort(order[first])
    one = keys[some].astype(np.int64)
    return _codes(one >> _KEY_BITS + 7, one >> _KEY_BITS & _NODE, one & _KEY), rows[some]


def node_of(codes: Array) -> Array:
    """Return the nodes of sessions by their codes."""
    found: Array = codes >> _KEY_BITS & _NODE
    return found


def _codes(bus: int | Array, node: Array, key: Array) -> Array:
    """Return codes of sessions by keys: the type ID, before it what `Session` says of a service, behind it a bit."""
    found: Array = bus << CODE_BITS | node << _KEY_BITS | key >> 1 | (key & 1) * _SERVICE
    return found
