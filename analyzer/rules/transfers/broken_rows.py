"""Broken transfers in columns: nothing is looked up but for those that are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis.budgets import senders_of, shapes_of
from analyzer.rules.diagnosis.checksums import may_be_mistaken, one_bit_of_each, starts_of_all
from analyzer.rules.diagnosis.search import FrameLists
from analyzer.rules.transfers.incomplete import BY_CRC, CUT, LATE, ROOM, Incomplete
from analyzer.rules.transfers.lists import Lists
from analyzer.rules.view import MESSAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.transfers.incomplete import Source
    from dissectors.kit import Array, TransferTable, Types

ENDED = ("", CUT, LATE)  # what `BrokenTransfers.ended` stands for
_NUMBERS = (
    "due", "batch", "ended", "t", "t_end", "bus", "src", "node", "code", "fd", "length", "crc", "wire", "told", "here",
    "size", "lead", "last",
)  # fmt: skip


class BrokenTransfers:
    """Broken transfers of some batches, in the order in which they ended; cells are i64.

    `due` are bits of what is still to be told of each, `ended` says which rule the missing end breaches, `batch` is the
    number of the batch's first transfer. `crc` says whether there is a CRC as received (`wire`), `told` whether there
    is one as computed (`here`). `size` is how many frames came, `lead` and `last` are the numbers of the first and the
    last, `frames` those of all.
    """

    def __init__(self, cells: Array, frames: Lists, payloads: Lists) -> None:
        self._cells, self.frames, self.payloads = cells, frames, payloads
        (
            self.due, self.batch, self.ended, self.t, self.t_end, self.bus, self.src, self.node, self.code, self.fd,
            self.length, self.crc, self.wire, self.told, self.here, self.size, self.lead, self.last,
        ) = cells  # fmt: skip

    @classmethod
    def none(cls) -> Self:
        """Return no rows."""
        return cls(np.empty((len(_NUMBERS), 0), np.int64), Lists.none(np.uint64), Lists.none(np.uint8))

    @classmethod
    def of(cls, t: TransferTable, rows: Array, due: Array, ended: Array) -> Self:
        """Return rows of a batch."""
        offsets, numbers = t.frame_lists
        begins, ends, crc = offsets[rows], offsets[rows + 1], t.has("crc_wire")[rows]
        src, code = t.src[rows].astype(np.int64), t.code[rows]
        node = np.where((src == 0) & (code >> 16 != MESSAGE), NOBODY, src)
        columns = (
            due, t.first, ended, t.t[rows], t.t_end[rows], t.bus[rows], src, node, code, t.fd[rows], t.length[rows],
            crc, t.crc_wire[rows], t.has("crc_here")[rows], t.crc_here[rows], ends - begins, t.lead[rows],
            numbers[ends - 1],
        )  # fmt: skip
        cells = np.empty((len(columns), len(rows)), np.int64)
        for k, column in enumerate(columns):
            cells[k] = column
        begins, data = t.raw
        payloads = Lists(begins, np.frombuffer(data, np.uint8)).take(rows)
        return cls(cells, Lists(offsets, numbers).take(rows), payloads)

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.t)

    def left(self, due: Array) -> Self:
        """Return those of which something is still to be told, if that is `due` of each."""
        rows = due.nonzero()[0]
        cells = self._cells.take(rows, axis=1)
        cells[0] = due[rows]
        return type(self)(cells, self.frames.take(rows), self.payloads.take(rows))

    def joined(self, more: BrokenTransfers) -> Self:
        """Return these and others behind them."""
        cells = np.concatenate((self._cells, more._cells), axis=1)
        return type(self)(cells, self.frames.joined(more.frames), self.payloads.joined(more.payloads))

    def before(self, rows: Array, end: int) -> int:
        """Return how many of some rows come before the first whose last frame is not before another one."""
        late = self.last[rows] >= end
        return int(late.argmax()) if late.any() else len(late)

    def senders(self, rows: Array) -> Array:
        """Return senders and types, a number each."""
        return senders_of(self.bus[rows], self.src[rows], self.code[rows])

    def shapes(self, rows: Array) -> Array:
        """Return frames and bytes of each that came, a number each."""
        return shapes_of(self.size[rows], self.length[rows] + 2 * self.crc[rows])

    def sources(self, rows: Array) -> list[Source]:
        """Return bus, node and type of each."""
        return list(zip(*(column[rows].tolist() for column in (self.bus, self.src, self.code)), strict=True))

    def lists(self, rows: Array) -> FrameLists:
        """Return their frames."""
        offsets, numbers = self.frames.take(rows)
        return FrameLists(numbers, offsets, self.code[rows], self.fd[rows])

    def starts(self, rows: Array) -> Array:
        """Return from which value the CRC of each starts, as it was received."""
        return starts_of_all(self.wire[rows], *self.payloads.take(rows))

    def may_be_mistaken(self, types: Types, rows: Array) -> Array:
        """Return a mask of those whose CRC a usual mistake may give."""
        return may_be_mistaken(types, self.code[rows], self.wire[rows], *self.payloads.take(rows))

    def turned(self, rows: Array) -> Array:
        """Return a mask of those whose CRC one turned bit explains."""
        found: Array = (self._turned(rows) >= 0) & (self.told[rows] != 0)
        return found

    def turned_inside(self, rows: Array) -> Array:
        """Return a mask of those of which `turned_bit` tells which one, if frames are full."""
        at = self._turned(rows)
        found: Array = (at >= 0) & (at // np.where(self.fd[rows], *ROOM) < self.size[rows])
        return found

    def _turned(self, rows: Array) -> Array:
        return one_bit_of_each(self.wire[rows] ^ self.here[rows], self.length[rows])

    def frames_of(self, row: int) -> Sequence[int]:
        """Return the numbers of the frames of one."""
        return self.frames.one(row)

    def payload(self, row: int) -> bytes:
        """Return the payload of one, CRC left out."""
        offsets, data = self.payloads
        return bytes(data[offsets.item(row) : offsets.item(row + 1)])

    def one(self, rule: str, row: int) -> Incomplete:
        """Return one as breach of a rule."""
        one = dict(zip(_NUMBERS, self._cells[:, row].tolist(), strict=True))
        by_crc = rule in BY_CRC
        wire, here = (one["wire"], one["here"]) if by_crc and one["crc"] else (0, 0)
        return Incomplete(
            rule, one["t"], one["bus"], one["src"], one["code"], bool(one["fd"]), self.frames_of(row), wire, here,
            self.payload(row) if by_crc else b"", one["length"] + 2 * one["crc"], one["t_end"],
        )  # fmt: skip
