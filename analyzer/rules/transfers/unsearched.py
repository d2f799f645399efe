"""Broken transfers whose cause is not searched, in columns: nothing is looked up but for those that are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis.checksums import CORRUPTED, one_bit_fits
from analyzer.rules.diagnosis.proofs import Cause
from analyzer.rules.transfers.incomplete import (
    CUT,
    FOLLOWS,
    LATE,
    SEQUENCE,
    Incomplete,
    take_row,
    turned_bit,
    values_of,
)
from analyzer.rules.view import MESSAGE
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.diagnosis.budgets import Sender, Shape
    from dissectors.kit import Array, TransferTable, Values, View

ENDED = ("", CUT, LATE)  # what `Rows.ended` stands for
TURNED_BIT = Cause(CORRUPTED, " by one turned bit")  # of those that are shown it is said which one


class Rows(NamedTuple):
    """Transfers that breach a rule, in the order in which they ended.

    `row` are rows of the table, `frames` how many came of each, and `last` the number of the last of these. `ended`
    says which rule the missing end breaches, if another one says why.
    """

    rule: str
    table: TransferTable
    row: Array
    ended: Array
    frames: Array
    last: Array

    @classmethod
    def of(cls, rule: str, table: TransferTable, row: Array, ended: Array) -> Rows:
        """Return rows of a table."""
        begins, numbers = table.frame_lists
        return cls(
            rule, table, row, ended, begins[row + 1] - begins[row], numbers[begins[row + 1] - 1].astype(np.int64)
        )

    def take(self, which: Array | slice) -> Rows:
        """Return some of them."""
        columns = (column[which] for column in (self.row, self.ended, self.frames, self.last))
        return Rows(self.rule, self.table, *columns)

    def before(self, end: int) -> int:
        """Return how many come before the first whose last frame is not before another one."""
        late = self.last >= end
        return int(late.argmax()) if late.any() else len(late)

    def each(self) -> Iterator[tuple[Sender, Shape, int]]:
        """Yield of each who sent it, its shape and its last frame."""
        t, row = self.table, self.row
        senders = zip(*(column[row].tolist() for column in (t.bus, t.src, t.code)), strict=True)
        received = t.length[row] + 2 * t.has("crc_wire")[row]
        shapes = zip(self.frames.tolist(), received.tolist(), strict=True)
        return zip(senders, shapes, self.last.tolist(), strict=True)

    def times(self, k: int) -> tuple[int, int]:
        """Return when one began and ended."""
        row = self.row[k]
        return int(self.table.t[row]), int(self.table.t_end[row])

    def crc_and_payload(self, k: int) -> tuple[int, bytes]:
        """Return the CRC of one as received, and all bytes behind it."""
        row = int(self.row[k])
        return int(self.table.crc_wire[row]), self.table.payload(row)

    def turned(self) -> Array:
        """Return a mask of those whose CRC one turned bit explains."""
        t, row = self.table, self.row
        return one_bit_fits(t.crc_wire[row].astype(np.int64) ^ t.crc_here[row], t.length[row]) & t.has("crc_here")[row]

    def one(self, k: int) -> Incomplete:
        """Return one of them."""
        return take_row(self.table, self.rule, int(self.row[k]), ENDED[self.ended[k]])

    def occurrences(self, view: View, causes: Sequence[Cause], *, noted: bool, drops: bool) -> Occurrences:
        """Return them as breaches; those of one cause have one key."""
        t, row = self.table, self.row
        src, code = t.src[row].astype(np.int64), t.code[row]
        nobody = (src == 0) & (code >> 16 != MESSAGE)
        ids: dict[str, int] = {}
        key = np.array([ids.setdefault(cause.what, len(ids)) for cause in causes], np.int64)

        def values(k: int) -> Values:
            one = self.one(k)
            return values_of(view, one, turned_bit(one) if causes[k] is TURNED_BIT else causes[k])

        return Occurrences(
            rule=self.rule, t=t.t[row], bus=t.bus[row], node=np.where(nobody, NOBODY, src), type=code,
            frame=t.lead[row], values=values, frames=lambda k: t.frames(int(row[k])), key=key,
            severity="note" if noted else None, drops=drops,
        )  # fmt: skip

    def ends(self, rule: str) -> Rows:
        """Return those whose missing end breaches another rule, as breaches of that."""
        return self.take(np.flatnonzero(self.ended == ENDED.index(rule)))._replace(rule=rule)


class Told:
    """Collects what is said of transfers that are not searched, so that many are told at once."""

    def __init__(self) -> None:
        self._parts: dict[tuple[TransferTable, str, bool, bool], tuple[list[int], list[int], list[Cause]]] = {}

    def add(
        self, rows: Rows, k: int, cause: Cause, *, rule: str = "", noted: bool = False, drops: bool = False
    ) -> None:
        """Add one of some rows, as a breach of their rule or of another one."""
        row, ended, causes = self._parts.setdefault((rows.table, rule or rows.rule, noted, drops), ([], [], []))
        row.append(int(rows.row[k]))
        ended.append(int(rows.ended[k]))
        causes.append(cause)

    def occurrences(self, view: View) -> Iterator[Occurrences]:
        """Yield all of them, and the ends that broken sequences take with them; then there are none."""
        parts, self._parts = self._parts, {}
        for (table, rule, noted, drops), (row, ended, causes) in parts.items():
            rows = Rows.of(rule, table, np.array(row, np.int64), np.array(ended, np.int64))
            yield rows.occurrences(view, causes, noted=noted, drops=drops)
            for end in (CUT, LATE) if rule == SEQUENCE else ():
                some = rows.ends(end)
                if len(some.row):
                    yield some.occurrences(view, [FOLLOWS] * len(some.row), noted=noted, drops=drops)
