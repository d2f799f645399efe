"""Supply voltages that fall faster than a pack is emptied."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from analyzer.flight.spells import Spells
from analyzer.flight.supply import SupplyLine
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Places
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.spells import Spell
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 1024
MOST_RECENT = 4096  # reports of one device within the time in which a voltage may fall
_VOLTAGE, _CURRENT = "voltage", "current"


@dataclass(slots=True)
class _Recent:
    """The reports of a device that a later one is compared with; NaN is a current that it does not tell."""

    at: Places
    voltage: Array
    current: Array


@dataclass(slots=True)
class _Sag:
    """A voltage that fell, and the current with each of the two; what that current explains, NaN if that is unknown."""

    before: float
    least: float
    current_before: float
    current: float
    expected: float


class SagEvents(ReportEvents):
    """Adds up batches. Bounds: `MOST_DEVICES`, and `MOST_RECENT` reports of each."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells a voltage."""
        return any(line.quantity == _VOLTAGE for line in plot.lines)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._recent: dict[tuple[str, int], _Recent] = {}
        self._lines: dict[tuple[str, int], SupplyLine] = {}
        self._spells = Spells(lasting("silent_motor"))

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.table(plot, batch)) is None:
                continue
            volts, amperes = (table.numbers(_measured(plot, name)) for name in (_VOLTAGE, _CURRENT))
            good = table.timed & np.isfinite(volts)
            whole = bool(good.all())
            for key, rows, at in table.devices:
                mine = rows if whole else rows[good[rows]]
                if len(mine):
                    self._judge(plot, key, volts[mine], amperes[mine], at if whole else table.at.take(mine))

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for spell in self._spells.finish():
            self._tell(spell)

    def _judge(self, plot: Plot, key: int, volts: Array, amperes: Array, at: Places) -> None:
        known = self._recent.get((plot.table, key))
        if known is None and len(self._recent) >= MOST_DEVICES:
            return
        where = at if known is None else known.at.followed_by(at)
        ran = where.ran
        every = volts if known is None else np.concatenate((known.voltage, volts))
        currents = amperes if known is None else np.concatenate((known.current, amperes))
        self._recent[plot.table, key] = _recent(where, every, currents)
        expected = self._lines.setdefault((plot.table, key), SupplyLine()).feed(volts, amperes)
        share = 1 - threshold("sag_percent") / 100
        low, then = np.zeros(len(volts), bool), np.arange(len(every) - len(volts), len(every))
        if volts.min() < every.max() * share:
            since = np.searchsorted(np.maximum.accumulate(ran), at.ran - lasting("sag"))
            then = np.minimum(since, then)
            low = volts < every[then] * share
        for part in self._spells.feed((plot.table, key), low, at):
            if part.stop > part.start:
                high = then[part.start + int(np.argmax(every[then[part.start : part.stop]]))]
                deep = part.start + int(np.argmin(volts[part.start : part.stop]))
                new = _Sag(*map(float, (every[high], volts[deep], currents[high], amperes[deep], expected[deep])))
                if part.spell.memory is None:
                    first = len(every) - len(volts) + part.start
                    good = np.flatnonzero(every[:first] >= new.before * (1 - threshold("sag_begun_percent") / 100))
                    part.spell.before = where.at(int(good[-1])) if len(good) else part.spell.before
                part.spell.memory = new if part.spell.memory is None else _worse(part.spell.memory, new)
            if part.over:
                self._tell(part.spell)

    def _tell(self, spell: Spell) -> None:
        table, key = spell.key
        bus, node, _ = split(key)
        sag: _Sag = spell.memory
        text = f"voltage falls from {sag.before:.1f} to {sag.least:.1f} V"
        if isfinite(sag.current_before) and isfinite(sag.current):
            text += f", current goes from {sag.current_before:.1f} to {sag.current:.1f} A"
        more = {"current_then": sag.current, "expected_voltage": sag.expected}
        values = {"voltage": sag.before, "worst_voltage": sag.least, "current": sag.current_before}
        values = {name: round(value, 3) for name, value in (values | more).items()}
        self._add(FlightEvent(
            "sag", text, spell.before, spell.first, spell.after, bus, node, None, table, "", values
        ))  # fmt: skip


def _measured(plot: Plot, quantity: str) -> str:
    """Return the column of a quantity, empty if there is none."""
    return next((line.column for line in plot.lines if line.quantity == quantity), "")


def _worse(one: _Sag, new: _Sag) -> _Sag:
    """Return the highest and the lowest voltage of both."""
    high, deep = (new if new.before > one.before else one), (new if new.least < one.least else one)
    return _Sag(high.before, deep.least, high.current_before, deep.current, deep.expected)


def _recent(at: Places, voltage: Array, current: Array) -> _Recent:
    """Return the reports that later ones are compared with."""
    first = max(len(at) - MOST_RECENT, int(np.argmax(at.ran >= at.ran.max() - lasting("sag"))))
    return _Recent(at.take(slice(first, None)), voltage[first:], current[first:])
