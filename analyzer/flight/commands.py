"""Commands to all ESCs together: nothing after they were driven, the most there is, or very different throttles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.log import FlightEvent
from analyzer.flight.spells import Spells
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.orders import CommandReader, Commands
    from analyzer.flight.spells import Spell
    from dissectors.kit import Array

ZERO, SATURATION, SPREAD = "commands zero", "saturation", "spread"


@dataclass(slots=True)
class _Peak:
    """The most of a spell, and what all channels are commanded where it begins; None if it is of one channel.

    Most spells are over before anybody is told of them.
    """

    most: float
    columns: Array | None = None
    first: int = 0  # channel, as people count them

    @property
    def highest(self) -> int:
        """The channel that is commanded most."""
        return 0 if self.columns is None else int(np.nanargmax(self.columns)) + self.first

    @property
    def lowered(self) -> tuple[int, ...]:
        """The channels below the mean."""
        if self.columns is None:
            return ()
        below = np.flatnonzero(self.columns < np.nanmean(self.columns)) + self.first
        return tuple(below.tolist())


class CommandEvents:
    """Adds up batches, with the bounds of `Spells`.

    Args:
        commands: of the batch, fed before.
        add: takes the events.
    """

    def __init__(self, commands: CommandReader, add: Callable[[FlightEvent], None]) -> None:
        self._commands, self._add = commands, add
        self._wide: dict[tuple[str, int, int, int], Spell] = {}  # spreads that may go on
        least = {SATURATION: lasting("saturated"), SPREAD: lasting("spread")}
        self._spells = {
            name: Spells(lasting("silent_motor"), least.get(name, 0)) for name in (ZERO, SATURATION, SPREAD)
        }

    def feed(self, _: Batch) -> None:
        """Add the next batch."""
        for some in self._commands.now:
            self._judge(some)

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
                known.memory.most = max(known.memory.most, spell.memory.most)
                return
            if known is not None:
                self._tell(name, known)
            self._wide[spell.key] = spell

    def _judge(self, some: Commands) -> None:
        idle, most = threshold("command_idle_percent"), threshold("saturated_percent")
        highest, at = some.highest, some.at
        apart = highest - some.lowest
        self._follow(ZERO, some, 0, highest <= idle, at, apart)
        wide = (apart > threshold("spread_percent")) & (highest > idle)
        self._follow(SPREAD, some, 0, wide, at, apart)
        full = bool((highest >= most).any())
        none = np.zeros(len(at), bool)
        for place, column in enumerate(some.columns):
            ch = place + some.plot.who.first
            if not full:
                self._follow(SATURATION, some, ch, none, at, column)
                continue
            known = ~np.isnan(column)
            self._follow(SATURATION, some, ch, column[known] >= most, at.take(known), column[known])

    def _follow(self, name: str, some: Commands, ch: int, on: Array, at: RowPlaces, values: Array) -> None:
        for part in self._spells[name].feed((some.plot.table, some.bus, some.node, ch), on, at):
            if part.stop > part.start:
                most = float(values[part.start : part.stop].max())
                if part.spell.memory is None:
                    part.spell.memory = _Peak(most) if name != SPREAD else _Peak(
                        most, some.columns[:, part.start].copy(), some.plot.who.first
                    )  # fmt: skip
                part.spell.memory.most = max(part.spell.memory.most, most)
            if part.over:
                self._end(name, part.spell)

    def _tell(self, name: str, spell: Spell) -> None:
        table, bus, node, ch = spell.key
        ran = spell.last.ran - spell.first.ran
        values: dict[str, float] = {}
        if name == ZERO:
            if spell.before is None:  # it was never above: nobody has taken off
                return
            text = "all commands are 0"
        elif name == SATURATION:
            if ran < lasting("saturated"):
                return
            text, values = "all there is is commanded", {"commanded": spell.memory.most}
        else:
            text = f"commands are {spell.memory.most:.0f} % apart"
            values = {"spread": spell.memory.most, "highest_ch": spell.memory.highest}
        lowered = spell.memory.lowered if name == SPREAD else ()
        self._add(FlightEvent(
            name, text, spell.before, spell.first, spell.after, bus, node, ch or None, table, "", values,
            lowered=lowered,
        ))  # fmt: skip
