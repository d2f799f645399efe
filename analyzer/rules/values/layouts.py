"""Payloads that the layout of their type does not allow: lengths, padding, tags, void bits."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.values.bit_reader import PREFIX, TAIL, walk
from analyzer.rules.values.shapes import BYTE, Shape, column_of, shape_of
from dissectors.kit import Occurrences, Rule

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dissectors.kit import Array, Values, View
    from dissectors.kit.decoded import Context


class Layouts(Rule):
    """Rows that are not read to their last byte, or not in the way of their type."""

    rules = ("TYP-001", "TYP-002", "TYP-003", "TYP-004", "TYP-005", "TYP-011", "TYP-012")

    def __init__(self) -> None:
        self._shapes: dict[str, Shape] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Look closer at rows that are not read to their last byte."""
        for context in view.contexts:
            shapes = [shape_of(self._shapes, view, table) for table in context.tables]
            full = _full(context, shapes)
            odd = _odd(context, full)
            if len(odd):
                yield from _OddRows(view, context, shapes, odd, full).find()


def _full(context: Context, shapes: Sequence[Shape]) -> Array | None:
    """Return which rows have an array that has all the elements it may have: its length may say more; None for none."""
    prefixed = context["layout"] >= PREFIX
    bare = not prefixed.any()
    found: Array | None = None
    for table, shape, start in zip(context.tables, shapes, context.starts, strict=False):
        rows = slice(start, start + len(table))
        for name, most in shape.lists.items():
            if shape.tail is None or name != shape.tail.field or not (bare or not prefixed[rows].any()):
                found = np.zeros(len(prefixed), bool) if found is None else found
                found[rows] |= table.counts(column_of(table, name)) >= most
    return found


def _odd(context: Context, full: Array | None) -> Array:
    """Return the rows that can be relied on, and may not be as their type is."""
    odd = _unread(context["bits_left"])
    odd |= context["bad_tag"]
    odd |= context["pad_nonzero"]
    if full is not None:
        odd |= full
    odd &= context["trusted"]
    rows: Array = odd.nonzero()[0]
    return rows


def _unread(left: Array) -> Array:
    """Return which rows have bytes behind their fields, or lack bits, which are negative."""
    rows: Array = left.view(np.uint32) >= BYTE
    return rows


