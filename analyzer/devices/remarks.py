"""Rows of messages and packets that have something to remark, as their profiles say, batch by batch."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.columns import senders
from analyzer.devices.readings import holding
from analyzer.devices.rows import NUMBER_BITS
from analyzer.facts.meaning import meaning
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pyarrow as pa

    from dissectors.kit import Array
    from dissectors.schema import Message, Packet, Remark

    Table = tuple[str, Message | Packet, pa.RecordBatch]

_MOST_SENDERS = 1 << 16


class Remarked(NamedTuple):
    """The rows of a table that give cause for a remark, with their raw values.

    Of a word only the flags are in `raw`. `before` is the raw value that each row was changed from, -1 if it was not.
    """

    remark: Remark
    rows: Array
    raw: Array
    before: Array


class Remarks:
    """Knows the last value of each sender, so that batches may end anywhere."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, int], dict[int, int]] = {}  # by table and remark: by sender

    def feed(self, tables: Iterable[Table]) -> dict[str, list[Remarked]]:
        """Take the rows that are listed of a batch; return by table what is remarked of them."""
        return {
            name: [self._remarked(name, place, of, table) for place, one in enumerate(of.remarks) if one.column]
            for name, of, table in tables
        }

    def _remarked(self, name: str, place: int, of: Message | Packet, table: pa.RecordBatch) -> Remarked:
        remark = of.remarks[place]
        raw, has, usual = _raw(of, remark, table)
        wanted = has & ~_among(raw, usual)
        before = np.full(len(table), -1, np.int64)
        holds = holding(remark.only, table)
        if holds is not None:
            wanted, has = wanted & holds, has & holds
        if remark.changes:
            before = self._before(self._last.setdefault((name, place), {}), remark, table, raw, has)
            wanted |= before >= 0
        rows = np.flatnonzero(wanted)
        return Remarked(remark, rows, raw[rows], before[rows])

    def _before(
        self, last: dict[int, int], remark: Remark, table: pa.RecordBatch, raw: Array, has: Array
    ) -> Array:  # fmt: skip
        """Return what each row was changed from; a row that cannot be trusted changes nothing."""
        before = np.full(len(table), -1, np.int64)
        for name in ("trusted", "packet_ok"):
            if name in table.schema.names:
                has = has & numbers(table.column(name))
        if remark.per:
            has = has & valid(table.column(_own(table, remark.per)))
        rows = np.flatnonzero(has)
        if not len(rows):
            return before
        key = senders(table).astype(np.int64)[rows] << NUMBER_BITS
        if remark.per:
            key |= numbers(table.column(_own(table, remark.per)))[rows].astype(np.int64) & (1 << NUMBER_BITS) - 1
        order = np.argsort(key, kind="stable")
        rows, key = rows[order], key[order]
        starts = np.concatenate(([True], key[1:] != key[:-1]))
        previous = np.concatenate(([0], raw[rows[:-1]]))
        for first in np.flatnonzero(starts).tolist():
            previous[first] = last.get(int(key[first]), raw[rows[first]])
        for end in [*(np.flatnonzero(starts)[1:] - 1).tolist(), len(rows) - 1]:
            if int(key[end]) in last or len(last) < _MOST_SENDERS:
                last[int(key[end])] = int(raw[rows[end]])
        changed = previous != raw[rows]
        before[rows[changed]] = previous[changed]
        return before


def _raw(of: Message | Packet, remark: Remark, table: pa.RecordBatch) -> tuple[Array, Array, tuple[int, ...]]:
    """Return the raw values of a remark's column, which of them are there, and those that are usual."""
    about = meaning(of, remark.column)
    outer = remark.column if about.part is None else remark.column.rpartition(".")[0]
    word = table.column(_own(table, outer))
    note = of.notes.get(outer)
    values, has = numbers(word), valid(word)
    if note is not None and note.scale is not None:
        values = np.rint(np.where(has, values, 0) * note.scale.denominator / note.scale.numerator)
    raw = values.astype(np.int64)
    special = () if note is None else tuple(note.special)
    if about.part is not None:
        has = has & ~_among(raw, special)
        raw = raw >> about.part.low & (1 << about.part.width) - 1
        return raw, has, remark.usual or ((0,) if about.part.flag else ())
    flags = sum(1 << part.low for part in note.parts if part.flag) if note is not None and not remark.text else 0
    if flags:
        return np.where(_among(raw, special), 0, raw & flags), has, (0,)
    return raw, has, (*remark.usual, *special)


def _among(raw: Array, few: tuple[int, ...]) -> Array:
    found = np.zeros(len(raw), bool)
    for one in few:
        found |= raw == one
    return found


def _own(table: pa.RecordBatch, field: str) -> str:
    """Return the column of a field: another one if it is called like a column that every message has."""
    other = f"{field}.field"
    return other if other in table.schema.names else field
