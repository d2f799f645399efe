"""How nodes are read, as it was known at one moment, and what rows say of it."""

from __future__ import annotations

from dataclasses import dataclass
from mmap import ACCESS_COPY, mmap
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.decode.columns import NODES, linear, senders
from dissectors.kit.cells import numbers, same_text, valid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array
    from dissectors.schema import Derived, Message, Reading

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
        self._bits: Array = np.frombuffer(mmap(-1, NODES * _BYTES, access=ACCESS_COPY), np.uint64)
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

    def codes(self, nodes: Array, transfers: Array) -> tuple[Array, Array]:
        """Return the number of each row's choice, and whether that is decided, by its sender and transfer."""
        by_node = self.decided
        known = by_node.done[nodes] if self.ahead else transfers >= by_node.since[nodes]
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


class _Followed:
    """A column that follows a reading: its place in the tables of the message, and that of the field it comes from."""

    def __init__(self, column: Derived, reading: Reading, schema: pa.Schema) -> None:
        self.place = schema.get_field_index(column.name)
        self._source = schema.get_field_index(column.source)
        self._scale, self._offset = column.scale, column.offset
        self._adds = np.array([np.nan, *(float(column.by_choice.get(one, np.nan)) for one in reading.choices)])

    def values(self, code: Array, columns: Sequence[pa.Array]) -> pa.Array:
        """Return it for rows of these choices; rows without one stay."""
        adds, plain = self._adds[code], columns[self.place]
        by_reading = linear(numbers(columns[self._source]), self._scale, self._offset) + adds
        values = np.where(np.isnan(adds), numbers(plain), by_reading)
        return pa.array(values, mask=~valid(plain)) if plain.null_count else pa.array(values)


class ToldColumns:
    """The tables of one message as readings have them: its columns with one more for each, and one for all of them."""

    def __init__(self, readings: Sequence[Told], plain: pa.Schema) -> None:
        self._at = plain.get_field_index("layout") + 1
        names = [reading_column(told.reading.name) for told in readings]
        more = [*(pa.field(name, pa.string()) for name in names), pa.field("decided", pa.bool_())]
        fields = list(plain)
        self._schema = pa.schema([*fields[: self._at], *more, *fields[self._at :]], metadata=plain.metadata)
        self._followed = [
            [_Followed(one, told.reading, plain) for one in told.message.derived if one.reading == told.reading.name]
            for told in readings
        ]

    def tell(self, readings: Sequence[Told], rows: pa.RecordBatch) -> pa.RecordBatch:
        """Return rows of the message as their nodes' readings have them, with a column that says so for each."""
        columns, more, decided = rows.columns, [], np.ones(len(rows), bool)
        nodes, transfers = senders(rows), numbers(rows.column("transfer"))
        for told, followed in zip(readings, self._followed, strict=True):
            code, known = told.codes(nodes, transfers)
            decided &= known
            for one in followed:
                columns[one.place] = one.values(code, columns)
            more.append(told.named(code))
        whole = [*columns[: self._at], *more, pa.array(decided), *columns[self._at :]]
        return pa.RecordBatch.from_arrays(whole, schema=self._schema)
