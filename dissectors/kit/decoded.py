"""Message and packet tables of a batch as rules read them, and the message tables all at once.

Columns are as in `dissectors.kit.tables`. A table of twenty rows takes as long to be asked for a column as one of
thousands, so those of a small batch are joined where all of them are asked the same.
"""

from __future__ import annotations

from functools import cached_property
from itertools import accumulate, groupby
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import column, offsets_of, pylist, valid
from dissectors.kit.nested import inner, listed, not_finite

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from dissectors.kit.array import Array

_Made = TypeVar("_Made")

# What every message table has in front of its fields.
_CONTEXT = ("transfer", "t", "bus", "src", "trusted", "bits_left", "pad_nonzero", "bad_tag", "layout")
_FEW = 1 << 12  # rows of a table that is joined with others
_MOST_KNOWN = 1 << 12  # tables whose columns are remembered by place

_known: dict[str, tuple[pa.Schema, Mapping[str, int]]] = {}


def _places_of(name: str, schema: pa.Schema) -> Mapping[str, int]:
    """Return the place of each column of a table: one that is called like this has mostly the same ones."""
    known = _known.get(name)
    if known is None or not known[0].equals(schema):
        if len(_known) >= _MOST_KNOWN:
            _known.clear()
        known = _known[name] = schema, {name: place for place, name in enumerate(schema.names)}
    return known[1]


class _NamedColumns:
    """Columns of numbers by name, made when they are asked for."""

    def __init__(self) -> None:
        self._columns: dict[str, Array] = {}

    def __getitem__(self, name: str) -> Array:
        """Return a column of numbers; cells without a value are arbitrary, a missing time is `NO_TIME`."""
        found = self._columns.get(name)
        if found is None:
            found = self._columns[name] = self._read(name)
        return found

    def _read(self, name: str) -> Array:
        raise NotImplementedError


class DecodedTable(_NamedColumns):
    """One message or packet table of a batch; `row` are rows of its transfers in this batch.

    A packet's row stands once for each packet; `name` is the carrier's and its own (`PUSHCAN.MotorStatus`).
    """

    def __init__(self, name: str, batch: pa.RecordBatch, first_transfer: int) -> None:
        super().__init__()
        self.name = name
        self._batch = batch
        self._first = first_transfer
        self._valid: dict[str, Array] = {}
        self._lists: dict[str, tuple[Array, Array]] = {}
        self._joined: tuple[_Joined, slice] | None = None
        self._made: dict[Callable[[DecodedTable], Any], Any] = {}

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self._batch.num_rows)

    def __contains__(self, name: object) -> bool:
        """Return whether there is such a column."""
        return name in self._places

    @cached_property
    def _places(self) -> Mapping[str, int]:
        return _places_of(self.name, self._batch.schema)

    @cached_property
    def _cells(self) -> pa.StructArray:
        return self._batch.to_struct_array()  # which gives its columns faster

    def _column(self, name: str) -> pa.Array:
        return self._cells.field(self._places[name])

    def _read(self, name: str) -> Array:
        if self._joined is not None and name in _CONTEXT:
            joined, rows = self._joined
            return joined[name][rows]
        return column(self._column(name), time=name == "t")

    def once(self, make: Callable[[DecodedTable], _Made]) -> _Made:
        """Return what `make` makes of the table, and keep it: several rules ask for it. Not to be written to."""
        if make not in self._made:
            made: Any = make(self)
            if isinstance(made, np.ndarray):
                made = made.view()
                made.flags.writeable = False
            self._made[make] = made
        found: _Made = self._made[make]
        return found

    def join(self, joined: _Joined, rows: slice) -> None:
        """Take columns from what they are joined in, where they are these rows."""
        self._joined = joined, rows

    @property
    def context(self) -> pa.RecordBatch:
        """The columns in front of its fields, those of every message table in the same order."""
        return self._batch.select([self._places[name] for name in _CONTEXT])

    @cached_property
    def row(self) -> Array:
        """Rows of the transfers of this batch."""
        return (self["transfer"] - np.uint64(self._first)).astype(np.int64)

    @property
    def t(self) -> Array:
        """Time of each transfer's first frame."""
        return self["t"]

    @property
    def bus(self) -> Array:
        """Index of the interface."""
        return self["bus"]

    @property
    def src(self) -> Array:
        """Source node ID."""
        return self["src"]

    @cached_property
    def sender(self) -> Array:
        """Bus and node of each row in one number of 16 bits, as `kit.sender` has it: many rules ask."""
        node: Array = self.bus.astype(np.uint16) << 7
        node |= self.src & 0x7F
        return node

    @cached_property
    def trusted(self) -> Array:
        """Mask of the rows whose transfer is complete with a good CRC, or one frame."""
        return self["trusted"]

    @cached_property
    def good(self) -> int:
        """How many of them are trusted."""
        return int(np.count_nonzero(self.trusted))

    def has(self, name: str) -> Array:
        """Return a mask of the rows in which the column has a value."""
        if name not in self._valid:
            self._valid[name] = valid(self._column(name))
        return self._valid[name]

    def lists(self, name: str) -> tuple[Array, Array]:
        """Return of a column of lists where each row's begins (one entry more than rows), and all values."""
        if name not in self._lists:
            self._lists[name] = listed(self._column(name))
        return self._lists[name]

    def inner(self, name: str, *members: str) -> tuple[Array, Array]:
        """Return the numbers of a column, also those in its lists and structures: the row of each, and the values.

        `members` lead to them, one step for each structure; what has no value is left out.
        """
        return inner(self._column(name), np.arange(len(self)), members)

    def counts(self, name: str) -> Array:
        """Return how many elements each list of a column has; 0 in a column of anything else."""
        array = self._column(name)
        if not pa.types.is_list(array.type):
            return np.zeros(len(array), np.int64)
        ends = offsets_of(array)
        return (ends[1:] - ends[:-1]).astype(np.int64)

    def cell(self, name: str, row: int) -> Any:
        """Return one cell as a Python value."""
        return pylist(self._column(name).slice(row, 1))[0]

    def not_finite(self, name: str) -> Iterator[tuple[str, Array, Array]]:
        """Yield floats of a field that are NaN or infinite: dotted name, rows in order, values; also in structures."""
        yield from not_finite(self._column(name), name)


