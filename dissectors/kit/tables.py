"""The tables of a batch as rules read them: numpy columns over Arrow, made when they are asked for.

Times are integer nanoseconds, `NO_TIME` where there is none; frames and transfers are numbered through the whole
capture from 0. Cells without a value are arbitrary: ask `has`.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers, offsets_of, pylist, valid
from dissectors.kit.nested import inner, listed, not_finite
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit.array import Array

_TIMES = ("t", "t_end")
_SMALL = 1 << 15  # rows: of a bus that runs some thousand come at once


class Columns:
    """A table; its columns are attributes, a missing time is `NO_TIME`."""

    kept: ClassVar[Sequence[str]] = ()  # columns that are kept when the batch is gone
    long: ClassVar[str] = "data"  # the column of bytes

    def __init__(self, batch: pa.RecordBatch, first: int = 0) -> None:
        self._batch = batch
        self.first = first

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self._batch.num_rows)

    def __getattr__(self, name: str) -> Array:
        """Return a column of numbers, and keep it."""
        place = -1 if name.startswith("_") else self._batch.schema.get_field_index(name)
        if place < 0:
            raise AttributeError(name)
        values = column(self._batch.column(place), time=name in _TIMES)
        setattr(self, name, values)
        return values

    @cached_property
    def bare(self) -> Self:
        """The same rows for all who keep them, with the columns that are `kept`.

        A small batch is copied, one column close behind the other: those of the core have room to grow, and lie in
        between what is needed for a moment only.
        """
        batch = self._batch.select(self.kept)
        return type(self)(_packed(batch) if len(batch) < _SMALL else batch, self.first)

    def has(self, name: str) -> Array:
        """Return a mask of the rows in which the column has a value, and keep it."""
        if name not in self._valid:
            self._valid[name] = valid(self._batch.column(name))
        return self._valid[name]

    @cached_property
    def _valid(self) -> dict[str, Array]:
        return {}

    @cached_property
    def raw(self) -> tuple[Array, memoryview]:
        """All data fields, or payloads: where each begins (one entry more than rows), and the bytes."""
        array = self._batch.column(self.long)
        data = array.buffers()[2]
        return offsets_of(array), memoryview(b"" if data is None else data)

    def _bytes(self, row: int) -> bytes:
        offsets, data = self.raw
        return bytes(data[offsets.item(row) : offsets.item(row + 1)])

    def _lengths(self) -> Array:
        offsets, _ = self.raw
        sizes: Array = offsets[1:] - offsets[:-1]
        return sizes


class FrameTable(Columns):
    """The frames of a batch, column by column; `first` is the number of the first one."""

    kept = ("t", "bus", "id", "flags", "data", "verdict")

    t: Array
    bus: Array
    id: Array
    flags: Array
    line: Array
    verdict: Array
    anomaly: Array

    @cached_property
    def length(self) -> Array:
        """Bytes of each data field."""
        return self._lengths()

    @cached_property
    def tail(self) -> Array:
        """The last byte of each data field, 0 of an empty one: it says nothing."""
        ends, data = self.raw
        if not len(data):
            return np.zeros(len(self), np.uint8)
        last = np.frombuffer(data, np.uint8).take(ends[1:] - 1, mode="clip")
        return np.where(self.length > 0, last, np.uint8(0))

    def data(self, row: int) -> bytes:
        """Return the data field of a row of this batch, tail byte included."""
        return self._bytes(row)


class TransferTable(Columns):
    """The transfers of a batch, in the order of their ends; columns as in the table of transfers.

    `lead` is the number of a transfer's first frame, `length` that of its payload bytes, `code` its type for
    `View.type_name`. `has` says which cells of `dst`, `crc_wire`, `crc_here`, `step` and `gap` exist.
    """

    kept = ("t", "bus", "kind", "type_id", "variant", "src", "frame")
    long = "payload"

    t: Array
    t_end: Array
    bus: Array
    kind: Array
    type_id: Array
    variant: Array
    src: Array
    dst: Array
    priority: Array
    transfer_id: Array
    status: Array
    crc_wire: Array
    crc_here: Array
    step: Array
    gap: Array
    anomaly: Array
    fd: Array

    @cached_property
    def length(self) -> Array:
        """Payload bytes of each."""
        return self._lengths()

    @cached_property
    def code(self) -> Array:
        """Types as one number each: variant, kind and type ID."""
        codes = self.variant.astype(np.int64) << 24
        codes |= self.kind.astype(np.int64) << 16
        return codes | self.type_id

    @cached_property
    def lead(self) -> Array:
        """The number of each transfer's first frame."""
        offsets, numbers_ = self.frame_lists
        if not len(numbers_):
            return np.full(len(self), -1, np.int64)
        first = numbers_[np.minimum(offsets[:-1], len(numbers_) - 1)].astype(np.int64)
        return np.where(np.diff(offsets) > 0, first, -1)

    @cached_property
    def frame_lists(self) -> tuple[Array, Array]:
        """Where the frames of each transfer begin (one entry more than rows), and the numbers of all."""
        return listed(self._batch.column("frame"))

    def frames(self, row: int) -> Sequence[int]:
        """Return the numbers of all frames of a transfer of this batch."""
        offsets, numbers_ = self.frame_lists
        found: list[int] = numbers_[offsets.item(row) : offsets.item(row + 1)].tolist()
        return found

    def payload(self, row: int) -> bytes:
        """Return the payload of a transfer of this batch, CRC left out."""
        return self._bytes(row)

    def payloads(self, rows: Array) -> Array:
        """Return the payloads of transfers of this batch that are equally long, a row of bytes each."""
        offsets, data = self.raw
        size = int(offsets[rows[0] + 1] - offsets[rows[0]]) if len(rows) else 0
        found: Array = np.frombuffer(data, np.uint8)[offsets[rows].astype(np.int64)[:, None] + np.arange(size)]
        return found


