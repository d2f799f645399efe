"""The rows that a rule of a vehicle file looks at, one a message or packet, and what they and others have told."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from analyzer.filter.columns import column_values
from analyzer.filter.context import together
from analyzer.filter.rowsets import RowSet, TransferSet
from analyzer.filter.values import ByteSpans, CodedWords, Values, spread
from dissectors.kit import sound, usable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.filter.context import BatchContext
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.nodes import LagNode
    from analyzer.rules.view import BatchView
    from dissectors.kit import Array, DecodedTable

Number = TypeVar("Number", int, "Array")
MOST_HELD = 4096  # senders and devices whose last values of a field are kept
NO_DEVICE = 0
_UNITS, _MOST_DEVICE = 255, 2047  # units of packets come first, channels of ESCs behind them
_NONE = np.zeros(0, np.int64)


class RowsAtHand(NamedTuple):
    """Rows of tables of one type, in the order of their transfers.

    `owner` are rows of transfers, `table` places in the list of tables (-1: transfers as such), `at` rows of those
    tables, `device` numbers of what a row speaks of: a unit or a channel, `NO_DEVICE` for neither.
    """

    owner: Array
    table: Array
    at: Array
    device: Array


def rows_at_hand(view: BatchView, tables: Sequence[str]) -> RowsAtHand:
    """Return the sound rows of tables; of no tables all transfers."""
    if not tables:
        every = np.arange(len(view.transfers))
        return RowsAtHand(every, np.full(len(every), -1), every, np.zeros(len(every), np.int64))
    parts = []
    for k, name in enumerate(tables):
        table = view.table(name)
        if table is not None:
            at = np.flatnonzero(sound(table) if "packet_ok" in table else usable(table))
            parts.append(RowsAtHand(table.row[at], np.full(len(at), k), at, _device(table)[at]))
    if not parts:
        return RowsAtHand(_NONE, _NONE, _NONE, _NONE)
    if len(parts) == 1 and bool((np.diff(parts[0].owner) >= 0).all()):
        return parts[0]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.lexsort((columns[2], columns[1], columns[0]))
    return RowsAtHand(*(column[order] for column in columns))


def device_name(device: int) -> str:
    """Return what people call a device; empty for none."""
    if device == NO_DEVICE:
        return ""
    return f"unit {device}" if device < _UNITS else f"ch{device - _UNITS}"


def is_unit(device: Number) -> Number:
    """Return whether devices are units."""
    return (device > NO_DEVICE) & (device < _UNITS)


def is_channel(device: Number) -> Number:
    """Return whether devices are channels."""
    return device > _UNITS


def _device(table: DecodedTable) -> Array:
    for name, first in (("unit", 0), ("channel", _UNITS)):
        if name in table:
            told = np.nan_to_num(table[name].astype(np.float64), nan=0)
            most = _UNITS - 1 if first == 0 else _MOST_DEVICE - _UNITS
            there = table.has(name) & (told > 0) & (told <= most)
            return np.where(there, told + first, NO_DEVICE).astype(np.int64)
    return np.zeros(len(table), np.int64)


class HandSet(RowSet):
    """Rows at hand as a filter reads them; of fields that they lack it takes what was told last.

    Args:
        context: the batch.
        hand: the rows.
        tables: of which they are.
        transfers: the batch's transfers.
        held: the fields of other types, fed with this batch.
        lags: what the filter looks back at.
    """

    def __init__(
        self, context: BatchContext, view: BatchView, hand: RowsAtHand, tables: Sequence[str], transfers: TransferSet,
        held: Mapping[object, HeldField], lags: Sequence[LagNode],
    ) -> None:  # fmt: skip
        super().__init__(context, len(hand.owner))
        self._view, self.hand, self._tables, self._transfers = view, hand, tables, transfers
        self._held, self._lags = held, lags

    def values(self, ref: FieldRef) -> Values:
        """Return the values of a field, of all rows."""
        key = ref.key
        if key not in self._known:
            self._known[key] = self._find(ref)
        return self._known[key]

    def lagged(self, place: int) -> Values:
        """Return what a field was some time ago."""
        found, ref = self.context.lagged[place], self._lags[place].of.ref
        if not self._own(ref):
            return spread(found, self.hand.owner, self._transfers.size)
        rows = np.concatenate([values.rows() for values in self._parts(ref)] or [_NONE])
        return _of_table(found._replace(row=rows).take(np.flatnonzero(rows >= 0)), ref)

    def _own(self, ref: FieldRef) -> bool:
        return set(ref.tables) <= set(self._tables)

    def _find(self, ref: FieldRef) -> Values:
        hand = self.hand
        if ref.origin == "unit":
            return Values(None, hand.device, is_unit(hand.device))
        if ref.origin == "type" and self._tables:
            mine = [k for k, name in enumerate(self._tables) if name in ref.tables]
            return Values(None, np.isin(hand.table, mine))
        if ref.origin == "table" and not self._own(ref):
            return self._held[ref.key].ask(self._view, hand)
        if ref.origin == "table":
            parts = self._parts(ref)
            found = together(parts) if parts else self.context.none(ref)
            return _of_table(found.take(np.flatnonzero(found.rows() >= 0)), ref)
        return spread(self._transfers.values(ref), hand.owner, self._transfers.size)

    def _parts(self, ref: FieldRef) -> list[Values]:
        """Return a field of the tables, each value with its row at hand, -1 for one that is not at hand."""
        parts = []
        for name in ref.tables:
            table = self.context.batch.messages.get(name)
            if table is None:
                continue
            mine = np.flatnonzero(self.hand.table == self._tables.index(name))
            place = np.full(len(table), -1)
            place[self.hand.at[mine]] = mine
            values = column_values(table, ref, place)
            if values is not None:
                parts.append(values)
        return parts


class HeldField:
    """The last values of a field: of each device, or of each sender where none is named.

    A row is given those of its own device, else of its own node unless they are of another unit or channel than its
    own, else of whoever has told them last, on the same bus if anybody has there; a row that names a device none of
    those of another one.
    """

    def __init__(self, ref: FieldRef) -> None:
        self._ref = ref
        self._values: Values | None = None
        self._who = (_NONE, _NONE, _NONE)  # of each row of values: device, sender, rank

    def feed(self, context: BatchContext, view: BatchView) -> None:
        """Take the next batch."""
        self._trim()
        hand = rows_at_hand(view, self._ref.tables)
        if not len(hand.owner):
            return
        rows = HandSet(context, view, hand, self._ref.tables, TransferSet(context), {}, ())
        fresh = rows.values(self._ref)
        who = (hand.device, _senders(view, hand), _ranks(view, hand))
        if self._values is not None:
            fresh = together([self._values, fresh._replace(row=fresh.rows() + len(self._who[0]))])
            who = tuple(np.concatenate(pair) for pair in zip(self._who, who, strict=True))  # type: ignore[assignment]
        self._values, self._who = fresh._replace(key=None), who

    def ask(self, view: BatchView, hand: RowsAtHand) -> Values:
        """Return what rows are given, with the row of each value."""
        if self._values is None or not len(hand.owner):
            return Values(_NONE, _NONE)
        device, sender, rank = self._who
        own, node, now = hand.device, _senders(view, hand), _ranks(view, hand) + 1
        found = np.full(len(own), -1)
        named, every, free = own != NO_DEVICE, device > -1, device == NO_DEVICE

        def fill(mine: Array, theirs: Array, said: Array, asked: Array) -> None:
            """Give those what was told last by who has the same number, on the same bus if anybody has there."""
            some = np.flatnonzero(theirs)
            _fill(found, mine, ((sender >> 8) << 12 | said, rank, some), (node >> 8) << 12 | asked, now)
            _fill(found, mine, (said, rank, some), asked, now)

        fill(named, ~free, device, own)
        _fill(found, ~named, (sender, rank, np.arange(len(device))), node, now)
        for mine, theirs in ((is_unit(own), ~is_unit(device)), (is_channel(own), ~is_channel(device))):
            _fill(found, mine, (sender, rank, np.flatnonzero(theirs)), node, now)
        for mine, theirs in ((~named, every), (named, free)):
            fill(mine, theirs, np.zeros_like(sender), np.zeros_like(node))
        rows = np.flatnonzero(found >= 0)
        told = spread(self._values, found[rows], len(device))
        return told._replace(row=rows[told.rows()], key=self._ref.key)

    def _trim(self) -> None:
        """Leave the last row of each sender and device."""
        if self._values is None:
            return
        device, sender, rank = self._who
        last = {pair: k for k, pair in enumerate(zip(device.tolist(), sender.tolist(), strict=True))}
        kept = np.array(sorted(last.values())[-MOST_HELD:], np.int64)
        told = spread(self._values, kept, len(device))
        self._values, self._who = _owned(told), (device[kept], sender[kept], rank[kept])


def _of_table(values: Values, ref: FieldRef) -> Values:
    """Return values of a table that stand beside those of its other fields."""
    return values._replace(key=(ref.tables, *((ref.column, ref.path) if values.place is not None else ())))


def _owned(values: Values) -> Values:
    """Return values that hold no buffer and no words of a batch but their own."""
    data = values.data
    if isinstance(data, ByteSpans):
        each = data.each()
        ends = np.cumsum([0, *map(len, each)])
        data = ByteSpans(np.frombuffer(b"".join(each), np.uint8), ends[:-1], ends[1:])
    elif isinstance(data, CodedWords):
        known, codes = np.unique(data.codes, return_inverse=True)
        data = CodedWords(codes, [data.words[code] for code in known.tolist()])
    return values._replace(data=data)


def _senders(view: BatchView, hand: RowsAtHand) -> Array:
    return view.transfers.bus[hand.owner].astype(np.int64) << 8 | view.transfers.src[hand.owner]


def _ranks(view: BatchView, hand: RowsAtHand) -> Array:
    return (hand.owner + view.transfers.first) * 2


def _fill(found: Array, mine: Array, told: tuple[Array, Array, Array], key: Array, now: Array) -> None:
    """Put the last place of the same key, told up to then, where nothing is found yet."""
    keys, ranks, places = told
    wanted = np.flatnonzero(mine & (found < 0))
    if not len(wanted) or not len(places):
        return
    order = places[np.lexsort((places, ranks[places], keys[places]))]
    _, dense = np.unique(np.concatenate((keys[order], key[wanted])), return_inverse=True)
    base = int(min(ranks[order].min(), now[wanted].min()))
    span = int(max(ranks[order].max(), now[wanted].max())) - base + 1
    have = dense[: len(order)] * span + (ranks[order] - base)
    ask = dense[len(order) :] * span + (now[wanted] - base)
    at = np.searchsorted(have, ask, "right") - 1
    good = (at >= 0) & (dense[np.maximum(at, 0)] == dense[len(order) :])
    found[wanted[good]] = order[at[good]]
