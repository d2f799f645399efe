"""Requests and responses: which belong together, and how long answers take."""

from __future__ import annotations

from itertools import islice, pairwise
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from analyzer._native import Calls
from analyzer.decode.sent import cells
from analyzer.facts.identifiers import NOBODY
from analyzer.rules.bus.heard import HeardNodes
from analyzer.rules.recent import MOST_LINES, NO_FRAME, soon_gone
from analyzer.rules.transfers.lists import Lists
from analyzer.tables import EXTENDED, KINDS, STATUSES, distinct
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, Rule, all_resumed, by_key

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analyzer._native import Cells
    from dissectors.kit import Array, TransferTable, View

REQUEST, RESPONSE = KINDS.index("request"), KINDS.index("response")
ANSWER = SECOND  # when a client gives up
SLOW = SECOND // 2
OPEN = 2 * SECOND  # how long a response belongs to a request
_GONE = 2 * SECOND  # a server that sends nothing for so long lives no more
LATE = 3 * SECOND  # a request can come out 2.0 s after its start, if its end was lost
MOST = 256  # transfers of a link that wait
MOST_LINKS = 1024  # older ones are left out
_WHOLE = np.array([word in {"ok", "unchecked", "bad crc"} for word in STATUSES])
_NODES = 128
_LEAST = 64  # slots
_SIZE = 8  # bytes of the number of a frame
# Of the identifier of a service frame: that it is one, that it asks, and all but the priority and these.
_SERVICE, _ASKS, _LINK = 1 << 7, 1 << 15, 0xFF_7F7F

_STRAY, _MISSED, _SLOW, _REPEATED = range(4)  # what the core says of a transfer, or that its priority is another one
_RULES = ("TRF-021", "TRF-022", "TRF-023", "TRF-024", "TRF-025")


class _Parts:
    """Requests and responses, a row each: cells are i64, and the numbers of all frames, 8 bytes each.

    `lines` is the text of a transfer whose frames may be gone when it is told, else None; `unread` is its first frame
    as long as there is none. Bytes and texts are nothing for the garbage collector to go through.
    """

    def __init__(self, cells: Array, frames: Array, lines: Array) -> None:
        self._cells, self._frames, self._lines = cells, frames, lines
        (
            self.t, self.t_end, self.bus, self.src, self.dst, self.code, self.priority, self.transfer_id,
            self.first, self._unread,
        ) = cells  # fmt: skip

    @classmethod
    def blank(cls, rows: int) -> Self:
        """Return rows for transfers that are not there yet."""
        cells = np.zeros((10, rows), np.int64)
        cells[-1] = NO_FRAME
        return cls(cells, np.full(rows, None), np.full(rows, None))

    @classmethod
    def of(cls, t: TransferTable, rows: Array) -> Self:
        """Return rows of a batch."""
        columns = t.t, t.t_end, t.bus, t.src, t.dst, t.code, t.priority, t.transfer_id, t.lead, t.lead
        cells = np.empty((len(columns), len(rows)), np.int64)
        for place, column in enumerate(columns):
            cells[place] = column[rows]
        offsets, numbers = Lists(*t.frame_lists).take(rows)
        every, frames = numbers.astype(np.int64).tobytes(), np.empty(len(rows), object)
        for k, (begin, end) in enumerate(pairwise((offsets * _SIZE).tolist())):
            frames[k] = every[begin:end]
        return cls(cells, frames, np.full(len(rows), None))

    def __deepcopy__(self, _memo: object) -> Self:
        """Copy the columns: what is in them never changes."""
        return type(self)(self._cells.copy(), self._frames.copy(), self._lines.copy())

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.t)

    def take(self, rows: Array) -> Self:
        """Return some of them."""
        return type(self)(self._cells.take(rows, axis=1), self._frames[rows], self._lines[rows])

    def put(self, rows: Array, parts: _Parts) -> None:
        """Put others in place of some."""
        self._cells[:, rows] = parts._cells
        self._frames[rows], self._lines[rows] = parts._frames, parts._lines

    def clear(self, rows: Array) -> None:
        """Leave none in place of some."""
        self._unread[rows], self._frames[rows], self._lines[rows] = NO_FRAME, None, None

    def twice(self) -> Self:
        """Return these in twice as many rows."""
        found = self.blank(2 * len(self))
        found.put(np.arange(len(self)), self)
        return found

    def frames(self, k: int) -> tuple[int, ...]:
        """Return the numbers of the frames of one."""
        return tuple(np.frombuffer(self._frames[k], np.int64).tolist())

    def told(self) -> list[list[int]]:
        """Return times, ends, buses, senders, destinations, types, priorities and transfer IDs."""
        found: list[list[int]] = self._cells[:-2].tolist()
        return found

    def evidence(self, view: View) -> Callable[[int], tuple[str, ...]]:
        """Return what gives each as candump writes it, when its frames may be gone."""
        unread = [k for k, kept in enumerate(self._lines) if kept is None]
        read = dict(zip(unread, _lines_of(view, self._frames[unread]), strict=True))

        def lines(k: int) -> tuple[str, ...]:
            found = read.get(k)
            return tuple(self._lines[k].splitlines()) if found is None else found

        return lines

    def keep_lines(self, view: View, end: int) -> None:
        """Keep the lines of those that begin before frame `end`."""
        rows = (self._unread < end).nonzero()[0]
        if len(rows):
            for k, lines in zip(rows.tolist(), _lines_of(view, self._frames[rows]), strict=True):
                self._lines[k] = "\n".join(lines)
            self._unread[rows] = NO_FRAME