class EventTable(Columns):
    """Error frames, drop counts, gaps, unreadable lines and comments of a batch.

    `kind` is 0 to 4 for these, in this order.
    """

    t: Array
    bus: Array
    line: Array
    kind: Array
    tx_errors: Array
    rx_errors: Array

    @cached_property
    def number(self) -> Array:
        """Error class bits, or frames dropped."""
        return column(self._batch.column("class"))

    def text(self, row: int) -> str:
        """Return reason and excerpt of an unreadable line, or a comment."""
        return str(self._batch.column("text")[row].as_py() or "")

    def data(self, row: int) -> bytes:
        """Return the data field of an error frame."""
        return self._bytes(row)


class DecodedTable:
    """One message or packet table of a batch; `row` are rows of its transfers in this batch.

    A packet's row stands once for each packet; `name` is the carrier's and its own (`PUSHCAN.MotorStatus`).
    """

    def __init__(self, name: str, batch: pa.RecordBatch, first_transfer: int) -> None:
        self.name = name
        self._batch = batch
        self._first = first_transfer
        self._columns: dict[str, Array] = {}
        self._valid: dict[str, Array] = {}
        self._lists: dict[str, tuple[Array, Array]] = {}

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
    def _places(self) -> dict[str, int]:
        return {name: place for place, name in enumerate(self._batch.schema.names)}

    def __getitem__(self, name: str) -> Array:
        """Return a column of numbers; cells without a value are arbitrary."""
        if name not in self._columns:
            self._columns[name] = column(self._batch.column(self._places[name]), time=name in _TIMES)
        return self._columns[name]

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
            self._valid[name] = valid(self._batch.column(self._places[name]))
        return self._valid[name]

    def lists(self, name: str) -> tuple[Array, Array]:
        """Return of a column of lists where each row's begins (one entry more than rows), and all values."""
        if name not in self._lists:
            self._lists[name] = listed(self._batch.column(name))
        return self._lists[name]

    def inner(self, name: str, *members: str) -> tuple[Array, Array]:
        """Return the numbers of a column, also those in its lists and structures: the row of each, and the values.

        `members` lead to them, one step for each structure; what has no value is left out.
        """
        return inner(self._batch.column(name), np.arange(len(self)), members)

    def counts(self, name: str) -> Array:
        """Return how many elements each list of a column has; 0 in a column of anything else."""
        array = self._batch.column(name)
        if not pa.types.is_list(array.type):
            return np.zeros(len(array), np.int64)
        ends = offsets_of(array)
        return (ends[1:] - ends[:-1]).astype(np.int64)

    def cell(self, name: str, row: int) -> Any:
        """Return one cell as a Python value."""
        return pylist(self._batch.column(name).slice(row, 1))[0]

    def not_finite(self, name: str) -> Iterator[tuple[str, Array, Array]]:
        """Yield floats of a field that are NaN or infinite: dotted name, rows in order, values; also in structures."""
        yield from not_finite(self._batch.column(name), name)


def column(array: pa.Array, *, time: bool = False) -> Array:
    """Return a column of numbers; missing cells are arbitrary, missing times `NO_TIME`."""
    values = numbers(array)
    if time and array.null_count:
        values = np.where(valid(array), values, NO_TIME)
    return values


def _packed(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return a copy in one piece of memory."""
    return pa.ipc.read_record_batch(batch.serialize(), batch.schema)
