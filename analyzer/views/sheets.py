"""Batches for the native renderer of rows: templates compiled once a table, columns taken apart, texts row by row.

A template is a tree of nested tuples; `analyzer/native/src/rows` says what each of them writes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.decode.packets import UNRECOGNIZED
from analyzer.facts.names import type_name
from analyzer.tables import TRANSFERS, distinct
from analyzer.views.rows import known_types
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
if TYPE_CHECKING:
    Make = Callable[[pa.RecordBatch], pa.Array]
_FIRST_LETTER, _LAST_LETTER, _NO_LETTERS = ord(" "), ord("~"), np.zeros(0, np.uint8)
PIECE = 1024  # rows whose texts are in memory at once
_KINDS = (
    (pa.types.is_struct, "s"), (pa.types.is_list, "l"), (pa.types.is_binary, "b"), (pa.types.is_string, "b"),
    (pa.types.is_boolean, "?"), (pa.types.is_floating, "f"), (pa.types.is_unsigned_integer, "u"),
    (pa.types.is_null, "-"),
)  # fmt: skip


class SheetColumns:
    """The columns of a table that its template reads, each with a place, in the order in which they are asked for."""

    def __init__(self, schema: pa.Schema, *first: str) -> None:
        self.schema = schema
        self.made: dict[str, Make] = {}
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

    def computed(self, name: str, make: Make) -> int:
        """Return the place of a column that the table does not have: it is made for each batch."""
        self.made[name] = make
        return self.place(name)


@dataclass(frozen=True, slots=True)
class _Compiled:
    columns: SheetColumns
    template: _native.Template


class Sheets:
    """Writes rows of transfers, batch by batch.

    Args:
        registry: the types that the batches were decoded with.
        row: gives the template of a transfer; columns beside those of `TRANSFERS` are given with each batch.
        part: gives templates of the messages or packets of a table, by its name, one for each place that the template
            of a transfer names; `None` for bytes that no packet claims. They are compiled once.
        beside: names and types of the columns that are given with each batch.
        first: columns of transfers in front of those that their template asks for; one at least, which tells how many
            rows there are.
        escaped: texts in messages and packets are made safe to print.

    The template of a transfer is asked for again with `compile`, when what it is made of has changed.
    """

    def __init__(
        self,
        registry: Registry,
        row: Callable[[SheetColumns], Template],
        part: Callable[[str, Message | Packet | None, SheetColumns], Sequence[Template | None]],
        beside: Mapping[str, pa.DataType],
        *,
        first: Sequence[str] = ("bus",),
        escaped: bool = False,
    ) -> None:
        self._first = first
        self._registry, self._made, self._part, self._escaped = registry, row, part, escaped
        self._schema = pa.schema([*TRANSFERS, *(pa.field(name, kind) for name, kind in beside.items())])
        self._parts: dict[str, _Compiled] = {}
        self.compile()

    def compile(self) -> None:
        """Ask for the template of a transfer."""
        columns = SheetColumns(self._schema, *self._first)
        self._row = _Compiled(columns, _native.Template([self._made(columns)]))

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
        if not len(rows):
            return
        parts = [part for message in messages for part in self._tables(batch, message)]
        transfers = batch.transfers
        columns = [flat(beside[name] if name in beside else transfers.column(name)) for name in self._row.columns.names]
        sheet = _native.Sheet(
            self._row.template, columns, parts, words, batch.first_transfer, np.asarray(rows, np.uint32)
        )
        for start in range(0, len(rows), PIECE):
            yield from sheet.texts(start, start + PIECE)

    def _tables(self, batch: Batch, message: Message) -> Iterator[tuple[_native.Template, list[Any], bool]]:
        for name, of, table in tables_of(batch, message, self._registry):
            yield self._table(name, of, table, packets=of is not message)

    def _table(
        self, name: str, of: Message | Packet | None, table: pa.RecordBatch, *, packets: bool
    ) -> tuple[_native.Template, list[Any], bool]:
        part = self._parts.get(name)
        if part is None or not (part.columns.schema is table.schema or part.columns.schema.equals(table.schema)):
            columns = SheetColumns(table.schema, "transfer", *(["offset"] if packets else []))
            template = _native.Template(list(self._part(name, of, columns)))
            part = self._parts[name] = _Compiled(columns, template)
        made = part.columns.made
        cells = [made[column](table) if column in made else table.column(column) for column in part.columns.names]
        return part.template, [flat(_printable(one) if self._escaped else one) for one in cells], packets


def tables_of(
    batch: Batch, message: Message, registry: Registry
) -> Iterator[tuple[str, Message | Packet | None, pa.RecordBatch]]:
    """Yield the tables of a type that have rows: its own, then of packets inside, then of bytes that none claims."""
    inside: list[tuple[str, Message | Packet | None]] = [(message.table, message)]
    if message.packets is not None:
        families = [message.packets, *registry.families()]
        kinds = {packet.name: packet for family in reversed(families) for packet in family.packets}
        inside += [(f"{message.table}.{name}", packet) for name, packet in kinds.items()]
        inside.append((f"{message.table}.{UNRECOGNIZED}", None))
    for name, of in inside:
        table = batch.messages.get(name)
        if table is not None and len(table):
            yield name, of, table


def _printable(array: pa.Array) -> pa.Array:
    if not pa.types.is_string(array.type):
        return array
    data = array.buffers()[2]
    letters = np.frombuffer(data, np.uint8) if data is not None else _NO_LETTERS
    if ((letters >= _FIRST_LETTER) & (letters <= _LAST_LETTER)).all():
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


def types_of(types: Sequence[Message | None], column: pa.Array, picked: Array | None) -> list[Message]:
    """Return the known types of the picked transfers (all if not given): no table of another one is needed."""
    places = distinct(numbers(column) if picked is None else numbers(column)[picked])
    return list({m.table: m for place in places if (m := types[place]) is not None}.values())


def type_names(batch: Batch, types: Sequence[Message | None], column: pa.Array) -> list[str]:
    """Return what people call the types of a batch, by place; unknown ones have a number."""
    kinds, ids = (numbers(batch.transfers.column(name)) for name in ("kind", "type_id"))
    names = []
    for place, message in enumerate(types):
        row = int(np.argmax(numbers(column) == place)) if message is None else 0
        names.append(type_name(message, int(kinds[row]), int(ids[row])))
    return names