class _OddRows:
    """The odd rows of some tables of one batch, a cell each; `full` are those of all rows."""

    def __init__(self, view: View, context: Context, shapes: Sequence[Shape], rows: Array, full: Array | None) -> None:
        self._view, self._tables, self._shapes = view, context.tables, shapes
        self._table = context.table[rows]
        self._row = rows - np.array(context.starts)[self._table]
        self._transfer = (context["transfer"][rows] - np.uint64(view.transfers.first)).astype(np.int64)
        self._left, self._layout = context["bits_left"][rows], context["layout"][rows]
        self._tagged, self._dirty = context["bad_tag"][rows], context["pad_nonzero"][rows]
        self._counted = _unread(self._left) if full is None else _unread(self._left) | full[rows]
        self._length = view.transfers.length[self._transfer]

    def find(self) -> Iterator[Occurrences]:
        """Yield their breaches, rule by rule."""
        numbers = np.array([one.numbers for one in self._shapes], np.int64)[self._table].T
        least, least_counted, most, element, voids, counted, counted_bare = numbers
        left, bare = self._left, self._layout == TAIL
        yield from self._say("TYP-001", (left < 0) & (self._length < np.where(bare, least, least_counted)), self._short)
        bare_can = bare & ~self._view.transfers.fd[self._transfer]
        yield from self._say("TYP-002", bare_can & (self._length > most), self._long)
        plain = ~self._tagged
        padded = (self._dirty & (left > 0) & (left < BYTE) & plain).nonzero()[0]
        yield from self._say("TYP-003", padded[[bool(self._value(k)) for k in padded.tolist()]], self._padding)
        yield from self._in_tails((bare_can & (left >= BYTE) & plain & (element > 0)).nonzero()[0], element)
        closer = self._tagged | (self._dirty & (voids > 0))
        closer |= self._counted & (np.where(bare, counted_bare, counted) > 0)
        yield from self._closer(closer.nonzero()[0])

    def _say(self, rule: str, rows: Array, values: Callable[[int], Values]) -> Iterator[Occurrences]:
        """Yield a breach in each row, of which `values` tells; rows are places in these columns, or a mask of them."""
        rows, every = rows.nonzero()[0] if rows.dtype == bool else rows, self._every
        if not len(rows):
            return
        yield Occurrences(
            rule=rule, t=every.t[rows], bus=every.bus[rows], node=every.node[rows], type=every.type[rows],
            frame=every.frame[rows], values=lambda k: values(rows.item(k)), frames=lambda k: every.frames(rows.item(k)),
        )  # fmt: skip

    @cached_property
    def _every(self) -> Occurrences:
        return self._view.among_transfers("", self._transfer, lambda _: {})

    def _in_tails(self, rows: Array, element: Array) -> Iterator[Occurrences]:
        """Yield what is wrong behind the array that ends a payload, whose `element` has so many bits."""
        elements: dict[int, int] = {}
        for at in np.bincount(self._table[rows]).nonzero()[0].tolist():
            table, tail = self._tables[at], self._shapes[at].tail
            if tail is not None:
                column = column_of(table, tail.field)
                mine = rows[self._table[rows] == at]
                mine = mine[table.has(column)[self._row[mine]]]
                count = table.counts(column)[self._row[mine]] + self._left[mine] // element[mine]
                elements |= zip(mine.tolist(), count.tolist(), strict=True)
        rows = np.array([*elements], np.int64)
        left, step = self._left[rows].astype(np.int64), element[rows]

        def torn(k: int) -> Values:
            return {"length": int(self._length[k]), "elements": elements[k], "bits": int(self._left[k] % element[k])}

        def many(k: int) -> Values:
            tail = self._shape(k).tail
            assert tail is not None  # noqa: S101 - these rows have one
            return {"field": tail.field, "elements": elements[k], "expected": tail.most}

        yield from self._say("TYP-004", rows[left % step >= BYTE], torn)
        yield from self._say("TYP-005", rows[left >= step], many)

    def _closer(self, rows: Array) -> Iterator[Occurrences]:
        wrong: dict[tuple[str, str], dict[int, Values]] = {}
        for k in rows.tolist():
            seen = walk(self._shape(k).message.layout, self._payload(k), int(self._layout[k]))
            if seen.tag is not None:
                said = dict(zip(("field", "tag", "members"), seen.tag, strict=True))
                wrong.setdefault(("TYP-011", seen.tag[0]), {})[k] = said
            if seen.many is not None:
                said = dict(zip(("field", "elements", "expected"), seen.many, strict=True))
                wrong.setdefault(("TYP-005", seen.many[0]), {})[k] = said
            if seen.voids:
                said = dict(zip(("bits", "value"), seen.voids[0], strict=True))
                wrong.setdefault(("TYP-012", ""), {})[k] = said
        for (rule, _), values in wrong.items():
            yield from self._say(rule, np.array([*values]), values.__getitem__)

    def _shape(self, k: int) -> Shape:
        return self._shapes[int(self._table[k])]

    def _payload(self, k: int) -> bytes:
        return self._view.transfers.payload(int(self._transfer[k]))

    def _value(self, k: int) -> int:
        """Return what the bits behind the last field are."""
        return self._payload(k)[-1] & (1 << int(self._left[k])) - 1

    def _short(self, k: int) -> Values:
        bare = self._layout[k] == TAIL
        return {"length": int(self._length[k]), "expected": self._shape(k).least[0 if bare else 1]}

    def _long(self, k: int) -> Values:
        shape = self._shape(k)
        counted = " without the length field, which is not sent" if shape.tail is not None else ""
        return {"length": int(self._length[k]), "expected": shape.most, "counted": counted}

    def _padding(self, k: int) -> Values:
        return {"bits": int(self._left[k]), "value": self._value(k)}
