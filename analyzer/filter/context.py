"""One batch as a filter sees it, with what is remembered of those before."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import NOBODY, who
from analyzer.filter.columns import column_values, streams
from analyzer.filter.history import BROADCAST, spans_of
from analyzer.filter.values import NO_NUMBERS, ByteSpans, CodedWords, Values
from analyzer.tables import ERROR, EVENTS, EXTENDED, FD, KINDS, REMOTE, STATUSES
from analyzer.window.first_frames import first_frames
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Callable

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.memory import FilterMemory
    from dissectors.kit import Array

_ERROR_FRAME = EVENTS.index("error frame")
_ERROR_LENGTH = 8
_FLAGS = {"xtd": EXTENDED, "rtr": REMOTE, "err": ERROR}
_WORDS = {"kind": KINDS, "status": STATUSES}
_TIMES = ("t", "epoch", "relative")
if TYPE_CHECKING:
    FrameColumn = tuple[Array | CodedWords | ByteSpans, Array | None]
_EMPTY = np.zeros(0, np.int64)


class BatchContext:
    """Columns of a batch, made when they are asked for.

    Args:
        batch: the batch.
        memory: what is remembered.
    """

    def __init__(self, batch: Batch, memory: FilterMemory) -> None:
        self._batch, self.memory = batch, memory
        self.lagged: list[Values] = []

    @property
    def batch(self) -> Batch:
        """The batch."""
        return self._batch

    # ---- transfers

    @cached_property
    def places(self) -> tuple[Array, Array]:
        """The frames of all transfers: the row of each, and its number from 0."""
        return all_places(self.batch.transfers)

    @cached_property
    def first_places(self) -> Array:
        """The number of each transfer's first frame, from 0."""
        return first_frames(self.batch.transfers)

    def transfer(self, name: str) -> Values:
        """Return a column of transfers, a value a row."""
        table = self.batch.transfers
        if name == "type":
            return Values(None, *self.memory.type_names(table))
        column = table.column(name)
        has = valid(column) if column.null_count else None
        if name == "payload":
            return Values(None, spans_of(column), has)
        if name in _WORDS:
            return Values(None, CodedWords(numbers(column) if len(column) else _EMPTY, _WORDS[name]), has)
        return Values(None, numbers(column) if len(column) else _EMPTY, has)

    def nodes(self) -> Values:
        """Return source and destination of each transfer."""
        src, dst = self.transfer("src"), self.transfer("dst")
        rows = np.arange(src.amount)
        has = np.concatenate((src.there(), dst.there()))
        return Values(np.concatenate((rows, rows)), np.concatenate((src.plain, dst.plain)), has)

    def labels(self, nodes: Values) -> Values:
        """Return what the vehicle file calls nodes."""
        words = sorted(set(self.memory.labels.values()))
        codes = np.full(256, -1, np.int64)
        for node, label in self.memory.labels.items():
            codes[node] = words.index(label)
        found = codes[np.clip(nodes.plain.astype(np.int64), 0, 255)]
        return nodes.with_data(CodedWords(np.maximum(found, 0), words or [""]), found >= 0)

    def types(self, ref: FieldRef, wanted: Array | None) -> Values:
        """Return which transfers are of a type, broken ones too, or hold a packet."""
        found = np.zeros(len(self.batch.transfers), bool)
        for table in ref.tables:
            if self.memory.registry.message_of(table) is not None:
                found |= self.of_type(table)
            else:
                values = self._rows_of(table, wanted)
                if values is not None:
                    found[values] = True
        return Values(None, found)

    def of_type(self, table: str) -> Array:
        """Return which transfers are of the type of a table."""
        transfers = self.batch.transfers
        found = np.zeros(len(transfers), bool)
        if not len(transfers) or self.memory.registry.message_of(table) is None:
            return found
        kind, type_id, variant = (numbers(transfers.column(name)) for name in ("kind", "type_id", "variant"))
        for one_kind, one_id, one_variant in self.memory.codes(table):
            found |= (type_id == one_id) & (kind == one_kind) & (variant == one_variant)
        return found

    def table(self, ref: FieldRef, wanted: Array | None) -> Values:
        """Return a field of messages or packets, of rows in question only if there are any."""
        parts: list[Values] = []
        for table in ref.tables:
            row = self._rows_of(table, wanted)
            if row is not None:
                made = column_values(self.batch.messages[table], ref, row)
                if made is not None:
                    parts.append(made)
        if not parts:
            return self.none(ref)
        return together(parts)._replace(key=ref.tables)

    def senders(self, ref: FieldRef) -> tuple[Array, Array]:
        """Return for each value of a field whose it is, and its time."""
        keys, times = [], []
        for k, table in enumerate(ref.tables):
            rows = self._rows_of(table, None)
            if rows is not None:
                made = column_values(self.batch.messages[table], ref, np.arange(len(rows)))
                if made is not None:
                    one = self.batch.messages[table]
                    at = made.rows()
                    element = 0 if made.place is None else np.minimum(made.place, 255)
                    keys.append((streams(one, k) << 8)[at] | element)
                    times.append(numbers(one.column("t"))[at])
        return (np.concatenate(keys), np.concatenate(times)) if keys else (_EMPTY, _EMPTY)

    def _rows_of(self, table: str, wanted: Array | None) -> Array | None:
        """Return the row of each row of a table; None if there is none, or no row in question is of its type."""
        messages = self.batch.messages
        if table not in messages:
            return None
        if wanted is not None:
            outer = table if self.memory.registry.message_of(table) is not None else table.rpartition(".")[0]
            if not (self.of_type(outer) & wanted).any():
                return None
        row: Array = (numbers(messages[table].column("transfer")) - np.uint64(self.batch.first_transfer)).astype(
            np.int64
        )
        return row

    def units(self, wanted: Array | None) -> Values:
        """Return the units that packets speak of."""
        parts: list[Values] = []
        for unit, raw in self.memory.unit_fields:
            made = self.table(unit, wanted)
            if made.amount:
                parts.append(made.with_data(made.plain, self.table(raw, wanted).plain != BROADCAST))
        return together(parts) if parts else NO_NUMBERS

    def channels(self) -> Values:
        """Return the channel that each transfer speaks of, or that its node is known as."""
        return self.memory.channels.of(self)

    # ---- frames

    def of_transfers(self, name: str) -> Values:
        """Return times and interface of each transfer, those of its first frame."""
        table = self.batch.transfers
        if name == "bus":
            return Values(None, self._buses(numbers(table.column("bus")) if len(table) else _EMPTY))
        column = table.column("t")
        t = numbers(column).copy() if len(column) else _EMPTY
        has = valid(column) if column.null_count else None
        if name == "delta":
            return Values(None, *self.memory.deltas.of_transfers(self))
        return Values(None, self._time(name, t), has)

    def of_frames(self, name: str, places: Array) -> FrameColumn:
        """Return a column of frames by their numbers from 0, and which have it."""
        made: dict[str, Callable[[Array], FrameColumn]] = {
            "number": lambda at: (self.memory.numbering.of_all(at), None),
            "data": self._octets,
            "len": self._lengths,
            "delta": lambda at: self.memory.deltas.of_frames(self, at),
        }
        if name in made:
            return made[name](places)
        column = "flags" if name in _FLAGS else "t" if name in _TIMES else name
        found, has = self.memory.history.column(column, places)
        if name == "rtr":  # CAN FD has no remote frames, and no such bit
            has = found & FD == 0 if has is None else has & (found & FD == 0)
        if column == "flags":
            return found & _FLAGS[name] != 0, has
        return (self._buses(found) if name == "bus" else self._time(name, found) if column == "t" else found), has

    def _octets(self, places: Array) -> FrameColumn:
        """Return the bytes of frames; one without any has no such field, as in tshark."""
        spans, has = self.memory.history.data(places)
        some = spans.lengths > 0
        return spans, some if has is None else has & some

    def _lengths(self, places: Array) -> FrameColumn:
        spans, has = self.memory.history.data(places)
        flags, _ = self.memory.history.column("flags", places)
        return np.where(flags & REMOTE != 0, flags >> 8 & 0xF, spans.lengths), has

    def of_errors(self, name: str, rows: Array) -> Values:
        """Return a column of error frames; `rows` are those of events."""
        events = self.batch.events
        none = np.zeros(len(rows), bool)
        zeros = none.astype(np.int64)
        numbered = self.memory.numbering.of_errors(self.batch.first_frame, self.batch.frames, events)
        known: dict[str, Callable[[], Values]] = {
            "id": lambda: Values(None, zeros, none),
            "xtd": lambda: Values(None, none, none),
            "rtr": lambda: Values(None, none, none),
            "err": lambda: Values(None, ~none),
            "len": lambda: Values(None, zeros + _ERROR_LENGTH),
            "number": lambda: Values(None, numbered) if len(numbered) == len(rows) else Values(None, zeros, none),
            "data": lambda: Values(None, spans_of(events.column("data")).take(rows), none),
            "delta": lambda: Values(None, *self.memory.deltas.of_errors(self)),
        }
        if name in known:
            return known[name]()
        column = events.column("bus" if name == "bus" else "t")
        has = valid(column)
        found = np.where(has, numbers(column), 0)[rows]
        return Values(None, self._buses(found) if name == "bus" else self._time(name, found), has[rows])

    @cached_property
    def error_rows(self) -> Array:
        """The events that are error frames."""
        events = self.batch.events
        return np.flatnonzero(numbers(events.column("kind")) == _ERROR_FRAME) if len(events) else _EMPTY

    def named_by_id(self, which: str, places: Array, verdicts: Array) -> Values:
        """Return the nodes that identifiers name."""
        history = self.memory.history
        (ids, has), (flags, _) = history.column("id", places), history.column("flags", places)
        src, code = who(ids, flags, verdicts)
        service = (code != NOBODY) & (ids >> 7 & 1 == 1)
        dst = ids.astype(np.int64) >> 8 & 0x7F
        there = np.ones(len(places), bool) if has is None else has
        if which == "src":
            return Values(None, src, there & (src != NOBODY))
        if which == "dst":
            return Values(None, dst, there & service)
        rows = np.arange(len(places))
        either = np.concatenate((there & (src != NOBODY), there & service))
        return Values(np.concatenate((rows, rows)), np.concatenate((src, dst)), either)

    def findings(self, which: str, row: Array, places: Array) -> Values:
        """Return the rules that name frames, or how severe they are."""
        named = self.memory.named
        if named is None or not len(places):
            return self.none(None)
        found = named.between(int(places.min()), int(places.max()))
        words = sorted({rule for rules in found.values() for rule in rules})
        hits = (
            [(k, words.index(rule)) for k, place in enumerate(places.tolist()) for rule in found.get(place, ())]
            if found
            else []
        )
        at, codes = (np.array([pair[k] for pair in hits], np.int64) for k in (0, 1))
        shown = words if which == "rule" else [self.memory.severities.get(word, "note") for word in words]
        return Values(row[at], CodedWords(codes, shown), None, "findings")

    # ----

    def none(self, ref: FieldRef | None) -> Values:
        """Return no values at all, of the sort that a field has."""
        sort = "text" if ref is None else ref.kind.sort
        if sort == "text":
            return Values(_EMPTY, CodedWords(_EMPTY, []))
        if sort == "bytes":
            return Values(_EMPTY, ByteSpans(np.zeros(0, np.uint8), _EMPTY, _EMPTY))
        return Values(_EMPTY, np.zeros(0, bool) if sort == "flag" else _EMPTY, None, None, _EMPTY, _EMPTY)

    def _buses(self, codes: Array) -> CodedWords:
        return CodedWords(codes, self.batch.buses or ("",))

    def _time(self, name: str, t: Array) -> Array:
        return t - (self.memory.zero or 0) if name == "relative" else t


