"""Transfers whose CRC does not fit: a mistake of the sender, or damage, and where."""

from __future__ import annotations

from binascii import crc_hqx
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from analyzer.rules.diagnosis import checksums
from analyzer.rules.diagnosis.budgets import MOST_SENDERS, KnownCauses, SearchBudget
from analyzer.rules.diagnosis.causes import GONE, NOTHING, OTHER_ID_FORM, SHORT, Cause
from analyzer.rules.diagnosis.checksums import Formula
from analyzer.rules.diagnosis.formulas import Formulas
from analyzer.rules.diagnosis.search import CHECKSUM as WRONG_CRC
from analyzer.rules.diagnosis.search import ELSEWHERE, LENGTHS, PROVEN, ask
from analyzer.rules.transfers.incomplete import CHECKSUM, occurrence, turned_bit
from analyzer.rules.transfers.told_transfers import Said, ToldTransfers
from dissectors.kit.definitions import crc_start
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.rules.diagnosis.search import FrameSearch
    from analyzer.rules.transfers.broken_rows import BrokenTransfers
    from analyzer.rules.transfers.incomplete import Incomplete, Source
    from dissectors.kit import Array, Occurrence, Occurrences, View

_DAMAGES = 2  # after so many of a sender two have to agree on any mistake


class _Senders(NamedTuple):
    """Senders and types of some transfers: a number, and the place among `sources` of each."""

    number: Array
    which: Array
    sources: Sequence[Source]

    @classmethod
    def of(cls, broken: BrokenTransfers, rows: Array) -> Self:
        """Return those of rows."""
        number = broken.senders(rows)
        _, first, which = np.unique(number, return_index=True, return_inverse=True)
        return cls(number, which, broken.sources(rows[first]))

    def take(self, which: Array | slice) -> Self:
        """Return those of some of them."""
        return self._replace(number=self.number[which], which=self.which[which])


class _Answer(NamedTuple):
    """The core's answer about one transfer, and the value from which its CRC starts."""

    form: int
    flags: int
    shared: int
    start: int
    cause: Callable[[], Cause]
    evidence: Callable[[], Sequence[int]]


