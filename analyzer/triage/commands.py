"""Commands to all ESCs together: nothing after they were driven, the most there is, or very different throttles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import usable
from analyzer.triage.log import FlightEvent
from analyzer.triage.orders import by_sender, orders
from analyzer.triage.reports import ReportEvents
from analyzer.triage.spells import Spells
from analyzer.triage.thresholds import lasting, threshold
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.triage.clock import Places
    from analyzer.triage.reports import EventOrder
    from analyzer.triage.spells import Spell
    from dissectors.kit import Array
    from dissectors.picture import Plot

ZERO, SATURATION, SPREAD = "commands zero", "saturation", "spread"


class CommandEvents(ReportEvents):
    """Adds up batches, with the bounds of `Spells`."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it commands."""
        return bool(plot.esc.commanded)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._wide: dict[tuple[str, int, int], Spell] = {}  # spreads that may go on
        self._spells = {name: Spells(lasting("silent_motor")) for name in (ZERO, SATURATION, SPREAD)}

    @property
    def types(self) -> list[str]:
        """The types that command ESCs."""
        return [plot.table for plot in self._plots]

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := batch.messages.get(plot.table)) is None:
                continue
            table = usable(table)
            found = orders(self._registry, plot, table)
            if found is None:
                continue
            at = self._clock.of(table)
            for key, mine in by_sender(found.sender, ~np.isnan(found.highest) & (at.t != NO_TIME)):
                self._judge(plot, key, found.columns[:, mine], found.highest[mine], found.lowest[mine], at.take(mine))

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for name, spells in self._spells.items():
            for spell in spells.finish():
                self._end(name, spell)
        for spell in self._wide.values():
            self._tell(SPREAD, spell)

    def _end(self, name: str, spell: Spell) -> None:
        """Take a spell that is over; spreads that follow each other closely are one."""
        if name != SPREAD:
            self._tell(name, spell)
        elif spell.last.ran - spell.first.ran >= lasting("spread"):
            known = self._wide.get(spell.key)
            if known is not None and spell.first.ran - known.last.ran <= lasting("spread_again"):
                known.last, known.after = spell.last, spell.after
                known.memory = max(known.memory, spell.memory)
                return
            if known is not None:
                self._tell(name, known)
            self._wide[spell.key] = spell

    def _judge(self, plot: Plot, key: int, columns: Array, highest: Array, lowest: Array, at: Places) -> None:
        idle, most = threshold("command_idle_percent"), threshold("saturated_percent")
        apart = highest - lowest
        self._follow(ZERO, plot, (key, 0), highest <= idle, at, apart)
        wide = (apart > threshold("spread_percent")) & (highest > idle)
        self._follow(SPREAD, plot, (key, 0), wide, at, apart)
        some = bool((highest >= most).any())
        none = np.zeros(len(at), bool)
        for place, column in enumerate(columns):
            who = key, place + plot.who.first
            if not some:
                self._follow(SATURATION, plot, who, none, at, column)
                continue
            known = ~np.isnan(column)
            self._follow(SATURATION, plot, who, column[known] >= most, at.take(known), column[known])

    def _follow(self, name: str, plot: Plot, who: tuple[int, int], on: Array, at: Places, values: Array) -> None:
        for part in self._spells[name].feed((plot.table, *who), on, at):
            if part.stop > part.start:
                most = float(values[part.start : part.stop].max())
                part.spell.memory = most if part.spell.memory is None else max(part.spell.memory, most)
            if part.over:
                self._end(name, part.spell)

    def _tell(self, name: str, spell: Spell) -> None:
        table, key, ch = spell.key
        ran = spell.last.ran - spell.first.ran
        values: dict[str, float] = {}
        if name == ZERO:
            if spell.before is None:  # it was never above: nobody has taken off
                return
            text = "all commands are 0"
        elif name == SATURATION:
            if ran < lasting("saturated"):
                return
            text, values = "all there is is commanded", {"commanded": spell.memory}
        else:
            text, values = f"commands are {spell.memory:.0f} % apart", {"spread": spell.memory}
        self._add(FlightEvent(
            name, text, spell.before, spell.first, spell.after, key >> 8, key & 0xFF, ch or None, table, "", values
        ))  # fmt: skip
