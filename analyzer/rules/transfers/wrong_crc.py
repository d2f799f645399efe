"""Transfers whose CRC does not fit: a mistake of the sender, or damage, and where."""

from __future__ import annotations

from binascii import crc_hqx
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.diagnosis import checksums
from analyzer.rules.diagnosis.budgets import MOST_SENDERS, KnownCauses, SearchBudget, alike
from analyzer.rules.diagnosis.causes import GONE, NOTED, NOTHING, OTHER_ID_FORM, SHORT, Cause
from analyzer.rules.diagnosis.checksums import Formula
from analyzer.rules.diagnosis.formulas import Formulas
from analyzer.rules.diagnosis.search import CHECKSUM as WRONG_CRC
from analyzer.rules.diagnosis.search import ELSEWHERE, LENGTHS, PROVEN, ask
from analyzer.rules.transfers.broken_rows import TURNED_BIT, Said, ToldTransfers
from analyzer.rules.transfers.incomplete import occurrence, turned_bit
from dissectors.kit.definitions import crc_start
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.rules.transfers.broken_rows import Rows
    from analyzer.rules.transfers.incomplete import Incomplete, Source
    from dissectors.kit import Array, Occurrence, Occurrences, View

_DAMAGES = 2  # after so many of a sender two have to agree on any mistake


_TURNED = Said(TURNED_BIT, drops=True)


class _Answer(NamedTuple):
    """The core's answer about one transfer, and the value from which its CRC starts."""

    form: int
    flags: int
    shared: int
    start: int
    cause: Callable[[], Cause]
    evidence: Callable[[], Sequence[int]]


def _answers(view: View, rows: Rows) -> Iterator[_Answer]:
    """Yield what the core finds of each."""
    found = ask(view, WRONG_CRC, rows.lists())
    columns = found.form, found.flags, found.value, rows.starts()
    each = zip(*(column.tolist() for column in columns), strict=True)
    for k, (form, flags, shared, start) in enumerate(each):
        yield _Answer(form, flags, shared, start, partial(found.cause, k), partial(found.evidence, k))


