"""The tables of a batch as rules see them: columns of numbers, and the few cells that are not.

Times are integer nanoseconds, frames and transfers are numbered through the whole capture from 0.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence, Sized
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[Any]

MILLISECOND = 1_000_000
SECOND = 1_000_000_000
# In place of a time that a capture does not have.
NO_TIME = int(np.iinfo(np.int64).min)


class Kept(NamedTuple):
    """A frame of the recent past; `id` without flag bits, `flags` and `verdict` as in the table of frames."""

    t: int
    bus: int
    id: int
    flags: int
    data: bytes
    verdict: int


class Frames(Sized, Protocol):
    """The frames of a batch, column by column. `t` is `NO_TIME` where a capture has no time."""

    first: int
    t: Words
    bus: Words
    id: Words
    flags: Words
    line: Words
    verdict: Words
    anomaly: Words

    @property
    def length(self) -> Words:
        """Bytes of each data field."""

    def data(self, row: int) -> bytes:
        """The data field of a row of this batch, tail byte included."""


class Transfers(Sized, Protocol):
    """The transfers of a batch, in the order of their ends; columns as in the table of transfers.

    `t` and `t_end` are `NO_TIME` where there is no time. `lead` is the number of a transfer's first frame, `length`
    that of its payload bytes, `code` its type for `View.type_name`. Cells of `dst`, `crc_wire`, `crc_here`, `step` and
    `gap` that do not exist are arbitrary: ask `has`.
    """

    first: int
    t: Words
    t_end: Words
    bus: Words
    kind: Words
    type_id: Words
    variant: Words
    src: Words
    dst: Words
    priority: Words
    transfer_id: Words
    status: Words
    crc_wire: Words
    crc_here: Words
    step: Words
    gap: Words
    anomaly: Words
    fd: Words

    @property
    def lead(self) -> Words:
        """The number of each transfer's first frame, -1 for none."""

    @property
    def length(self) -> Words:
        """Payload bytes of each, CRC left out."""

    @property
    def code(self) -> Words:
        """Types, for `View.type_name`."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def frames(self, row: int) -> Sequence[int]:
        """Numbers of all frames of a transfer of this batch."""

    def payload(self, row: int) -> bytes:
        """The payload of a transfer of this batch, CRC left out."""


class Table(Sized, Container[str], Protocol):
    """One message or packet table of a batch. `row` are rows of its transfers in this batch.

    A packet's row stands once for each packet; `name` is the carrier's and its own (`PUSHCAN.MotorStatus`).
    """

    name: str

    @property
    def row(self) -> Words:
        """Rows of the transfers of this batch."""

    @property
    def t(self) -> Words:
        """Time of each transfer's first frame."""

    @property
    def bus(self) -> Words:
        """Index of the interface."""

    @property
    def src(self) -> Words:
        """Source node ID."""

    @property
    def trusted(self) -> Words:
        """Rows of complete transfers with a good CRC, or of one frame."""

    def __getitem__(self, column: str) -> Words:
        """A column of numbers as numpy; cells without a value are arbitrary."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def lists(self, column: str) -> tuple[Words, Words]:
        """A column of lists: where each row's begins (one entry more than rows), and all values."""

    def counts(self, column: str) -> Words:
        """How many elements each list of a column has; 0 in a column of anything else."""

    def cell(self, column: str, row: int) -> Any:
        """One cell as a Python value."""

    def not_finite(self, column: str) -> Iterable[tuple[str, Words, Words]]:
        """Floats of a field that are NaN or infinite: dotted name, rows in order, values; also inside structures."""


class Events(Sized, Protocol):
    """Error frames, drop counts, gaps, unreadable lines and comments of a batch; `kind` indexes `tables.EVENTS`."""

    t: Words
    bus: Words
    line: Words
    kind: Words
    tx_errors: Words
    rx_errors: Words

    @property
    def number(self) -> Words:
        """Error class bits, or frames dropped."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def text(self, row: int) -> str:
        """Reason and excerpt of an unreadable line, or a comment."""

    def data(self, row: int) -> bytes:
        """The data field of an error frame."""
