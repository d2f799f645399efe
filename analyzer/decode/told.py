"""How nodes are read, as it was known at one moment, and what rows say of it."""

from __future__ import annotations

from dataclasses import dataclass
from mmap import mmap
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.decode.columns import linear, senders
from dissectors.kit.cells import numbers, same_text, valid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array
    from dissectors.schema import Derived, Message, Reading

NODES = 1 << 16  # bus and source node ID
_BYTES = 8  # of a number
NEVER = np.iinfo(np.uint64).max


def reading_column(name: str) -> str:
    """Return the column that says how a row's doubtful field is read."""
    return f"reading.{name}"


class ByNode:
    """A number of 64 bits for each node: `NEVER`, or NaN, of those of which nobody has said any.

    Bits are kept as their complements: zeros take no memory as long as nobody writes them, and few nodes speak.
    """

    def __init__(self, kind: Any = np.uint64) -> None:
        # Zeros of numpy may lie where others have written before: then all of them are written.
        self._bits: Array = np.frombuffer(mmap(-1, NODES * _BYTES), np.uint64)
        self._kind = np.dtype(kind)

    def __getitem__(self, nodes: Array | int) -> Array:
        """Return the numbers of some nodes, or of one."""
        found: Array = (~self._bits[nodes]).view(self._kind)
        return found

    def __setitem__(self, nodes: Array | int, values: Array | int) -> None:
        """Set the numbers of some nodes; of several of one node the last one stays."""
        self._bits[nodes] = ~np.asarray(values, self._kind).view(np.uint64)

    def lower(self, nodes: Array, values: Array) -> None:
        """Set those that are higher than these, u64."""
        np.maximum.at(self._bits, nodes, ~np.asarray(values, np.uint64))


class Decided:
    """The decisions on one reading, by node: `code` is the number of its choice from 1, 0 for none.

    `since` is the first transfer for which that holds, `done` whether it is decided.
    """

    def __init__(self) -> None:
        self.code, self.since, self.done = np.zeros(NODES, np.uint8), ByNode(), np.zeros(NODES, bool)

    def copy(self) -> Decided:
        """Return what can change without this one."""
        other, known = Decided(), np.flatnonzero(self.done)
        other.code[known], other.since[known], other.done[known] = self.code[known], self.since[known], True
        return other


@dataclass(frozen=True, slots=True)
class Told:
    """One reading of one message, as it was known at one moment. `ahead`: rows have waited for what decides them."""

    message: Message
    reading: Reading
    decided: Decided
    ahead: bool

    def codes(self, table: pa.RecordBatch) -> tuple[Array, Array]:
        """Return the number of each row's choice, and whether that is decided."""
        nodes, by_node = senders(table), self.decided
        known = by_node.done[nodes] if self.ahead else numbers(table.column("transfer")) >= by_node.since[nodes]
        if known.all():
            return by_node.code[nodes], known
        otherwise = self.reading.otherwise
        number = self.reading.choices.index(otherwise) + 1 if otherwise else 0
        return np.where(known, by_node.code[nodes], np.uint8(number)), known

    def named(self, code: Array) -> pa.Array:
        """Return choices by their numbers, null for none."""
        if len(code) and code[0] and (code == code[0]).all():  # mostly all are read alike
            return same_text(self.reading.choices[code[0] - 1], len(code))
        names = pa.array([None, *self.reading.choices], pa.string())
        return names.take(pa.array(code))

    def followed(self, column: Derived, code: Array, table: pa.RecordBatch) -> pa.Array:
        """Return a column that follows the reading; rows without one stay."""
        adds = np.array([np.nan, *(float(column.by_choice.get(one, np.nan)) for one in self.reading.choices)])[code]
        plain = table.column(column.name)
        by_reading = linear(numbers(table.column(column.source)), column.scale, column.offset) + adds
        values = np.where(np.isnan(adds), numbers(plain), by_reading)
        return pa.array(values, mask=~valid(plain)) if plain.null_count else pa.array(values)


def tell(readings: Sequence[Told], rows: pa.RecordBatch) -> pa.RecordBatch:
    """Return the rows of a message as their nodes' readings have them, with a column that says so for each."""
    if not readings:
        return rows
    decided = np.ones(len(rows), bool)
    columns = dict(zip(rows.schema, rows.columns, strict=True))
    more: list[tuple[pa.Field, pa.Array]] = []
    for told in readings:
        code, known = told.codes(rows)
        decided &= known
        for column in told.message.derived:
            if column.reading == told.reading.name:
                columns[rows.schema.field(column.name)] = told.followed(column, code, rows)
        more.append((pa.field(reading_column(told.reading.name), pa.string()), told.named(code)))
    more.append((pa.field("decided", pa.bool_()), pa.array(decided)))
    own = list(columns.items())
    at = rows.schema.get_field_index("layout") + 1
    pairs = [*own[:at], *more, *own[at:]]
    schema = pa.schema([one for one, _ in pairs], metadata=rows.schema.metadata)
    return pa.RecordBatch.from_arrays([column for _, column in pairs], schema=schema)