class WrongCrcs:
    """Tells what each sender's wrong CRCs come from."""

    def __init__(self) -> None:
        self._budget = SearchBudget()
        self._causes = KnownCauses()
        self._told = ToldTransfers()
        self._ways: dict[Source, Formula] = {}
        self._formulas = Formulas()
        self._damages: dict[Source, int] = {}  # wrong CRCs of a sender that no mistake explains
        self._mistaken: set[Source] = set()

    def explained(self, view: View, rows: Rows) -> Iterator[Occurrences | Occurrence]:
        """Yield transfers whose surroundings are known with their causes: those that are searched, then the others."""
        yield from self._explained(view, rows)
        yield from self._told.occurrences(view)

    def finish(self) -> Iterator[Occurrence]:
        """Yield what waits for one more of its sender."""
        yield from self._formulas.finish()

    def _explained(self, view: View, rows: Rows) -> Iterator[Occurrence]:
        may = self._budget.allows(rows.senders)
        searched = may | ~self._plain(view, rows)
        yield from self._one_by_one(view, rows.take(searched), may[searched])
        rows = rows.take(~searched)
        # Those that were searched may have shown a mistake of their sender.
        plain = self._plain(view, rows)
        yield from self._one_by_one(view, rows.take(~plain), np.zeros(len(plain), bool))
        yield from self._like_others(rows.take(plain))

    def _plain(self, view: View, rows: Rows) -> Array:
        """Return a mask of those of senders of whom no mistake is known that needs no search."""
        _, first, kind = np.unique(rows.senders, return_index=True, return_inverse=True)
        plain = [not self._may_be_known(view, source) for source in rows.take(first).sources()]
        found: Array = np.array(plain, bool)[kind]
        return found

    def _one_by_one(self, view: View, rows: Rows, may: Array) -> Iterator[Occurrence]:
        """Tell of some, of which those that `may` be searched are for certain."""
        if not len(rows.row):
            return
        answers = _answers(view, rows.take(may))
        each = zip(rows.senders.tolist(), rows.sources(), may.tolist(), strict=True)
        for k, (sender, source, allowed) in enumerate(each):
            answer = next(answers) if allowed else None
            if self._is_known(view, rows, k, source):
                continue
            if self._budget.left(sender):
                self._budget.spend(sender)
                # Those that were known have left some of the budget.
                answer = answer or next(_answers(view, rows.take(slice(k, k + 1))))
                yield from self._checksum(view, rows, k, answer)
            else:
                yield from self._like_others(rows.take(slice(k, k + 1)))

    def _like_others(self, rows: Rows) -> Iterator[Occurrence]:
        """Tell of some that are searched no more what was found of others."""
        if not len(rows.row):
            return
        _, first, counts = np.unique(rows.senders, return_index=True, return_counts=True)
        sources = rows.take(first).sources()
        for source, count in zip(sources, counts.tolist(), strict=True):
            yield from self._damage(source, count)
        turned = rows.turned()
        self._told.add_all(rows.take(turned), [_TURNED] * np.count_nonzero(turned))
        rows = rows.take(~turned)
        whats = [self._causes.whats[k] for k in self._causes.like_all(rows.senders, rows.shapes).tolist()]
        likes = {what: Said(alike(what), noted=what in NOTED, drops=True) for what in set(whats)}
        for noted in (False, True):
            some = np.array([bool(what) and likes[what].noted == noted for what in whats], bool)
            self._told.add_all(rows.take(some), [likes[what] for what in compress(whats, some.tolist())])

    def _may_be_known(self, view: View, source: Source) -> bool:
        """Return whether a mistake of a sender is known that needs no search."""
        return source in self._ways or source in self._mistaken or bool(view.types.undefined(source[-1]))

    def _is_known(self, view: View, rows: Rows, k: int, source: Source) -> bool:
        """Tell of a wrong CRC if a mistake gives it that needs no search; return whether one does."""
        if not self._may_be_known(view, source):
            return False
        undefined = view.types.undefined(source[-1])
        wire, payload = rows.crc_and_payload(k)
        name = next((name for sign, name in undefined.items() if crc_hqx(payload, crc_start(sign)) == wire), "")
        if name:
            self._told.add(rows, k, Said(Cause(f"the CRC of {name}")))
            self._told.add(rows, k, Said(Cause(name), "CAN-020"))
            return True
        way = self._ways.get(source)
        cause = Cause(way.name) if way is not None and way.gives(wire, payload) else None
        if cause is None and source in self._mistaken:
            cause = self._common(view, rows.one(k))
        if cause is not None:
            self._tell(rows, k, _both(cause))
        return cause is not None

    def _tell(self, rows: Rows, k: int, said: Iterable[Said]) -> None:
        for one in said:
            self._told.add(rows, k, one)

    def _checksum(self, view: View, rows: Rows, k: int, answer: _Answer) -> Iterator[Occurrence]:
        """Tell of one that is searched; yield what is said of one that waited for it."""
        one = rows.one(k)
        mistake = self._common(view, one) if self._damages.get(one.source, 0) < _DAMAGES else None
        if mistake is not None:
            self._tell(rows, k, _both(mistake))
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
            self._tell(rows, k, said)

    def _damage(self, source: Source, count: int = 1) -> Iterator[Occurrence]:
        """Note wrong CRCs that no mistake explains; yield what is said of the one before them that fits one."""
        yield from self._formulas.release(source)
        if source in self._damages or len(self._damages) < MOST_SENDERS:
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


def _both(cause: Cause) -> list[Said]:
    """Return that a mistake of the sender gives the CRC."""
    return [Said(cause), Said(cause, "TRF-011")]


def _occurrence(view: View, one: Incomplete, said: Said) -> Occurrence:
    found = occurrence(view, one._replace(rule=said.rule or one.rule), said.cause, said.further)
    return replace(found, severity="note" if said.noted else None, drops=said.drops)


def _start_of(one: Incomplete) -> int:
    return checksums.start_of(one.wire, one.payload)


def _of_start(view: View, start: int) -> str:
    """Return what a CRC that starts from a value is called."""
    names = view.types.starting_from(start)
    if names:
        return f"{checksums.OF}{' or '.join(names)}"
    return checksums.FROM_ZERO if not start else f"wrong signature, a CRC that starts from {start:04X}"
