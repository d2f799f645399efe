"""Settings: the rules that are looked for, and their numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from analyzer.rules.catalogue import Page
    from analyzer.rules.vehicle.own import OwnRules
    from dissectors.kit import Severity


@dataclass(frozen=True, slots=True)
class Settings:
    """Choices of the one who asks.

    `select` and `ignore` are rules (None: those that are on by default), `numbers` stand instead of those of pages by
    rule and name, `severities` instead of all severities of a rule. `bit_rate` is in bits per second, `dialects` are
    readings of doubtful fields by node ID. `own` are the rules of a vehicle file. A capture that is `cut_in` begins
    where a window does.
    """

    select: Collection[str] | None = None
    ignore: Collection[str] = ()
    numbers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    severities: Mapping[str, Severity] = field(default_factory=dict)
    bit_rate: int | None = None
    dialects: Mapping[int, Collection[str]] = field(default_factory=dict)
    own: OwnRules | None = None
    cut_in: bool = False

    def enabled(self, pages: Mapping[str, Page]) -> dict[str, Page]:
        """Return the pages of the rules that are looked for."""
        chosen = {rule for rule, page in pages.items() if page.enabled} if self.select is None else {*self.select}
        return {rule: page for rule, page in pages.items() if rule in chosen and rule not in self.ignore}

    def all_numbers(self, pages: Mapping[str, Page]) -> dict[str, dict[str, float]]:
        """Return the numbers in force, of every rule that has some."""
        return {rule: {**page.settings, **self.numbers.get(rule, {})} for rule, page in pages.items() if page.settings}
