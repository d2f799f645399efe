"""Statements about broken transfers, told many at once."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from analyzer.rules.diagnosis.budgets import IS_NOTED, NUMBERS, WHATS, alike
from analyzer.rules.diagnosis.causes import GONE, NOTHING, OTHER_ID_FORM, SHORT, Cause
from analyzer.rules.diagnosis.checksums import CORRUPTED, DOUBTFUL
from analyzer.rules.diagnosis.search import ELSEWHERE, LENGTHS, PROVEN
from analyzer.rules.transfers.broken_rows import ENDED
from analyzer.rules.transfers.incomplete import CHECKSUM, CUT, FOLLOWS, LATE, SEQUENCE, turned_bit, values_of
from analyzer.tables import distinct
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.rules.diagnosis.search import FrameSearch
    from analyzer.rules.transfers.broken_rows import BrokenTransfers
    from dissectors.kit import Array, Values, View

TURNED_BIT = Cause(CORRUPTED, " by one turned bit")  # of those that are shown it is said which one


class Why(NamedTuple):
    """Causes of many transfers: a number that is the same where the same thing happened, what makes the words of one.

    `further` gives frames that show it, beside those of the transfer.
    """

    kind: Array
    cause: Callable[[int], Cause]
    further: Callable[[int], Sequence[int]]


def _nothing(_k: int) -> Sequence[int]:
    return ()


def _follows(_k: int) -> Cause:
    return FOLLOWS


def occurrences(
    view: View, broken: BrokenTransfers, rule: str, rows: Array, why: Why, *, noted: bool, drops: bool
) -> Iterator[Occurrences]:
    """Yield some as breaches of a rule, and the ends that broken sequences take with them."""
    if len(rows):
        yield _breaches(view, broken, rule, rows, why, noted=noted, drops=drops)
    for end in (CUT, LATE) if rule == SEQUENCE else ():
        some = rows[broken.ended[rows] == ENDED.index(end)]
        if len(some):
            follows = Why(np.zeros(len(some), np.int64), _follows, _nothing)
            yield _breaches(view, broken, end, some, follows, noted=noted, drops=drops)


def _breaches(
    view: View, broken: BrokenTransfers, rule: str, rows: Array, why: Why, *, noted: bool, drops: bool
) -> Occurrences:
    def values(k: int) -> Values:
        one, cause = broken.one(rule, rows.item(k)), why.cause(k)
        return values_of(view, one, turned_bit(one) if cause is TURNED_BIT else cause)

    def frames(k: int) -> Sequence[int]:
        return [*broken.frames_of(rows.item(k)), *why.further(k)]

    return Occurrences(
        rule=rule, t=broken.t[rows], bus=broken.bus[rows], node=broken.node[rows], type=broken.code[rows],
        frame=broken.lead[rows], values=values, frames=frames, key=why.kind,
        key_values=lambda k: {"cause": why.cause(k).what}, severity="note" if noted else None, drops=drops,
        each_named=True,
    )  # fmt: skip


class Told(Protocol):
    """The cause of one transfer, and further frames that show it."""

    @property
    def cause(self) -> Cause:
        """Words for it."""

    @property
    def further(self) -> Sequence[int]:
        """Numbers of the frames, beside those of the transfer."""


class Said(NamedTuple):
    """A statement about one transfer: its cause, frames that show it; `rule` is another one than TRF-010."""

    cause: Cause
    rule: str = CHECKSUM
    noted: bool = False
    drops: bool = False
    further: Sequence[int] = ()


class Searched(NamedTuple):
    """The answer of a search about one transfer, not yet in words; `proven`: frames show it."""

    found: FrameSearch
    k: int
    proven: bool

    @property
    def cause(self) -> Cause:
        """Words for it."""
        return self.found.cause(self.k)

    @property
    def further(self) -> Sequence[int]:
        """Numbers of frames that show it."""
        return self.found.evidence(self.k) if self.proven else ()


_TURNED = Said(TURNED_BIT)
_CORRUPTED, _DOUBTFUL = NUMBERS[CORRUPTED], NUMBERS[DOUBTFUL]
_UNKNOWN = {kind: Said(Cause(WHATS[kind])) for kind in (_CORRUPTED, _DOUBTFUL)}


class _Part(NamedTuple):
    """Rows of one batch, a number for what is said of each, and that."""

    row: list[int]
    kind: list[int]
    told: list[Told]


class ToldTransfers:
    """Collects what is said of some broken transfers, so that many are told at once."""

    def __init__(self, broken: BrokenTransfers) -> None:
        self.broken = broken
        self._kinds = dict(NUMBERS)
        self._parts: dict[tuple[int, str, bool, bool], _Part] = {}

    def add(self, row: int, said: Said) -> None:
        """Add what is said of one."""
        part = self._part(self.broken.batch.item(row), said.rule, said.noted, said.drops)
        part.row.append(row)
        part.kind.append(self._kinds.setdefault(said.cause.what, len(self._kinds)))
        part.told.append(said)

    def add_answers(self, rows: Array, found: FrameSearch, which: Array) -> Array:
        """Add what a search found of some wrong CRCs that no mistake gives: `which` answers; return the `NUMBERS`."""
        form, flags = found.form[which], found.flags[which]
        proven = flags & PROVEN != 0
        told = proven | (form == GONE)
        turned = ~told & self.broken.turned_inside(rows)
        told |= turned
        short, unknown = ~told & (form == SHORT), ~told & (form == NOTHING)
        # Nothing is known but the lengths of others nearby, which fit.
        alone = np.where(flags & LENGTHS != 0, _CORRUPTED, _DOUBTFUL)
        kinds = np.where(turned, _CORRUPTED, np.where(unknown, alone, found.kinds[which]))
        noted = short | proven & ((flags & ELSEWHERE != 0) | (form == OTHER_ID_FORM))  # by the part before (TRF-006)
        each = zip(*(column.tolist() for column in (which, turned, unknown, kinds, proven)), strict=True)
        said: list[Told] = [
            _TURNED if bit else _UNKNOWN[kind] if nothing else Searched(found, k, proof)
            for k, bit, nothing, kind, proof in each
        ]
        for drops, some in ((True, ~(proven | short)), (False, proven | short)):
            self._add_all(rows, kinds, said, (some & ~noted, some & noted), drops=drops)
        return kinds

    def add_turned(self, rows: Array) -> None:
        """Add some that one turned bit explains."""
        self._add_all(rows, np.full(len(rows), _CORRUPTED), [_TURNED] * len(rows), (np.ones(len(rows), bool),))

    def add_alike(self, rows: Array, kinds: Array) -> None:
        """Add some that are told like earlier ones; `kinds` are the `NUMBERS` of their causes."""
        likes = {kind: Said(alike(WHATS[kind])) for kind in distinct(kinds)}
        noted = IS_NOTED[kinds]
        some = (kinds != NOTHING) & ~noted, noted
        self._add_all(rows, kinds, [likes[kind] for kind in kinds.tolist()], some)

    def _add_all(
        self, rows: Array, kinds: Array, said: Sequence[Told], masks: Sequence[Array], *, drops: bool = True
    ) -> None:
        """Add rows in the order in which they ended: those of the first mask, and as notes those of the second."""
        for noted, mask in enumerate(masks):
            some = mask.nonzero()[0]
            batch = self.broken.batch[rows[some]]
            ends = [0, *((batch[1:] != batch[:-1]).nonzero()[0] + 1).tolist(), len(some)]
            for begin, end in pairwise(ends) if len(some) else ():
                part, which = self._part(batch.item(begin), CHECKSUM, bool(noted), drops), some[begin:end]
                part.row.extend(rows[which].tolist())
                part.kind.extend(kinds[which].tolist())
                part.told.extend([said[k] for k in which.tolist()])

    def _part(self, *part: Any) -> _Part:
        found = self._parts.get(part)
        if found is None:
            found = self._parts[part] = _Part([], [], [])
        return found

    def occurrences(self, view: View) -> Iterator[Occurrences]:
        """Yield all of them, those of each batch for themselves."""
        for (_, rule, noted, drops), (row, kind, told) in self._parts.items():
            why = Why(np.array(kind, np.int64), partial(_cause, told), partial(_further, told))
            rows = np.array(row, np.int64)
            yield from occurrences(view, self.broken, rule, rows, why, noted=noted, drops=drops)


def _cause(told: Sequence[Told], k: int) -> Cause:
    return told[k].cause


def _further(told: Sequence[Told], k: int) -> Sequence[int]:
    return told[k].further