def _lines_of(view: View, frames: Array) -> Iterator[tuple[str, ...]]:
    """Yield the lines of some lists of frames, numbers of 8 bytes each; frames that are gone have none."""
    some = [numbers[: MOST_LINES * _SIZE] for numbers in frames]
    every = iter(view.each_line(np.frombuffer(b"".join(some), np.int64)).tolist())
    for numbers in some:
        yield tuple(filter(None, islice(every, len(numbers) // _SIZE)))


class Services(Rule):
    """Follows calls by (interface, service, client, server, transfer ID).

    The core holds a session back until it is proven, so a request can come out long after its response. Each transfer
    waits for `LATE`, and a response for the first request of its session, a request for a sign of its server and for a
    response that may have been sent, but is held back.
    """

    rules: ClassVar[tuple[str, ...]] = _RULES

    def __init__(self) -> None:
        self._calls = Calls(ANSWER, SLOW, OPEN, LATE, MOST, MOST_LINKS)
        self._kept = _Parts.blank(_LEAST)  # what may still be told, each in a slot
        self._nodes = HeardNodes(_GONE)
        self._heard = np.zeros(_NODES << 8, bool)  # by bus and node
        self._now = NO_TIME

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield calls of this batch, and those whose time is over."""
        self._note_held(view)
        self._nodes.feed(view.frames)
        if len(view.transfers):
            yield from self._follow(view, view.transfers)
        self._kept.keep_lines(view, soon_gone(view.frames))

    def _follow(self, view: View, t: TransferTable) -> Iterator[Occurrences | Occurrence]:
        """Yield calls of the transfers of a batch, and keep those of which more may be told."""
        rows, begin = (t.kind >= REQUEST).nonzero()[0], len(self._kept)
        now = np.maximum(np.maximum.accumulate(t.t_end)[rows], self._now) if len(rows) else rows
        self._now = max(int(t.t_end.max()), self._now)
        heard = self._first_heard(t.bus * np.int64(_NODES) + t.src)
        found = self._calls.feed((*_given(t, rows), now, rows), heard, begin, self._now, view.end)
        yield from self._told(view, rows, found)
        self._keep(t, rows, *(cells(column, np.int64) for column in self._calls.keep(begin)))

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what the end of the capture leaves open."""
        yield from self._told(view, np.empty(0, np.int64), self._calls.finish(view.end))

    def _keep(self, t: TransferTable, rows: Array, new: Array, slots: Array, left: Array) -> None:
        """Keep the transfers in these places among rows of the batch, and no more those in slots that were left."""
        if len(left):
            self._kept.clear(left)
        if len(new):
            while slots.max() >= len(self._kept):
                self._kept = self._kept.twice()
            self._kept.put(slots, _Parts.of(t, rows[new]))

    def _note_held(self, view: View) -> None:
        """Note links with frames that look like a response, whether or not that is out yet."""
        frames = view.frames
        rows = ((frames.id & (_SERVICE | _ASKS) == _SERVICE) & (frames.flags & EXTENDED != 0)).nonzero()[0]
        if len(rows):
            links = distinct(frames.bus[rows].astype(np.int64) << 32 | frames.id[rows] & _LINK)
            self._calls.hold(np.array(links, np.int64))

    def _first_heard(self, who: Array) -> tuple[Array, Array]:
        """Return the first row of each node that was not heard before, in order, and the node."""
        new = (~self._heard[who]).nonzero()[0]
        if not len(new):
            return new, new
        order, begins = by_key(who[new])
        rows = np.sort(new[order[begins]])
        self._heard[who[rows]] = True
        return rows, who[rows]

    def _parts(self, view: View, rows: Array, names: Array) -> _Parts:
        """Return transfers by their slots, or by their places among rows of the batch, counted on from these."""
        begin = len(self._kept)
        old, new = (names < begin).nonzero()[0], (names >= begin).nonzero()[0]
        found = _Parts.blank(len(names))
        found.put(old, self._kept.take(names[old]))
        found.put(new, _Parts.of(view.transfers, rows[names[new] - begin]))
        return found

    def _told(self, view: View, rows: Array, found: tuple[Cells, Cells, Cells]) -> Iterator[Occurrences | Occurrence]:
        """Yield what the core says of transfers."""
        kind, part, other = (cells(column, np.int64) for column in found)
        if not len(kind):
            return
        parts = self._parts(view, rows, np.concatenate((part, other[other >= 0])))
        beside = np.cumsum(other >= 0) - 1 + len(part)
        missed = (kind == _MISSED).nonzero()[0]
        if len(missed) < len(kind):
            rows = (kind != _MISSED).nonzero()[0]
            yield from _each(view, parts, kind[rows].tolist(), rows.tolist(), beside[rows].tolist())
        if len(missed):
            yield from self._unanswered(view, parts.take(missed))

    def _unanswered(self, view: View, parts: _Parts) -> Iterator[Occurrences]:
        """Report calls without an answer, unless that may have come in a gap."""
        until = parts.t_end + ANSWER
        alive = ~self._nodes.silent(parts.bus * _NODES + parts.dst, until, view.end)
        if view.paused(int(parts.t_end.min()), int(until.max())):  # else there is no gap anywhere near
            for k in alive.nonzero()[0].tolist():
                alive[k] = not view.paused(parts.t_end.item(k), until.item(k))
        rows = alive.nonzero()[0]
        if not len(rows):
            return
        missed = parts.take(rows)
        yield Occurrences(
            rule="TRF-022", t=missed.t, bus=missed.bus, node=np.where(missed.src, missed.src, NOBODY),
            type=missed.code, frame=missed.first,
            values=lambda k: {"dst": missed.dst.item(k), "limit_s": ANSWER / SECOND},
            frames=missed.frames, drops=True, until=until[rows], each_named=True,
            lines=missed.evidence(view),
        )  # fmt: skip


def _given(t: TransferTable, rows: Array) -> tuple[Array, ...]:
    """Return what the core follows calls by: links, first frames, times, and transfer ID, priority, kind and status."""
    src, dst, asks = t.src[rows].astype(np.int64), t.dst[rows].astype(np.int64), t.kind[rows] == REQUEST
    client, server = np.where(asks, src, dst), np.where(asks, dst, src)
    link = t.bus[rows].astype(np.int64) << 32 | t.type_id[rows].astype(np.int64) << 16 | client << 8 | server
    small = t.transfer_id[rows], t.priority[rows], asks, _WHOLE[t.status[rows]]
    return link, t.lead[rows], t.t[rows], t.t_end[rows], *(column.astype(np.uint8) for column in small)


def _each(
    view: View, parts: _Parts, kinds: Iterable[int], rows: Iterable[int], others: Iterable[int]
) -> Iterator[Occurrence]:
    """Yield what is said of transfers, one by one; others are those that they are compared with."""
    lines, early = parts.evidence(view), _early(view, parts).tolist()
    t, t_end, bus, src, dst, code, priority, transfer_id = parts.told()
    names = {one: view.type_name(one) for one in set(code)}
    for kind, k, other in zip(kinds, rows, others, strict=True):
        whose = _RULES[kind], t[k], bus[k], src[k] or None, names[code[k]]
        if kind == _STRAY:
            if early[k] and view.cut_in:
                continue
            yield Occurrence(
                *whose, parts.frames(k), {"transfer_id": transfer_id[k], "dst": dst[k]}, lines=lines(k),
                severity="note" if early[k] else None, drops=True, since=t[k] - OPEN,
            )  # fmt: skip
            continue
        if kind == _SLOW:
            values = {"seconds": (t_end[k] - t_end[other]) / SECOND}
        elif kind == _REPEATED:
            values = {"transfer_id": transfer_id[k]}
        else:
            values = {"expected": priority[other], "priority": priority[k]}
        frames = (*parts.frames(k), *parts.frames(other))
        yield Occurrence(*whose, frames, values, lines=(*lines(k), *lines(other)))


def _early(view: View, parts: _Parts) -> Array:
    """Return a mask of transfers close behind the begin of their bus, or a gap, or without a time."""
    timed = parts.t != NO_TIME
    starts = np.array([view.starts.get(bus, NO_TIME) for bus in range(int(parts.bus.max()) + 1)], np.int64)
    begun = np.maximum(starts[parts.bus], all_resumed(view, parts.t))
    early: Array = parts.t - np.where(timed, begun, NO_TIME) < OPEN
    return early
