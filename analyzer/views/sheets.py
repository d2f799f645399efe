"""Batches for the native renderer of rows: templates compiled once a table, columns taken apart, texts row by row.

A template is a tree of nested tuples; `analyzer/native/src/rows` says what each of them writes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.tables import TRANSFERS
from analyzer.views.rows import UNRECOGNIZED, known_types
from analyzer.views.terminal import escape
from dissectors.kit.cells import numbers
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Message, Packet

Template = tuple[Any, ...]
_PIECE = 1024  # rows whose texts are in memory at once
_KINDS = (
    (pa.types.is_struct, "s"), (pa.types.is_list, "l"), (pa.types.is_binary, "b"), (pa.types.is_string, "b"),
    (pa.types.is_boolean, "?"), (pa.types.is_floating, "f"), (pa.types.is_unsigned_integer, "u"),
    (pa.types.is_null, "-"),
)  # fmt: skip


class Columns:
    """The columns of a table that its template reads, each with a place, in the order in which they are asked for."""

    def __init__(self, schema: pa.Schema, *first: str) -> None:
        self.schema = schema
        self._places = {name: place for place, name in enumerate(first)}

    def __contains__(self, name: str) -> bool:
        """Return whether the table has a column."""
        return name in self.schema.names

    @property
    def names(self) -> tuple[str, ...]:
        """Those that were asked for."""
        return tuple(self._places)

    def own(self, field: str) -> str:
        """Return the column of a field: another one if it is called like a column that every message has."""
        other = f"{field}.field"
        return other if other in self.schema.names else field

    def place(self, name: str) -> int:
        """Return the place of a column."""
        return self._places.setdefault(name, len(self._places))

    def of(self, name: str, template: Template) -> Template:
        """Return a template of the cells of a column."""
        return ("of", self.place(name), template)


@dataclass(frozen=True, slots=True)
class _Compiled:
    schema: pa.Schema
    columns: tuple[str, ...]
    template: _native.Template


class Sheets:
    """Writes rows of transfers, batch by batch.

    Args:
        registry: the types that the batches were decoded with.
        row: gives the template of a transfer; columns beside those of `TRANSFERS` are given with each batch.
        part: gives templates of the messages or packets of a table, by its name, one for each place that the template
            of a transfer names; `None` for bytes that no packet claims. They are compiled once.
        beside: names and types of the columns that are given with each batch.
        escaped: texts in messages and packets are made safe to print.
    """

    def __init__(
        self,
        registry: Registry,
        row: Callable[[Columns], Template],
        part: Callable[[str, Message | Packet | None, Columns], Sequence[Template | None]],
        beside: Mapping[str, pa.DataType],
        *,
        escaped: bool = False,
    ) -> None:
        self._registry, self._part, self._escaped = registry, part, escaped
        schema = pa.schema([*TRANSFERS, *(pa.field(name, kind) for name, kind in beside.items())])
        columns = Columns(schema, "bus")  # which tells how many rows there are, whatever they show
        made = _native.Template([row(columns)])
        self._row = _Compiled(schema, columns.names, made)
        self._parts: dict[str, _Compiled] = {}

    def texts(
        self,
        batch: Batch,
        picked: Array | None,
        messages: Sequence[Message],
        beside: Mapping[str, pa.Array],
        words: list[list[str]],
    ) -> Iterator[str]:
        """Yield the text of each picked transfer (all if not given).

        `messages` are the types whose tables are read, `words` the lists that templates take words from.
        """
        rows = np.arange(len(batch.transfers)) if picked is None else picked
        parts = [part for message in messages for part in self._tables(batch, message)]
        transfers = batch.transfers
        columns = [flat(beside[name] if name in beside else transfers.column(name)) for name in self._row.columns]
        sheet = _native.Sheet(
            self._row.template, columns, parts, words, batch.first_transfer, np.asarray(rows, np.uint32)
        )
        for start in range(0, len(rows), _PIECE):
            yield from sheet.texts(start, start + _PIECE)

    def _tables(self, batch: Batch, message: Message) -> Iterator[tuple[_native.Template, list[Any], bool]]:
        yield from self._table(batch, message.table, message)
        if message.packets is not None:
            families = [message.packets, *self._registry.families()]
            kinds = {packet.name: packet for family in reversed(families) for packet in family.packets}
            for name, packet in kinds.items():
                yield from self._table(batch, f"{message.table}.{name}", packet, packets=True)
            yield from self._table(batch, f"{message.table}.{UNRECOGNIZED}", None, packets=True)

    def _table(
        self, batch: Batch, name: str, of: Message | Packet | None, *, packets: bool = False
    ) -> Iterator[tuple[_native.Template, list[Any], bool]]:
        table = batch.messages.get(name)
        if table is None or not len(table):
            return
        made = self._parts.get(name)
        if made is None or not (made.schema is table.schema or made.schema.equals(table.schema)):
            columns = Columns(table.schema, "transfer", *(["offset"] if packets else []))
            template = _native.Template(list(self._part(name, of, columns)))
            made = self._parts[name] = _Compiled(table.schema, columns.names, template)
        columns_ = [table.column(column) for column in made.columns]
        yield made.template, [flat(_printable(one) if self._escaped else one) for one in columns_], packets


def _printable(array: pa.Array) -> pa.Array:
    if not pa.types.is_string(array.type):
        return array
    return pa.array([None if text is None else escape(text) for text in array.to_pylist()], pa.string())


def flat(array: pa.Array) -> tuple[Any, ...]:
    """Return a column as its kind, length, place of the first cell, validity, offsets, data and children."""
    kind, buffers = array.type, array.buffers()
    letter = next((letter for test, letter in _KINDS if test(kind)), "i")
    if letter in "uif":
        letter += str(kind.bit_width // 8)
    ends = buffers[1] if letter in ("l", "b") else None
    data = buffers[2] if letter == "b" else buffers[1] if letter[0] in "uif?" else None
    children = []
    if letter == "s":
        children = [flat(array.field(k)) for k in range(kind.num_fields)]
    elif letter == "l":
        children = [flat(array.values)]
    return letter, len(array), array.offset, buffers[0] if array.null_count else None, ends, data, children


def type_column(batch: Batch, registry: Registry) -> tuple[list[Message | None], pa.Array]:
    """Return the types that occur in a batch, None for unknown ones, and for each transfer the place of its type."""
    column = batch.transfers.column
    known, inverse = known_types(registry, *(numbers(column(name)) for name in ("variant", "kind", "type_id")))
    return known, pa.array(inverse.astype(np.uint32))
