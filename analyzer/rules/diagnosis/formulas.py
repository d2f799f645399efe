"""Wrong ways to compute a transfer CRC that two transfers of a sender prove together: one may fit by chance."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis import checksums
from analyzer.rules.diagnosis.budgets import MOST_SENDERS
from analyzer.rules.diagnosis.causes import Cause
from analyzer.rules.diagnosis.checksums import Formula
from analyzer.rules.transfers.incomplete import occurrence, values_of
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.transfers.incomplete import Incomplete, Source
    from dissectors.kit import Occurrence, View

WHY = "TRF-011"


class _Held(NamedTuple):
    """A transfer that fits some formulas: what is said if none of them is proved, and what if one is."""

    transfer: Incomplete
    formulas: Sequence[Formula]
    otherwise: Sequence[Occurrence]
    told: Sequence[Occurrence]


class Formulas:
    """By sender, the transfer that fits a formula and waits for the next wrong one to fit it, too."""

    def __init__(self) -> None:
        self._held: dict[Source, _Held] = {}

    def of(self, view: View, one: Incomplete, start: int) -> list[Formula]:
        """Return the formulas that give the CRC of a transfer, which starts from a value as it was received."""
        signatures = view.types.signatures(one.code)
        found = checksums.formulas(one.wire, one.payload, signatures)
        others = view.types.starting_from(start)
        if others:
            found.append(Formula(f"{checksums.OF}{' or '.join(others)}", start))
        usual = self.common(view, one)
        if usual is None:
            return found
        return [*found, Formula(usual.what, 0 if usual.what in checksums.BY_PAYLOAD else start)]

    def common(self, view: View, one: Incomplete) -> Cause | None:
        """Return the mistake that is so common that one transfer is a hint."""
        known = view.types.signatures(one.code), view.types.mistaken(one.code)
        return checksums.wrong_crc(one.wire, one.payload, *known)

    def holds(self, source: Source) -> bool:
        """Return whether a transfer of a sender is kept."""
        return source in self._held

    def proved(self, one: Incomplete, fits: Sequence[Formula]) -> Formula | None:
        """Return the formula that the transfer before it fits, too."""
        held = self._held.get(one.source)
        return None if held is None else next((formula for formula in fits if formula in held.formulas), None)

    def told(self, view: View, one: Incomplete, formula: Formula) -> Iterator[Occurrence]:
        """Yield what both have in common."""
        cause, held = Cause(formula.name), self._held.pop(one.source)
        for found in held.told:
            values = values_of(view, held.transfer._replace(rule=found.rule), cause)
            yield replace(found, values=values)
        for rule in (one.rule, WHY):
            yield occurrence(view, one._replace(rule=rule), cause)

    def release(self, source: Source) -> Iterator[Occurrence]:
        """Yield what is said of the transfer that was held, if there is one: a later one does not agree."""
        held = self._held.pop(source, None)
        yield from () if held is None else held.otherwise

    def hold(self, view: View, one: Incomplete, fits: Sequence[Formula], otherwise: Sequence[Occurrence]) -> bool:
        """Keep a transfer until the next wrong one of its sender; return whether there was room."""
        if len(self._held) >= MOST_SENDERS:
            return False
        told = [occurrence(view, one._replace(rule=rule), Cause("")) for rule in (one.rule, WHY)]
        self._held[one.source] = _Held(one, fits, otherwise, told)
        return True

    def finish(self) -> Iterator[Occurrence]:
        """Yield what is said of those that are still held."""
        for held in self._held.values():
            yield from held.otherwise
        self._held.clear()
