"""Requests and responses: which belong together, and how long answers take."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from analyzer._native import Calls
from analyzer.decode.sent import cells
from analyzer.facts.identifiers import NOBODY
from analyzer.rules.bus.heard import HeardNodes
from analyzer.rules.recent import MOST_LINES
from analyzer.rules.transfers.lists import Lists, placed
from analyzer.tables import EXTENDED, KINDS, STATUSES, distinct
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, Rule, by_key

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import Cells
    from dissectors.kit import Array, Severity, TransferTable, Values, View

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
# Of the identifier of a service frame: that it is one, that it asks, and all but the priority and these.
_SERVICE, _ASKS, _LINK = 1 << 7, 1 << 15, 0xFF_7F7F

_STRAY, _MISSED, _SLOW, _REPEATED, _PRIORITY = range(5)  # what the core says of a transfer


class _Parts:
    """Requests and responses, a row each, cells are i64.

    `lines` are those of a transfer of an earlier batch, whose frames may be gone when it is told, else None.
    """

    def __init__(self, cells: Array, lines: Array, frames: Lists) -> None:
        self._cells, self.lines, self._frames = cells, lines, frames
        self.t, self.t_end, self.bus, self.src, self.dst, self.code, self.priority, self.transfer_id = cells

    @classmethod
    def none(cls) -> Self:
        """Return no rows."""
        return cls(np.empty((8, 0), np.int64), np.empty(0, object), Lists.none(np.int64))

    @classmethod
    def of(cls, t: TransferTable, rows: Array) -> Self:
        """Return rows of a batch."""
        columns = t.t, t.t_end, t.bus, t.src, t.dst, t.code, t.priority, t.transfer_id
        cells = np.empty((len(columns), len(rows)), np.int64)
        for k, column in enumerate(columns):
            cells[k] = column[rows]
        offsets, numbers = Lists(*t.frame_lists).take(rows)
        return cls(cells, np.full(len(rows), None), Lists(offsets, numbers.astype(np.int64)))

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes once its lines are kept."""
        return self

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.t)

    def joined(self, more: _Parts) -> _Parts:
        """Return these and others behind them."""
        cells = np.concatenate((self._cells, more._cells), axis=1)
        return _Parts(cells, np.concatenate((self.lines, more.lines)), self._frames.joined(more._frames))

    def take(self, rows: Array) -> _Parts:
        """Return some of them."""
        return _Parts(self._cells.take(rows, axis=1), self.lines[rows], self._frames.take(rows))

    @property
    def first(self) -> Array:
        """The number of the first frame of each."""
        return self._frames.cells[self._frames.offsets[:-1]]

    def frames(self, k: int) -> tuple[int, ...]:
        """Return the numbers of the frames of one."""
        return tuple(self._frames.one(k))

    def evidence(self, view: View, k: int) -> tuple[str, ...]:
        """Return one as candump writes it."""
        kept: tuple[str, ...] | None = self.lines[k]
        return view.lines(self.frames(k)) if kept is None else kept

    def keep_lines(self, view: View) -> None:
        """Keep the lines of those of this batch."""
        rows = np.flatnonzero(self.lines == None)  # noqa: E711 - of each one
        if not len(rows):
            return
        offsets, numbers = self._frames
        begin = offsets[rows]
        ends, places = placed(begin, np.minimum(offsets[rows + 1] - begin, MOST_LINES))
        every = view.each_line(numbers[places]).tolist()
        for k, low, high in zip(rows.tolist(), ends[:-1].tolist(), ends[1:].tolist(), strict=True):
            self.lines[k] = tuple(filter(None, every[low:high]))


