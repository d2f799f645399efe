"""Payloads that the layout of their type does not allow: lengths, padding, tags, void bits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.values.bit_reader import PREFIX, TAIL, walk
from analyzer.rules.values.shapes import BYTE, Shape, Tail, column_of, shape_of
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View


class Layouts(Rule):
    """Rows that are not read to their last byte, or not in the way of their type."""

    rules = ("TYP-001", "TYP-002", "TYP-003", "TYP-004", "TYP-005", "TYP-011", "TYP-012")

    def __init__(self) -> None:
        self._shapes: dict[str, Shape] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Look closer at rows that are not read to their last byte."""
        for name in view.tables():
            shape = shape_of(self._shapes, view, name)
            table = view.table(name)
            if shape is not None and table is not None:
                yield from _Rows(view, table, shape).found()


class _Rows:
    """The odd rows of a table of one batch."""

    def __init__(self, view: View, table: DecodedTable, shape: Shape) -> None:
        self._view, self._table, self._shape = view, table, shape
        self._left = table["bits_left"]

    def found(self) -> Iterator[Occurrences]:
        table, left, shape = self._table, self._left, self._shape
        tagged, dirty, full = table["bad_tag"], table["pad_nonzero"], self._full()
        unread = left.view(np.uint32) >= BYTE  # missing bits are negative
        any_ = unread | tagged
        any_ |= dirty
        if full is not None:
            any_ |= full
        if table.good < len(table):
            any_ &= table.trusted
        odd = any_.nonzero()[0]
        if not len(odd):
            return
        transfers, left, tagged, dirty = table.row[odd], left[odd], tagged[odd], dirty[odd]
        tail, length = table["layout"][odd] == TAIL, self._view.transfers.length[transfers]
        short, bare = left < 0, tail & ~self._view.transfers.fd[transfers]
        if short.any():
            yield from self._say("TYP-001", odd[short & (length < np.where(tail, *shape.least))], self._short)
        yield from self._say("TYP-002", odd[bare & (length > shape.most)], self._long)
        if dirty.any():
            padded = odd[dirty & (left > 0) & (left < BYTE) & ~tagged]
            yield from self._say("TYP-003", [row for row in padded.tolist() if self._value(row)], self._padding)
        if shape.tail is not None:
            yield from self._of_tail(shape.tail, odd[bare & (left >= BYTE) & ~tagged])
        closer = tagged
        if shape.voids:
            closer |= dirty
        if shape.counted:
            closer |= unread[odd] if full is None else unread[odd] | full[odd]
        yield from self._closer(odd[closer])

    def _full(self) -> Array | None:
        """Return rows with an array that has all the elements it may have: its length may say more; None for none."""
        full, tail = None, self._shape.tail
        for name, most in self._shape.lists.items():
            if tail is None or name != tail.field or (self._table["layout"] >= PREFIX).any():
                whole = self._table.counts(column_of(self._table, name)) >= most
                full = whole if full is None else full | whole
        return full

    def _say(self, rule: str, rows: Any, values: Any) -> Iterator[Occurrences]:
        if len(rows):
            yield self._view.among_rows(rule, self._table, np.asarray(rows, np.int64), values)

    def _of_tail(self, tail: Tail, rows: Array) -> Iterator[Occurrences]:
        column = column_of(self._table, tail.field) if "." not in tail.field else ""
        rows = rows[self._table.has(column)[rows]] if column and len(rows) else rows
        if not len(rows):
            return
        low, high = tail.bits
        left = self._left[rows].astype(np.int64)
        if low == high and column:
            count = self._table.counts(column)[rows]
            elements = dict(zip(rows.tolist(), (count + left // low).tolist(), strict=True))
            yield from self._say(
                "TYP-004",
                rows[left % low >= BYTE],
                lambda row: {
                    "length": self._length(row),
                    "elements": elements[row],
                    "bits": int(self._left[row]) % low,
                },
            )
            yield from self._say(
                "TYP-005",
                rows[left >= low],
                lambda row: {"field": tail.field, "elements": elements[row], "expected": tail.most},
            )

    def _closer(self, rows: Array) -> Iterator[Occurrences]:
        wrong: dict[tuple[str, str], dict[int, Values]] = {}
        for row in rows.tolist():
            code = int(self._table["layout"][row])
            seen = walk(self._shape.message.layout, self._payload(row), code)
            if seen.tag is not None:
                said = dict(zip(("field", "tag", "members"), seen.tag, strict=True))
                wrong.setdefault(("TYP-011", seen.tag[0]), {})[row] = said
            if seen.many is not None:
                said = dict(zip(("field", "elements", "expected"), seen.many, strict=True))
                wrong.setdefault(("TYP-005", seen.many[0]), {})[row] = said
            if seen.voids:
                said = dict(zip(("bits", "value"), seen.voids[0], strict=True))
                wrong.setdefault(("TYP-012", ""), {})[row] = said
        for (rule, _), values in wrong.items():
            yield from self._say(rule, list(values), values.__getitem__)

    def _payload(self, row: int) -> bytes:
        return self._view.transfers.payload(int(self._table.row[row]))

    def _length(self, row: int) -> int:
        return int(self._view.transfers.length[self._table.row[row]])

    def _value(self, row: int) -> int:
        """Return what the bits behind the last field are."""
        return self._payload(row)[-1] & (1 << int(self._left[row])) - 1

    def _short(self, row: int) -> Values:
        tail = self._table["layout"][row] == TAIL
        return {"length": self._length(row), "expected": self._shape.least[0 if tail else 1]}

    def _long(self, row: int) -> Values:
        counted = " without the length field, which is not sent" if self._shape.tail is not None else ""
        return {"length": self._length(row), "expected": self._shape.most, "counted": counted}

    def _padding(self, row: int) -> Values:
        return {"bits": int(self._left[row]), "value": self._value(row)}
