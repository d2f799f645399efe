"""Payloads that their layout does not allow, one table after the other, each column asked of each table alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.values.bit_reader import PREFIX, TAIL, walk
from analyzer.rules.values.shapes import BYTE, Shape, Tail, column_of
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View


def odd_layouts(view: View) -> Iterator[Occurrences]:
    for name in view.tables():
        message = view.definition(name)
        if message is not None:
            yield from _Rows(view, view.table(name), Shape.of(message)).found()


def _inside(layout: Any) -> Iterator[Any]:
    yield layout
    for part in [layout.element] if isinstance(layout, ArrayType) else getattr(layout, "fields", ()):
        yield from _inside(getattr(part, "type", part))


class _Rows:
    def __init__(self, view: View, table: DecodedTable, shape: Shape) -> None:
        self.view, self.table, self.shape = view, table, shape
        self.left = table["bits_left"]
        parts = [*_inside(shape.message.layout)]
        self.voids = any(isinstance(part, PrimitiveType) and part.kind == "void" for part in parts)
        self.counted = any(isinstance(part, ArrayType) and part.dynamic for part in parts)
        assert all(isinstance(part, ArrayType | CompoundType | PrimitiveType) for part in parts)

    def found(self) -> Iterator[Occurrences]:
        table, shape, full = self.table, self.shape, self.full()
        unread = (self.left < 0) | (self.left >= BYTE)
        odd = np.flatnonzero((unread | table["bad_tag"] | table["pad_nonzero"] | full) & table.trusted)
        transfers, left = table.row[odd], self.left[odd]
        tagged, dirty, tail = table["bad_tag"][odd], table["pad_nonzero"][odd], table["layout"][odd] == TAIL
        length = self.view.transfers.length[transfers]
        bare = tail & ~self.view.transfers.fd[transfers]
        yield from self.say("TYP-001", odd[(left < 0) & (length < np.where(tail, *shape.least))], self.short)
        yield from self.say("TYP-002", odd[bare & (length > shape.most)], self.long)
        padded = odd[dirty & (left > 0) & (left < BYTE) & ~tagged]
        yield from self.say("TYP-003", [row for row in padded.tolist() if self.value(row)], self.padding)
        if shape.tail is not None:
            yield from self.of_tail(shape.tail, odd[bare & (left >= BYTE) & ~tagged])
        closer = tagged | (dirty & self.voids) | ((unread[odd] | full[odd]) & self.counted)
        yield from self.closer(odd[closer])

    def full(self) -> Array:
        found, tail = np.zeros(len(self.table), bool), self.shape.tail
        for name, most in self.shape.lists.items():
            if tail is None or name != tail.field or (self.table["layout"] >= PREFIX).any():
                found |= self.table.counts(column_of(self.table, name)) >= most
        return found

    def say(self, rule: str, rows: Any, values: Any) -> Iterator[Occurrences]:
        if len(rows):
            yield self.view.among_rows(rule, self.table, np.asarray(rows, np.int64), values)

    def of_tail(self, tail: Tail, rows: Array) -> Iterator[Occurrences]:
        low, high = tail.bits
        if low != high or "." in tail.field:
            return
        column = column_of(self.table, tail.field)
        rows = rows[self.table.has(column)[rows]]
        left = self.left[rows].astype(np.int64)
        elements = dict(zip(rows.tolist(), (self.table.counts(column)[rows] + left // low).tolist(), strict=True))
        yield from self.say(
            "TYP-004", rows[left % low >= BYTE],
            lambda row: {"length": self.length(row), "elements": elements[row], "bits": int(self.left[row]) % low},
        )  # fmt: skip
        yield from self.say(
            "TYP-005", rows[left >= low],
            lambda row: {"field": tail.field, "elements": elements[row], "expected": tail.most},
        )  # fmt: skip

    def closer(self, rows: Array) -> Iterator[Occurrences]:
        wrong: dict[tuple[str, str], dict[int, Any]] = {}
        for row in rows.tolist():
            seen = walk(self.shape.message.layout, self.payload(row), int(self.table["layout"][row]))
            if seen.tag is not None:
                said = dict(zip(("field", "tag", "members"), seen.tag, strict=True))
                wrong.setdefault(("TYP-011", seen.tag[0]), {})[row] = said
            if seen.many is not None:
                said = dict(zip(("field", "elements", "expected"), seen.many, strict=True))
                wrong.setdefault(("TYP-005", seen.many[0]), {})[row] = said
            if seen.voids:
                wrong.setdefault(("TYP-012", ""), {})[row] = dict(zip(("bits", "value"), seen.voids[0], strict=True))
        for (rule, _), values in wrong.items():
            yield from self.say(rule, list(values), values.__getitem__)

    def payload(self, row: int) -> bytes:
        return self.view.transfers.payload(int(self.table.row[row]))

    def length(self, row: int) -> int:
        return len(self.payload(row))

    def value(self, row: int) -> int:
        return self.payload(row)[-1] & (1 << int(self.left[row])) - 1

    def short(self, row: int) -> dict[str, Any]:
        return {"length": self.length(row), "expected": self.shape.least[int(self.table["layout"][row] != TAIL)]}

    def long(self, row: int) -> dict[str, Any]:
        counted = " without the length field, which is not sent" if self.shape.tail is not None else ""
        return {"length": self.length(row), "expected": self.shape.most, "counted": counted}

    def padding(self, row: int) -> dict[str, Any]:
        return {"bits": int(self.left[row]), "value": self.value(row)}