class Services(Rule):
    """Follows calls by (interface, service, client, server, transfer ID).

    The core holds a session back until it is proven, so a request can come out long after its response. Each transfer
    waits for `LATE`, and a response for the first request of its session, a request for a sign of its server and for a
    response that may have been sent, but is held back.
    """

    rules: ClassVar[tuple[str, ...]] = ("TRF-021", "TRF-022", "TRF-023", "TRF-024", "TRF-025")

    def __init__(self) -> None:
        self._calls = Calls(ANSWER, SLOW, OPEN, LATE, MOST, MOST_LINKS)
        self._kept = _Parts.none()  # what may still be told
        self._nodes = HeardNodes(_GONE)
        self._heard = np.zeros(_NODES << 8, bool)  # by bus and node
        self._now = NO_TIME

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield calls of this batch, and those whose time is over."""
        self._note_held(view)
        self._nodes.feed(view.frames)
        t = view.transfers
        if not len(t):
            return
        now = np.maximum.accumulate(np.maximum(t.t_end, self._now))
        rows = np.flatnonzero(t.kind >= REQUEST)
        new = _Parts.of(t, rows)
        asks = t.kind[rows] == REQUEST
        client, server = np.where(asks, new.src, new.dst), np.where(asks, new.dst, new.src)
        link = new.bus << 32 | t.type_id[rows].astype(np.int64) << 16 | client << 8 | server
        small = (column.astype(np.uint8) for column in (new.transfer_id, new.priority, asks, _WHOLE[t.status[rows]]))
        given = link, new.first, new.t, new.t_end, now[rows], *small, rows
        parts, self._now = self._kept.joined(new), int(now[-1])
        heard = self._first_heard(t.bus.astype(np.int64) * _NODES + t.src)
        found = self._calls.feed(given, heard, len(self._kept), self._now, view.end)
        yield from self._told(view, parts, found)
        self._kept = parts.take(cells(self._calls.living(), np.int64))
        self._kept.keep_lines(view)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what the end of the capture leaves open."""
        yield from self._told(view, self._kept, self._calls.finish(view.end))

    def _note_held(self, view: View) -> None:
        """Note links with frames that look like a response, whether or not that is out yet."""
        frames = view.frames
        rows = np.flatnonzero((frames.id & (_SERVICE | _ASKS) == _SERVICE) & (frames.flags & EXTENDED != 0))
        if len(rows):
            links = distinct(frames.bus[rows].astype(np.int64) << 32 | frames.id[rows] & _LINK)
            self._calls.hold(np.array(links, np.int64))

    def _first_heard(self, who: Array) -> tuple[Array, Array]:
        """Return the first row of each node that was not heard before, in order, and the node."""
        new = np.flatnonzero(~self._heard[who])
        order, begins = by_key(who[new])
        rows = np.sort(new[order[begins]])
        self._heard[who[rows]] = True
        return rows, who[rows]

    def _told(self, view: View, parts: _Parts, found: tuple[Cells, Cells, Cells]) -> Iterator[Occurrences | Occurrence]:
        """Yield what the core says of transfers."""
        kind, part, other = (cells(column, np.int64) for column in found)
        if not len(kind):
            return
        single = kind != _MISSED
        for what, k, beside in zip(*(column[single].tolist() for column in (kind, part, other)), strict=True):
            transfer_id, priority = parts.transfer_id.item(k), parts.priority.item(k)
            if what == _STRAY:
                yield from _stray(view, parts, k, transfer_id)
            elif what == _SLOW:
                seconds = (parts.t_end.item(k) - parts.t_end.item(beside)) / SECOND
                yield _about(view, "TRF-023", parts, k, {"seconds": seconds}, beside)
            elif what == _REPEATED:
                yield _about(view, "TRF-024", parts, k, {"transfer_id": transfer_id}, beside)
            else:
                values = {"expected": parts.priority.item(beside), "priority": priority}
                yield _about(view, "TRF-025", parts, k, values, beside)
        missed = part[~single]
        if len(missed):
            yield from self._unanswered(view, parts.take(missed))

    def _unanswered(self, view: View, parts: _Parts) -> Iterator[Occurrences]:
        """Report calls without an answer, unless that may have come in a gap."""
        until = parts.t_end + ANSWER
        alive = ~self._nodes.silent(parts.bus * _NODES + parts.dst, until, view.end)
        if view.paused(int(parts.t_end.min()), int(until.max())):  # else there is no gap anywhere near
            for k in np.flatnonzero(alive).tolist():
                alive[k] = not view.paused(parts.t_end.item(k), until.item(k))
        rows = np.flatnonzero(alive)
        if not len(rows):
            return
        missed = parts.take(rows)
        yield Occurrences(
            rule="TRF-022", t=missed.t, bus=missed.bus, node=np.where(missed.src, missed.src, NOBODY),
            type=missed.code, frame=missed.first,
            values=lambda k: {"dst": missed.dst.item(k), "limit_s": ANSWER / SECOND},
            frames=missed.frames, drops=True, until=until[rows], each_named=True,
            lines=lambda k: missed.evidence(view, k),
        )  # fmt: skip


def _stray(view: View, parts: _Parts, k: int, transfer_id: int) -> Iterator[Occurrence]:
    """Yield a response without a request, unless that was before a window began."""
    t = parts.t.item(k)
    begun = NO_TIME if t == NO_TIME else max(view.starts[parts.bus.item(k)], view.resumed(t))
    early = t == NO_TIME or t - begun < OPEN
    if early and view.cut_in:
        return
    values = {"transfer_id": transfer_id, "dst": parts.dst.item(k)}
    severity: Severity | None = "note" if early else None
    yield _about(view, "TRF-021", parts, k, values, severity=severity, drops=True, since=t - OPEN)


def _about(
    view: View, rule: str, parts: _Parts, k: int, values: Values, other: int | None = None, **more: Any
) -> Occurrence:
    """Return one breach, with the transfer it is compared with behind it."""
    frames, lines = parts.frames(k), parts.evidence(view, k)
    if other is not None:
        frames, lines = (*frames, *parts.frames(other)), (*lines, *parts.evidence(view, other))
    type_ = view.type_name(parts.code.item(k))
    who = parts.t.item(k), parts.bus.item(k), parts.src.item(k) or None
    return Occurrence(rule, *who, type_, frames, values, lines=lines, **more)