class WrongCrcs:
    """Tells what each sender's wrong CRCs come from."""

    def __init__(self) -> None:
        self._budget = SearchBudget()
        self._causes = KnownCauses()
        self._ways: dict[Source, Formula] = {}
        self._formulas = Formulas()
        self._damages: dict[Source, int] = {}  # wrong CRCs of a sender that no mistake explains
        self._mistaken: set[Source] = set()

    def explained(self, view: View, broken: BrokenTransfers, rows: Array) -> Iterator[Occurrences | Occurrence]:
        """Yield some transfers whose surroundings are known with their causes, those of each batch for themselves."""
        if not len(rows):
            return
        told = ToldTransfers(broken)
        yield from self._explained(view, told, rows)
        yield from told.occurrences(view)

    def finish(self) -> Iterator[Occurrence]:
        """Yield what waits for one more of its sender."""
        yield from self._formulas.finish()

    def _explained(self, view: View, told: ToldTransfers, rows: Array) -> Iterator[Occurrence]:
        """Tell of those that are searched, then of the others."""
        senders = _Senders.of(told.broken, rows)
        may = self._budget.allows(senders.number)
        searched = may | ~self._plain(view, senders)
        yield from self._searched(view, told, rows[searched], senders.take(searched), may[searched])
        if searched.all():
            return
        rows, senders = rows[~searched], senders.take(~searched)
        # Those that were searched may have shown a mistake of their sender.
        plain = self._plain(view, senders)
        may = np.zeros(np.count_nonzero(~plain), bool)
        yield from self._searched(view, told, rows[~plain], senders.take(~plain), may)
        yield from self._like_others(told, rows[plain], senders.take(plain))

    def _plain(self, view: View, senders: _Senders) -> Array:
        """Return a mask of those of senders of whom no mistake is known that needs no search."""
        plain = [not self._may_be_known(view, source) for source in senders.sources]
        found: Array = np.array(plain, bool)[senders.which]
        return found

    def _searched(
        self, view: View, told: ToldTransfers, rows: Array, senders: _Senders, may: Array
    ) -> Iterator[Occurrence]:
        """Tell of some, of which those that `may` be searched are for certain."""
        if not len(rows):
            return
        broken, some, left = told.broken, may.nonzero()[0], np.ones(len(rows), bool)
        found, starts = ask(view, WRONG_CRC, broken.lists(rows[some])), broken.starts(rows)
        if len(some):
            calm = self._calm(view, broken, rows[some], senders.take(some), (found.value >= 0, starts[some]))
            left[some[calm]] = False
            yield from self._tell_calm(told, rows[some[calm]], senders.take(some[calm]), (found, calm))
        places = np.cumsum(may) - 1
        for k in left.nonzero()[0].tolist():
            row, source, sender = rows.item(k), senders.sources[senders.which[k]], senders.number.item(k)
            if self._is_known(view, told, row, source):
                continue
            if not self._budget.left(sender):
                yield from self._like_others(told, rows[k : k + 1], senders.take(slice(k, k + 1)))
                continue
            self._budget.spend(sender)
            # Those that were known have left some of the budget.
            own, at = (found, places.item(k)) if may[k] else (ask(view, WRONG_CRC, broken.lists(rows[k : k + 1])), 0)
            yield from self._checksum(view, told, row, _answer(own, at, starts.item(k)))

    def _calm(
        self, view: View, broken: BrokenTransfers, rows: Array, senders: _Senders, known: tuple[Array, Array]
    ) -> Array:
        """Return those of senders that make no mistake as far as these show: nothing but its answer tells of each.

        `known` says which share the value that their CRC starts from with others nearby, and these values.
        """
        shared, starts = known
        odd = broken.may_be_mistaken(view.types, rows) | shared
        odd |= np.array([bool(view.types.starting_from(start)) for start in starts.tolist()], bool)
        strange = [self._may_be_known(view, source) or self._formulas.holds(source) for source in senders.sources]
        strange_too = np.bincount(senders.which[odd], minlength=len(strange)) != 0
        calm: Array = ~(np.array(strange, bool) | strange_too)[senders.which]
        return calm.nonzero()[0]

    def _tell_calm(
        self, told: ToldTransfers, rows: Array, senders: _Senders, answers: tuple[FrameSearch, Array]
    ) -> Iterator[Occurrence]:
        """Tell of those with their answers: which ones of a search."""
        found, which = answers
        allowed = self._budget.take(senders.number)
        if not allowed.all():  # too many senders
            yield from self._like_others(told, rows[~allowed], senders.take(~allowed))
            rows, senders, which = rows[allowed], senders.take(allowed), which[allowed]
        for at, count in enumerate(np.bincount(senders.which).tolist()):
            self._count(senders.sources[at], count)
        kinds = told.add_answers(rows, found, which)
        here = found.form[which] != GONE
        self._causes.note_all(senders.number[here], told.broken.shapes(rows[here]), kinds[here])

    def _like_others(self, told: ToldTransfers, rows: Array, senders: _Senders) -> Iterator[Occurrence]:
        """Tell of some that are searched no more what was found of others."""
        if not len(rows):
            return
        for at, count in enumerate(np.bincount(senders.which).tolist()):
            if count:
                yield from self._damage(senders.sources[at], count)
        turned = told.broken.turned(rows)
        told.add_turned(rows[turned])
        rows = rows[~turned]
        told.add_alike(rows, self._causes.like_all(senders.number[~turned], told.broken.shapes(rows)))

    def _may_be_known(self, view: View, source: Source) -> bool:
        """Return whether a mistake of a sender is known that needs no search."""
        return source in self._ways or source in self._mistaken or bool(view.types.undefined(source[-1]))

    def _is_known(self, view: View, told: ToldTransfers, row: int, source: Source) -> bool:
        """Tell of a wrong CRC if a mistake gives it that needs no search; return whether one does."""
        if not self._may_be_known(view, source):
            return False
        undefined = view.types.undefined(source[-1])
        wire, payload = told.broken.wire.item(row), told.broken.payload(row)
        name = next((name for sign, name in undefined.items() if crc_hqx(payload, crc_start(sign)) == wire), "")
        if name:
            told.add(row, Said(Cause(f"the CRC of {name}")))
            told.add(row, Said(Cause(name), "CAN-020"))
            return True
        way = self._ways.get(source)
        cause = Cause(way.name) if way is not None and way.gives(wire, payload) else None
        if cause is None and source in self._mistaken:
            cause = self._common(view, told.broken.one(CHECKSUM, row))
        if cause is not None:
            _tell(told, row, _both(cause))
        return cause is not None

    def _checksum(self, view: View, told: ToldTransfers, row: int, answer: _Answer) -> Iterator[Occurrence]:
        """Tell of one that is searched; yield what is said of one that waited for it."""
        one = told.broken.one(CHECKSUM, row)
        mistake = self._common(view, one) if self._damages.get(one.source, 0) < _DAMAGES else None
        if mistake is not None:
            _tell(told, row, _both(mistake))
            return
        fits = self._formulas.of(view, one, answer.start)
        proved = self._formulas.proved(one, fits)
        if proved is not None:
            self._learn(one, proved)
            yield from self._formulas.told(view, one, proved)
            return
        yield from self._damage(one.source)
        said = self._damaged(view, one, answer, alone=bool(fits))
        if not fits or not self._formulas.hold(view, one, fits, [_occurrence(view, one, each) for each in said]):
            _tell(told, row, said)

    def _damage(self, source: Source, count: int = 1) -> Iterator[Occurrence]:
        """Note wrong CRCs that no mistake explains; yield what is said of the one before them that fits one."""
        yield from self._formulas.release(source)
        self._count(source, count)

    def _count(self, source: Source, count: int) -> None:
        if count and (source in self._damages or len(self._damages) < MOST_SENDERS):
            self._damages[source] = min(self._damages.get(source, 0) + count, _DAMAGES)

    def _damaged(self, view: View, one: Incomplete, answer: _Answer, *, alone: bool) -> list[Said]:
        """Return what is said of a wrong CRC that no known mistake explains, but its surroundings may.

        `alone`: no other one is like it.
        """
        if answer.form == GONE:
            return [Said(answer.cause(), drops=True)]
        flags, bit = answer.flags, turned_bit(one)
        if flags & PROVEN:
            noted = bool(flags & ELSEWHERE) or answer.form == OTHER_ID_FORM  # by the part before (TRF-006)
            said = Said(answer.cause(), noted=noted, further=answer.evidence())
        elif bit.detail:
            said = Said(bit, drops=True)
        elif answer.form == SHORT:
            said = Said(answer.cause(), noted=True)
        elif answer.shared >= 0 and not alone:
            common = _of_start(view, answer.shared)
            self._remember(one, Formula(common, answer.shared))
            return _both(Cause(common))
        elif answer.form != NOTHING:
            said = Said(answer.cause(), drops=True)
        else:
            said = Said(bit if flags & LENGTHS else Cause(checksums.DOUBTFUL), drops=True)
        self._causes.note(one.source, len(one.frames), one.received, said.cause.what)
        return [said]

    def _common(self, view: View, one: Incomplete) -> Cause | None:
        """Return what the sender computed instead, if that is a common mistake."""
        found = self._formulas.common(view, one)
        if found is not None:
            self._learn(one, Formula(found.what, _start_of(one)))
        return found

    def _learn(self, one: Incomplete, mistake: Formula) -> None:
        """Note a mistake of a sender, so that further ones cost no search."""
        if mistake.name in checksums.BY_PAYLOAD:
            if len(self._mistaken) < MOST_SENDERS:
                self._mistaken.add(one.source)
        else:
            self._remember(one, mistake)

    def _remember(self, one: Incomplete, way: Formula) -> None:
        """Remember how a sender computes its CRCs."""
        if len(self._ways) < MOST_SENDERS:
            self._ways.setdefault(one.source, way)


def _answer(found: FrameSearch, k: int, start: int) -> _Answer:
    form, flags, shared = (column.item(k) for column in (found.form, found.flags, found.value))
    return _Answer(form, flags, shared, start, partial(found.cause, k), partial(found.evidence, k))


def _tell(told: ToldTransfers, row: int, said: Iterable[Said]) -> None:
    for one in said:
        told.add(row, one)


def _both(cause: Cause) -> list[Said]:
    """Return that a mistake of the sender gives the CRC."""
    return [Said(cause), Said(cause, "TRF-011")]


def _occurrence(view: View, one: Incomplete, said: Said) -> Occurrence:
    found = occurrence(view, one._replace(rule=said.rule), said.cause, said.further)
    return replace(found, severity="note" if said.noted else None, drops=said.drops)


def _start_of(one: Incomplete) -> int:
    return checksums.start_of(one.wire, one.payload)


def _of_start(view: View, start: int) -> str:
    """Return what a CRC that starts from a value is called."""
    names = view.types.starting_from(start)
    if names:
        return f"{checksums.OF}{' or '.join(names)}"
    return checksums.FROM_ZERO if not start else f"wrong signature, a CRC that starts from {start:04X}"
