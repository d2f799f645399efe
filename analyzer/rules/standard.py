"""Payloads against the layout of their type: lengths, padding, tags, void bits and special floats, of any type."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.walk import PREFIX, TAIL, walk
from dissectors.conformance import Watcher
from dissectors.schema import Array, Compound, Primitive, wire_bits

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.conformance import Found, Table, Values, View, Words
    from dissectors.schema import Message, Type

_BYTE = 8
_MANTISSA = {16: 10, 32: 23, 64: 52}


@dataclass(frozen=True, slots=True)
class _Tail:
    """The array that ends a payload without a length: column, its elements' fewest and most bits, and how many."""

    field: str
    bits: tuple[int, int]
    most: int


@dataclass(frozen=True, slots=True)
class _Shape:
    """What the rules ask of a type. `floats` are widths by dotted name, `lists` the outer arrays that have a length."""

    message: Message
    least: tuple[int, int]
    most: int
    tail: _Tail | None
    floats: dict[str, int]
    lists: dict[str, int]
    counted: bool
    voids: bool

    @classmethod
    def of(cls, message: Message) -> _Shape:
        parts = list(_parts(message.layout, ""))
        dynamic = [part for _, part in parts if isinstance(part, Array) and part.dynamic]
        outer = {m.name: m.type for m in message.layout.fields} if not message.layout.union else {}
        return cls(
            message=message,
            least=(message.min_bytes, message.min_bytes_with_length),
            most=message.max_bytes,
            tail=_tail(message.layout),
            floats={name: part.bits for name, part in parts if isinstance(part, Primitive) and part.kind == "float"},
            lists={name: kind.max for name, kind in outer.items() if isinstance(kind, Array) and kind.dynamic},
            counted=bool(dynamic),
            voids=any(isinstance(part, Primitive) and part.kind == "void" for _, part in parts),
        )


class Layouts(Watcher):
    """TYP-001 to -005, -011, -012: a payload that its type does not allow."""

    rules = ("TYP-001", "TYP-002", "TYP-003", "TYP-004", "TYP-005", "TYP-011", "TYP-012")

    def __init__(self) -> None:
        self._shapes: dict[str, _Shape] = {}

    def look(self, view: View) -> Iterable[Found]:
        """Looks closer at rows that are not read to their last byte."""
        for name in view.tables():
            shape = _known(self._shapes, view, name)
            table = view.table(name)
            if shape is not None and table is not None:
                yield from _Rows(view, table, shape).found()


class Floats(Watcher):
    """TYP-007, -008: floats that are no numbers."""

    rules = ("TYP-007", "TYP-008")

    def __init__(self) -> None:
        self._shapes: dict[str, _Shape] = {}

    def look(self, view: View) -> Iterator[Found]:
        """One pass over the floats of each table."""
        for name in view.tables():
            shape = _known(self._shapes, view, name)
            table = view.table(name)
            if shape is None or table is None:
                continue
            for field in dict.fromkeys(path.partition(".")[0] for path in shape.floats):
                for path, rows, values in table.not_finite(_column(table, field)):
                    yield from _special(view, table, path, rows, _raw(values, shape.floats[_dsdl(path)]))


def _special(view: View, table: Table, path: str, rows: Words, raw: Words) -> Iterator[Found]:
    good = table.trusted[rows]
    mantissa = _MANTISSA[raw.dtype.itemsize * _BYTE]
    nan = raw & raw.dtype.type((1 << mantissa) - 1) != 0
    for rule, kind in (("TYP-007", nan), ("TYP-008", ~nan)):
        here, first = np.unique(rows[good & kind], return_index=True)
        if len(here):
            codes = raw[good & kind][first].tolist()
            said = {row: {"field": _dsdl(path), "raw": code} for row, code in zip(here.tolist(), codes, strict=True)}
            yield view.among_rows(rule, table, here, said.__getitem__)


