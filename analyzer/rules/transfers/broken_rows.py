"""Broken transfers in columns: nothing is looked up but for those that are shown."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis.budgets import senders_of, shapes_of
from analyzer.rules.diagnosis.causes import Cause
from analyzer.rules.diagnosis.checksums import CORRUPTED, one_bit_fits, starts_of
from analyzer.rules.diagnosis.search import FrameLists
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
from analyzer.rules.transfers.lists import picked
from analyzer.rules.view import MESSAGE
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.rules.transfers.incomplete import Source
    from dissectors.kit import Array, TransferTable, Values, View

ENDED = ("", CUT, LATE)  # what `Rows.ended` stands for
TURNED_BIT = Cause(CORRUPTED, " by one turned bit")  # of those that are shown it is said which one


class Why(NamedTuple):
    """Causes of many transfers: a number that is the same where the same thing happened, what makes the words of one.

    `further` gives frames that show it, beside those of the transfer.
    """

    kind: Array
    cause: Callable[[int], Cause]
    further: Callable[[int], Sequence[int]] | None = None

    @classmethod
    def of(cls, causes: Sequence[Cause]) -> Why:
        """Return what these say."""
        whats = [what for what, _ in causes]
        ids = {what: k for k, what in enumerate(dict.fromkeys(whats))}
        return cls(np.fromiter(map(ids.__getitem__, whats), np.int64, len(whats)), causes.__getitem__)


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

    @property
    def senders(self) -> Array:
        """Senders and types, a number each."""
        t, row = self.table, self.row
        return senders_of(t.bus[row], t.src[row], t.code[row])

    def sources(self) -> list[Source]:
        """Return bus, node and type of each."""
        t, row = self.table, self.row
        return list(zip(*(column[row].tolist() for column in (t.bus, t.src, t.code)), strict=True))

    @property
    def shapes(self) -> Array:
        """Frames and bytes of each that came, a number each."""
        received = self.table.length[self.row].astype(np.int64) + 2 * self.table.has("crc_wire")[self.row]
        return shapes_of(self.frames, received)

    def lists(self) -> FrameLists:
        """Return their frames."""
        begins, numbers = self.table.frame_lists
        offsets, places = picked(begins, self.row)
        return FrameLists(numbers[places], offsets, self.table.code[self.row], self.table.fd[self.row])

    def crc_and_payload(self, k: int) -> tuple[int, bytes]:
        """Return the CRC of one as received, and all bytes behind it."""
        row = int(self.row[k])
        return int(self.table.crc_wire[row]), self.table.payload(row)

    def starts(self) -> Array:
        """Return from which value the CRC of each starts, as it was received."""
        t = self.table
        return starts_of(t.crc_wire[self.row].astype(np.int64), [t.payload(row) for row in self.row.tolist()])

    def turned(self) -> Array:
        """Return a mask of those whose CRC one turned bit explains."""
        t, row = self.table, self.row
        return one_bit_fits(t.crc_wire[row].astype(np.int64) ^ t.crc_here[row], t.length[row]) & t.has("crc_here")[row]

    def one(self, k: int) -> Incomplete:
        """Return one of them."""
        return take_row(self.table, self.rule, int(self.row[k]), ENDED[self.ended[k]])

    def occurrences(self, view: View, why: Why, *, noted: bool, drops: bool) -> Iterator[Occurrences]:
        """Yield them as breaches, and the ends that broken sequences take with them."""
        if len(self.row):
            yield _breaches(self, view, why, noted=noted, drops=drops)
        for rule in (CUT, LATE) if self.rule == SEQUENCE else ():
            some = self.take(np.flatnonzero(self.ended == ENDED.index(rule)))._replace(rule=rule)
            if len(some.row):
                yield _breaches(some, view, Why.of([FOLLOWS] * len(some.row)), noted=noted, drops=drops)


class Said(NamedTuple):
    """A statement about one transfer: its cause, frames that show it; `rule` is another one than that of its rows."""

    cause: Cause
    rule: str = ""
    noted: bool = False
    drops: bool = False
    further: Sequence[int] = ()


class _Part(NamedTuple):
    """Rows of a table, and what is said of each."""

    row: list[int]
    ended: list[int]
    said: list[Said]


class ToldTransfers:
    """Collects what is said of transfers one by one, so that many are told at once."""

    def __init__(self) -> None:
        self._parts: dict[tuple[TransferTable, str, bool, bool], _Part] = {}

    def add(self, rows: Rows, k: int, said: Said) -> None:
        """Add one of some rows."""
        part = self._part(rows, said)
        part.row.append(rows.row.item(k))
        part.ended.append(rows.ended.item(k))
        part.said.append(said)

    def add_all(self, rows: Rows, said: Sequence[Said]) -> None:
        """Add some rows, of which the same is said but for causes and frames."""
        if said:
            part = self._part(rows, said[0])
            part.row.extend(rows.row.tolist())
            part.ended.extend(rows.ended.tolist())
            part.said.extend(said)

    def _part(self, rows: Rows, said: Said) -> _Part:
        part = rows.table, said.rule or rows.rule, said.noted, said.drops
        found = self._parts.get(part)
        if found is None:
            found = self._parts[part] = _Part([], [], [])
        return found

    def occurrences(self, view: View) -> Iterator[Occurrences]:
        """Yield all of them; then there are none."""
        parts, self._parts = self._parts, {}
        for (table, rule, noted, drops), (row, ended, said) in parts.items():
            rows = Rows.of(rule, table, np.array(row, np.int64), np.array(ended, np.int64))
            why = Why.of([one.cause for one in said])._replace(further=partial(_further, said))
            yield from rows.occurrences(view, why, noted=noted, drops=drops)


def _further(said: Sequence[Said], k: int) -> Sequence[int]:
    return said[k].further


def _breaches(rows: Rows, view: View, why: Why, *, noted: bool, drops: bool) -> Occurrences:
    t, row = rows.table, rows.row
    src, code = t.src[row].astype(np.int64), t.code[row]
    nobody = (src == 0) & (code >> 16 != MESSAGE)

    known: dict[int, Values] = {}  # of what is shown first also its key is asked

    def values(k: int) -> Values:
        if k not in known:
            one, cause = rows.one(k), why.cause(k)
            known[k] = values_of(view, one, turned_bit(one) if cause is TURNED_BIT else cause)
        return known[k]

    def frames(k: int) -> Sequence[int]:
        own = t.frames(int(row[k]))
        return own if why.further is None else [*own, *why.further(k)]

    return Occurrences(
        rule=rows.rule, t=t.t[row], bus=t.bus[row], node=np.where(nobody, NOBODY, src), type=code,
        frame=t.lead[row], values=values, frames=frames, key=why.kind,
        key_values=lambda k: {"cause": why.cause(k).what}, severity="note" if noted else None, drops=drops,
        each_named=True,
    )  # fmt: skip