def all_places(transfers: pa.RecordBatch) -> tuple[Array, Array]:
    """Return the frames of transfers: the row of each, and its number from 0."""
    column = transfers.column("frame")
    if not len(column):
        return _EMPTY, _EMPTY
    ends = np.frombuffer(column.buffers()[1], np.int32)[column.offset : column.offset + len(column) + 1]
    places = numbers(column.values)[ends[0] : ends[-1]].astype(np.int64)
    return np.repeat(np.arange(len(column)), np.diff(ends)), places


def together(parts: list[Values]) -> Values:
    """Return values of one sort as one column."""
    if len(parts) == 1:
        return parts[0]
    has = np.concatenate([part.there() for part in parts])
    row = np.concatenate([part.rows() for part in parts])
    place = length = None
    if all(part.place is not None for part in parts):
        place, length = (np.concatenate([getattr(part, name) for part in parts]) for name in ("place", "length"))
    first = parts[0].data
    data: Array | CodedWords | ByteSpans
    if isinstance(first, CodedWords):
        words: list[str] = []
        codes = []
        for part in parts:
            codes.append(part.plain + len(words))
            words += list(part.data.words)  # type: ignore[union-attr]
        data = CodedWords(np.concatenate(codes), words)
    elif isinstance(first, ByteSpans):
        buffers, starts, ends, size = [], [], [], 0
        for part in parts:
            spans: ByteSpans = part.data  # type: ignore[assignment]
            buffers.append(spans.buffer)
            starts.append(spans.start + size)
            ends.append(spans.end + size)
            size += len(spans.buffer)
        data = ByteSpans(np.concatenate(buffers), np.concatenate(starts), np.concatenate(ends))
    else:
        data = np.concatenate([part.plain for part in parts])
    return Values(row, data, has, None, place, length)
