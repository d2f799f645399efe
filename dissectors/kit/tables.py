"""The tables of a batch as rules read them: numpy columns over Arrow, made when they are asked for.

Times are integer nanoseconds, `NO_TIME` where there is none; frames and transfers are numbered through the whole
capture from 0. Cells without a value are arbitrary: ask `has`.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import column, offsets_of, valid
from dissectors.kit.nested import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def _packed(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return a copy in one piece of memory."""
    return pa.ipc.read_record_batch(batch.serialize(), batch.schema)
