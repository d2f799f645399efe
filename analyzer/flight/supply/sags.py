"""Supply voltages that fall faster than a pack is emptied: at once, or in seconds in which no current explains it."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.devices.rows import split
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from analyzer.flight.spells import Spells
from analyzer.flight.supply.recent_supply import RecentSupply, SupplyReports
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.spells import Spell, SpellPart
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 1024
_VOLTAGE, _CURRENT = "voltage", "current"


@dataclass(slots=True)
class _Sag:
    """A voltage that fell: `before` and `least`, the current with each, and what that explains of the least one.

    `slowly` says that it was seen in the course of seconds; NaN is what nobody knows.
    """

    before: float
    current_before: float
    least: float
    current: float
    expected: float
    slowly: bool


class _Fall:
    """Reports among which a voltage fell: `every` with those before them, the last ones `then` compared with which.

    `at_once` are those that are low within a moment.
    """

    def __init__(self, every: SupplyReports, then: Array, at_once: Array) -> None:
        self._every, self._then, self._at_once = every, then, at_once
        self._first = len(every.voltage) - len(then)

    def note(self, part: SpellPart) -> None:
        """Let a spell know of its next part."""
        every, rows = self._every, slice(part.start, part.stop)
        before = every.voltage[self._then[rows]]
        high = int(self._then[rows][np.argmax(before)])
        deep = self._first + part.start + int(np.argmin(every.voltage[self._first :][rows]))
        expected = float(_explained(every, np.array([high]), np.array([deep]))[0])
        new = _Sag(*every.told(high), *every.told(deep), expected, not self._at_once[part.start])
        if part.spell.memory is not None:
            part.spell.memory = _worse(part.spell.memory, new)
            return
        part.spell.memory = new
        then, now = int(self._then[part.start]), self._first + part.start
        well = every.voltage[then]
        if new.slowly:
            well = _explained(every, np.array([then]), np.array([now]))[0]
        good = np.flatnonzero(every.voltage[then:now] >= well * _share("sag_begun_percent"))
        if len(good):
            part.spell.before = every.at.at(then + int(good[-1]))


class SagEvents(ReportEvents):
    """Adds up batches. Bound: `MOST_DEVICES`, and that of `RecentSupply` of each."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells a voltage."""
        return any(line.quantity == _VOLTAGE for line in plot.lines)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._recent: dict[tuple[str, int], RecentSupply] = {}
        self._lines: dict[tuple[str, int], _native.SupplyLine] = {}
        self._spells = Spells(lasting("silent_motor"))

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.table(plot, batch)) is None:
                continue
            volts, amperes = (table.numbers(_measured(plot, name)) for name in (_VOLTAGE, _CURRENT))
            good = np.isfinite(volts)
            whole = bool(good.all())
            for key, rows, at in table.devices:
                if whole:
                    self._judge(plot, key, volts[rows], amperes[rows], at)
                elif (mine := good[rows]).any():
                    self._judge(plot, key, volts[rows][mine], amperes[rows][mine], at.take(mine))

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for spell in self._spells.finish():
            self._tell(spell)

    def _judge(self, plot: Plot, key: int, volts: Array, amperes: Array, at: RowPlaces) -> None:
        recent = self._recent.get((plot.table, key))
        if recent is None:
            if len(self._recent) >= MOST_DEVICES:
                return
            recent = self._recent[plot.table, key] = RecentSupply()
        line = self._lines.setdefault((plot.table, key), _native.SupplyLine())
        new = SupplyReports(at, volts, amperes, cells(line.feed(volts, amperes), np.float64))
        low, fall = np.zeros(len(volts), bool), None
        if volts.min() < max(float(volts.max()), recent.highest) * _share("sink_percent"):
            low, fall = _fallen(recent.followed_by(new), len(volts))
        for part in self._spells.feed((plot.table, key), low, at):
            if fall is not None and part.stop > part.start:
                fall.note(part)
            if part.over:
                self._tell(part.spell)
        recent.keep(new)

    def _tell(self, spell: Spell) -> None:
        table, key = spell.key
        bus, node, _ = split(key)
        sag: _Sag = spell.memory
        text = f"voltage {'sinks' if sag.slowly else 'falls'} from {sag.before:.1f} to {sag.least:.1f} V"
        if isfinite(sag.current_before) and isfinite(sag.current):
            text += f", current goes from {sag.current_before:.1f} to {sag.current:.1f} A"
        values = {
            "voltage": sag.before, "worst_voltage": sag.least, "current": sag.current_before,
            "current_then": sag.current, "expected_voltage": sag.expected,
        }  # fmt: skip
        values = {name: round(value, 3) for name, value in values.items()}
        self._add(FlightEvent(
            "sag", text, spell.before, spell.first, spell.after, bus, node, None, table, "", values
        ))  # fmt: skip


def _measured(plot: Plot, quantity: str) -> str:
    """Return the column of a quantity, empty if there is none."""
    return next((line.column for line in plot.lines if line.quantity == quantity), "")


def _worse(one: _Sag, new: _Sag) -> _Sag:
    """Return the highest and the lowest voltage of both."""
    high, deep = (new if new.before > one.before else one), (new if new.least < one.least else one)
    return _Sag(high.before, high.current_before, deep.least, deep.current, deep.expected, one.slowly)


def _fallen(every: SupplyReports, count: int) -> tuple[Array, _Fall]:
    """Return which of the last reports are low: at once, or in seconds and not by their current."""
    first = len(every.voltage) - count
    rows, ran = np.arange(first, len(every.voltage)), np.maximum.accumulate(every.at.ran)
    just, long = (np.minimum(np.searchsorted(ran, ran[first:] - lasting(name)), rows) for name in ("sag", "sink"))
    # A motor that spins up has its current before its voltage: what lasted for a moment counts.
    held = np.searchsorted(ran, np.maximum(ran[first:] - lasting("sink"), ran[0]) + lasting("sag"))
    volts, since = every.voltage[first:], np.minimum(every.voltage[long], every.voltage[np.minimum(held, rows)])
    fell = volts < every.voltage[just] * _share("sag_percent")
    explained = _explained(every, long, rows)
    sank = (volts < since * _share("sink_percent")) & (volts < explained - since * (1 - _share("sink_percent")))
    sank &= every.current[first:] >= threshold("motor_least_a")  # who takes nothing sees what the others take
    return fell | sank, _Fall(every, np.where(sank, long, just), fell)


def _explained(every: SupplyReports, then: Array, now: Array) -> Array:
    """Return the voltages that currents explain: those of before, less what the line of the supply costs more now.

    NaN is what no line is known for: a pack is loaded by other motors, too, so that one's current alone says nothing.
    """
    line = every.line[now]
    found: Array = np.where(np.isnan(every.line[then]), line, every.voltage[then] + line - every.line[then])
    return found


def _share(name: str) -> float:
    """Return what is left where so many % are gone."""
    return 1 - threshold(name) / 100
