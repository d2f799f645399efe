"""When each node, and each type that it sends, was heard: by the identifiers of frames, whatever became of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from analyzer.tables import EXTENDED, REMOTE, TAIL_END, TAIL_ID, TAIL_START, TRANSFER_IDS
from dissectors.kit import rows_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, FrameTable

_NODES = 128
_OTHER = 0  # types beyond the first 511, and services where they do not matter
_NEW = np.uint16(0xFFFF)
_MOST_TYPES = 512
_MOST_GAPS = 256  # of a node, the latest
MOST_SESSIONS = 4096
_SERVICE, _ASKS = 1 << 16, 1 << 7


class Session(NamedTuple):
    """A type that a node sends to all; or a service, whose type ID has all bits that `service_of` says."""

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


def service_of(type_id: Array, dst: Array, *, asks: Array) -> Array:
    """Return what sessions of requests or answers have as their type IDs."""
    found: Array = _SERVICE | type_id << 8 | asks * _ASKS | dst
    return found


class Starts(NamedTuple):
    """Transfers of a session as they begin: times, numbers of frames, and how many were left out by their IDs."""

    t: Array
    number: Array
    lost: Array


class Gap(NamedTuple):
    """A time without a frame of a node, and the frame before it: its number, and its line if that is old."""

    start: int
    stop: int
    number: int
    lines: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class HeardNode:
    """A node: its last frame, and when it was not heard."""

    t: int
    number: int
    lines: tuple[str, ...] = ()
    gaps: list[Gap] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class _Last:
    """The last frame of a session: whether it was the end of a transfer, its ID, and how many were left out."""

    ended: bool = True
    transfer_id: int = -1
    lost: int = 0


class _Ours:
    """Frames of a bus that have a time and a sender."""

    def __init__(self, frames: FrameTable, rows: Array) -> None:
        self.rows, self.identifier, self._t = rows, frames.id[rows], frames.t

    @cached_property
    def by_node(self) -> tuple[Array, Array, Array, Array]:
        """Rows, nodes and times in the order of nodes, and where each node begins."""
        node = (self.identifier & 0x7F).astype(np.uint8)
        order = np.argsort(node, kind="stable")
        node, rows = node[order], self.rows[order]
        return rows, node, self._t[rows], np.flatnonzero(np.diff(node, prepend=0))


_known: WeakKeyDictionary[FrameTable, Mapping[int, _Ours]] = WeakKeyDictionary()


def _ours(frames: FrameTable) -> Mapping[int, _Ours]:
    """Return the frames of a batch by bus; several rules ask."""
    if frames not in _known:
        found = {}
        plain = (frames.flags & (EXTENDED | REMOTE) == EXTENDED) & (frames.id & 0x7F != 0)
        for bus, rows in rows_by_bus(frames.bus, frames.t):
            mine = np.flatnonzero(plain) if rows is None else rows[plain[rows]]
            if len(mine):
                found[bus] = _Ours(frames, mine)
        _known[frames] = found
    return _known[frames]


class HeardNodes:
    """Follows the frames of each node; nodes are at most 127 an interface.

    Args:
        least: shorter times without a frame, in ns, are no gaps.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self._nodes: dict[tuple[int, int], HeardNode] = {}

    def all(self) -> Iterable[tuple[int, HeardNode]]:
        """Return all nodes, each with its bus."""
        return [(bus, heard) for (bus, _), heard in self._nodes.items()]

    def gaps(self, bus: int, node: int, start: int, stop: int) -> list[Gap]:
        """Return when a node was not heard between two times."""
        heard = self._nodes.get((bus, node))
        return [] if heard is None else [gap for gap in heard.gaps if start <= gap.start and gap.stop <= stop]

    def silent(self, bus: int, node: int, t: int, end: int) -> bool:
        """Return whether a node that was heard lies in a gap at a time; `end` is the last time so far."""
        heard = self._nodes.get((bus, node))
        if heard is None:
            return False
        last = heard.t <= t and end - heard.t > self._least
        return last or any(gap.start <= t < gap.stop for gap in heard.gaps)

    def feed(self, frames: FrameTable) -> None:
        """Add a batch."""
        for bus, ours in _ours(frames).items():
            self._add(bus, frames.first, ours)

    def _add(self, bus: int, start: int, ours: _Ours) -> None:
        rows, node, t, first = ours.by_node
        far = np.flatnonzero(t[1:] - t[:-1] > self._least) + 1
        far = np.setdiff1d(far, first)
        for k in first.tolist():
            known = self._nodes.get((bus, int(node[k])))
            if known is None:
                self._nodes[bus, int(node[k])] = HeardNode(int(t[k]), -1)
            elif t[k] - known.t > self._least:
                known.gaps.append(Gap(known.t, int(t[k]), known.number, known.lines))
        for k in far.tolist():
            number = start + int(rows[k - 1])
            self._nodes[bus, int(node[k])].gaps.append(Gap(int(t[k - 1]), int(t[k]), number))
        for k in [*(first[1:] - 1).tolist(), len(t) - 1]:
            heard = self._nodes[bus, int(node[k])]
            heard.t, heard.number, heard.lines = int(t[k]), start + int(rows[k]), ()
            del heard.gaps[:-_MOST_GAPS]