class _Rows:
    """The odd rows of a table of one batch."""

    def __init__(self, view: View, table: Table, shape: _Shape) -> None:
        self._view, self._table, self._shape = view, table, shape
        self._left = table["bits_left"]

    def found(self) -> Iterator[Found]:
        table, left, shape = self._table, self._left, self._shape
        unread = left.view(np.uint32) >= _BYTE  # missing bits are negative
        tagged, dirty, full = table["bad_tag"], table["pad_nonzero"], self._full()
        odd = np.flatnonzero((unread | tagged | dirty | full) & table.trusted)
        if not len(odd):
            return
        code = table["layout"][odd]
        classic = ~self._view.transfers.fd[table.row[odd]]
        length = self._view.transfers.length[table.row[odd]]
        least = np.where(code == TAIL, *shape.least)
        left = left[odd]
        yield from self._say("TYP-001", odd[(left < 0) & (length < least)], self._short)
        bare = classic & (code == TAIL)
        yield from self._say("TYP-002", odd[bare & (length > shape.most)], self._long)
        padded = odd[dirty[odd] & (left > 0) & (left < _BYTE) & ~tagged[odd]]
        yield from self._say("TYP-003", [row for row in padded.tolist() if self._value(row)], self._padding)
        if shape.tail is not None:
            yield from self._of_tail(shape.tail, odd[bare & (left >= _BYTE) & ~tagged[odd]])
        closer = tagged[odd] | (dirty[odd] & shape.voids) | ((unread[odd] | full[odd]) & shape.counted)
        yield from self._closer(odd[closer])

    def _full(self) -> Words:
        """Rows with an array that has all the elements it may have: its length may say more."""
        full = np.zeros(len(self._table), bool)
        tail = self._shape.tail
        coded = bool((self._table["layout"] >= PREFIX).any())
        for name, most in self._shape.lists.items():
            if coded or tail is None or name != tail.field:
                full |= self._table.counts(_column(self._table, name)) >= most
        return full

    def _say(self, rule: str, rows: Any, values: Any) -> Iterator[Found]:
        if len(rows):
            yield self._view.among_rows(rule, self._table, np.asarray(rows, np.int64), values)

    def _of_tail(self, tail: _Tail, rows: Words) -> Iterator[Found]:
        column = _column(self._table, tail.field) if "." not in tail.field else ""
        rows = rows[self._table.has(column)[rows]] if column else rows
        low, high = tail.bits
        left = self._left[rows].astype(np.int64)
        if low == high and column:
            count = self._table.counts(column)[rows]
            elements = dict(zip(rows.tolist(), (count + left // low).tolist(), strict=True))
            yield from self._say(
                "TYP-004",
                rows[left % low >= _BYTE],
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

    def _closer(self, rows: Words) -> Iterator[Found]:
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
        """What the bits behind the last field are."""
        return self._payload(row)[-1] & (1 << int(self._left[row])) - 1

    def _short(self, row: int) -> Values:
        tail = self._table["layout"][row] == TAIL
        return {"length": self._length(row), "expected": self._shape.least[0 if tail else 1]}

    def _long(self, row: int) -> Values:
        return {"length": self._length(row), "expected": self._shape.most}

    def _padding(self, row: int) -> Values:
        return {"bits": int(self._left[row]), "value": self._value(row)}


def _known(shapes: dict[str, _Shape], view: View, name: str) -> _Shape | None:
    if name not in shapes:
        message = view.definition(name)
        if message is None:
            return None
        shapes[name] = _Shape.of(message)
    return shapes[name]


def _column(table: Table, field: str) -> str:
    """A field that is called like a column about the transfer has another name there."""
    return f"{field}.field" if f"{field}.field" in table else field


def _dsdl(path: str) -> str:
    """The name in the definition."""
    head, _, rest = path.partition(".")
    return f"{head}{rest.removeprefix('field')}" if rest.startswith("field") else path


def _parts(layout: Type, name: str) -> Iterator[tuple[str, Type]]:
    """Every type in a layout with its dotted name, that of an array also for its elements."""
    yield name, layout
    if isinstance(layout, Array):
        yield from _parts(layout.element, name)
    elif isinstance(layout, Compound):
        for member in layout.fields:
            yield from _parts(member.type, f"{name}.{member.name}".lstrip("."))


def _tail(layout: Type, name: str = "") -> _Tail | None:
    """The array that has no length on classic CAN; none where a union decides."""
    if isinstance(layout, Compound) and layout.fields and not layout.union:
        last = layout.fields[-1]
        return _tail(last.type, f"{name}.{last.name}".lstrip("."))
    if isinstance(layout, Array) and layout.dynamic and layout.element.min_bits >= _BYTE:
        return _Tail(name, wire_bits(layout.element, tail=False), layout.max)
    return None


def _raw(values: Words, width: int) -> Words:
    """Floats as they were sent; float16 comes as float32."""
    if width == 64:
        return values.view(np.uint64)
    bits = values.astype(np.float32).view(np.uint32)
    if width == 32:
        return bits
    return (bits >> 16 & 0x8000 | bits >> 13 & 0x7FFF & 0x3FF | 0x7C00).astype(np.uint16)


WATCHERS: tuple[type[Watcher], ...] = (Layouts, Floats)