class _Joined(_NamedColumns):
    """The columns in front of the fields of several tables, as one; it knows no table: all of them know it."""

    def __init__(self, parts: Sequence[pa.RecordBatch]) -> None:
        super().__init__()
        self._rows = pa.concat_batches(parts).to_struct_array()

    def _read(self, name: str) -> Array:
        return column(self._rows.field(_CONTEXT.index(name)), time=name == "t")


class Context:
    """Message tables of a batch joined to one, as far as what stands in front of their fields.

    Columns are numpy arrays of all their rows, made when they are asked for: `transfer`, `t`, `bus`, `src`, `trusted`,
    `bits_left`, `pad_nonzero`, `bad_tag`, `layout`.
    """

    def __init__(self, tables: Sequence[DecodedTable]) -> None:
        self.tables = tables
        # Where each table begins, one entry more than tables.
        self.starts = [0, *accumulate(map(len, tables))]
        self._columns: _NamedColumns = tables[0]
        if len(tables) > 1:
            joined = self._columns = _Joined([one.context for one in tables])
            for table, rows in zip(tables, map(slice, self.starts, self.starts[1:]), strict=False):
                table.join(joined, rows)

    def __getitem__(self, name: str) -> Array:
        """Return a column; a missing time is `NO_TIME`."""
        return self._columns[name]

    @cached_property
    def table(self) -> Array:
        """The place in `tables` of each row's table."""
        return np.repeat(np.arange(len(self.tables)), np.diff(self.starts))


def contexts_of(tables: Iterable[DecodedTable]) -> list[Context]:
    """Return what message tables of a batch are joined to, in order: small ones that follow each other to one."""
    found: list[Context] = []
    for small, some in groupby(tables, lambda table: len(table) < _FEW):
        alike = [*some]
        found += [Context(alike)] if small else [Context([one]) for one in alike]
    return found