class SessionFrames(NamedTuple):
    """Frames of a session in a batch: rows, tail bytes, times, and their places among all frames of the bus."""

    row: Array
    tail: Array
    t: Array
    place: Array


class SessionOrder:
    """Puts the frames of a batch in the order of sessions; at most 511 types are told apart.

    Args:
        services: whether services are sessions, too.
    """

    def __init__(self, *, services: bool = False) -> None:
        self._types = np.full(_SERVICE << 1, _NEW)
        if not services:
            self._types[_SERVICE:] = _OTHER
        self._numbers = [-1]  # type IDs by what `_types` says

    def of(self, frames: FrameTable) -> Iterator[tuple[Session, SessionFrames]]:
        """Yield the sessions of a batch; places count frames that have a time and a sender."""
        for bus, ours in _ours(frames).items():
            yield from self._sessions(bus, ours, frames)

    def _sessions(self, bus: int, ours: _Ours, frames: FrameTable) -> Iterator[tuple[Session, SessionFrames]]:
        identifier = ours.identifier
        type_id = (identifier >> 8 & 0xFFFF) | (identifier & 0x80) << 9
        code = self._types[type_id]
        if (code == _NEW).any():
            self._number(type_id[code == _NEW])
            code = self._types[type_id]
        code = code << 7 | (identifier & 0x7F).astype(np.uint16)
        order = np.argsort(code, kind="stable")
        order = order[np.searchsorted(code[order], _NODES) :]  # without what is no session
        if not len(order):
            return
        code, rows = code[order], ours.rows[order]
        tail, t = _tails(frames, rows), frames.t[rows]
        first = np.flatnonzero(np.diff(code, prepend=0)).tolist()
        for a, b in zip(first, [*first[1:], len(rows)], strict=True):
            session = Session(bus, int(code[a]) & 0x7F, self._numbers[int(code[a]) >> 7])
            yield session, SessionFrames(rows[a:b], tail[a:b], t[a:b], order[a:b])

    def _number(self, type_ids: Array) -> None:
        for type_id in np.unique(type_ids).tolist():
            full = len(self._numbers) >= _MOST_TYPES
            self._types[type_id] = _OTHER if full else len(self._numbers)
            if not full:
                self._numbers.append(type_id)


class HeardSessions:
    """Follows the frames of each type of a node: at most 4096 of these, and 511 types."""

    def __init__(self) -> None:
        self._order = SessionOrder()
        self._last: dict[Session, _Last] = {}

    def feed(self, frames: FrameTable) -> Iterator[tuple[Session, Starts]]:
        """Add a batch; yield what began of each session."""
        for session, (row, tail, t, _) in self._order.of(frames):
            if session not in self._last and len(self._last) >= MOST_SESSIONS:
                continue
            last = self._last.setdefault(session, _Last())
            begins = np.append(last.ended, tail[:-1] & TAIL_END != 0) | (tail & TAIL_START != 0)
            at = np.flatnonzero(begins)
            last.ended = bool(tail[-1] & TAIL_END)
            if len(at):
                yield session, Starts(t[at], frames.first + row[at], _lost(tail[at] & TAIL_ID, last))


def _lost(transfer_id: Array, last: _Last) -> Array:
    """Return how many IDs were left out before each of these, from the first transfer of the session on."""
    ids = transfer_id.astype(np.int64)
    before = last.transfer_id if last.transfer_id >= 0 else int(ids[0]) - 1
    lost = last.lost + np.cumsum(np.maximum(np.diff(ids, prepend=before) % TRANSFER_IDS - 1, 0))
    last.transfer_id, last.lost = int(ids[-1]), int(lost[-1])
    return lost


def _tails(frames: FrameTable, rows: Array) -> Array:
    """Return the last byte of each frame; that of an empty one says nothing."""
    ends, data = frames.raw
    last = (
        np.frombuffer(data, np.uint8).take(ends[1:] - 1, mode="clip") if len(data) else np.zeros(len(frames), np.uint8)
    )
    last[frames.length == 0] = 0
    return last[rows]
