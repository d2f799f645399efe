"""Supply voltages that fall faster than a pack is emptied."""

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
MOST_RECENT = 4096  # reports of one device within the time in which a voltage may fall
_VOLTAGE, _CURRENT = "voltage", "current"


@dataclass(slots=True)
class _Recent:
    """The reports of a device that a later one is compared with; NaN is a current that it does not tell."""

    at: RowPlaces
    voltage: Array
    current: Array

    def followed_by(self, at: RowPlaces, voltage: Array, current: Array) -> _Recent:
        """Return these, and others behind them."""
        return _Recent(
            self.at.followed_by(at), np.concatenate((self.voltage, voltage)), np.concatenate((self.current, current))
        )


@dataclass(slots=True)
class _Sag:
    """A voltage that fell, and the current with each of the two; what that current explains, NaN if that is unknown."""

    before: float
    least: float
    current_before: float
    current: float
    expected: float


class _Fall:
    """Reports among which a voltage fell: `every` with those before them, the last ones `at` their places."""

    def __init__(self, every: _Recent, at: RowPlaces) -> None:
        self._every, self._first = every, len(every.voltage) - len(at)
        since = np.searchsorted(np.maximum.accumulate(every.at.ran), at.ran - lasting("sag"))
        self._then = np.minimum(since, np.arange(self._first, len(every.voltage)))

    @property
    def before(self) -> Array:
        """The voltage that each is compared with."""
        return self._every.voltage[self._then]

    def note(self, part: SpellPart, expected: Array) -> None:
        """Let a spell know of its next part; what is `expected` of each report goes by its current."""
        every, rows = self._every, slice(part.start, part.stop)
        high = int(self._then[rows][np.argmax(self.before[rows])])
        deep = part.start + int(np.argmin(every.voltage[self._first :][rows]))
        new = _Sag(*map(float, (
            every.voltage[high], every.voltage[self._first + deep], every.current[high],
            every.current[self._first + deep], expected[deep],
        )))  # fmt: skip
        if part.spell.memory is not None:
            part.spell.memory = _worse(part.spell.memory, new)
            return
        part.spell.memory = new
        good = np.flatnonzero(every.voltage[: self._first + part.start] >= new.before * _share("sag_begun_percent"))
        if len(good):
            part.spell.before = every.at.at(int(good[-1]))


class SagEvents(ReportEvents):
    """Adds up batches. Bounds: `MOST_DEVICES`, and `MOST_RECENT` reports of each."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells a voltage."""
        return any(line.quantity == _VOLTAGE for line in plot.lines)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._recent: dict[tuple[str, int], _Recent] = {}
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
        known = self._recent.get((plot.table, key))
        if known is None and len(self._recent) >= MOST_DEVICES:
            return
        highest = volts.max() if known is None else max(volts.max(), known.voltage.max())
        line = self._lines.setdefault((plot.table, key), _native.SupplyLine())
        expected = cells(line.feed(volts, amperes), np.float64)
        low, fall = np.zeros(len(volts), bool), None
        if volts.min() < highest * _share("sag_percent"):
            fall = _Fall(_Recent(at, volts, amperes) if known is None else known.followed_by(at, volts, amperes), at)
            low = volts < fall.before * _share("sag_percent")
        for part in self._spells.feed((plot.table, key), low, at):
            if fall is not None and part.stop > part.start:
                fall.note(part, expected)
            if part.over:
                self._tell(part.spell)
        self._recent[plot.table, key] = _kept(known, at, volts, amperes)

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


def _kept(known: _Recent | None, at: RowPlaces, voltage: Array, current: Array) -> _Recent:
    """Return the reports that later ones are compared with."""
    oldest = at.ran.max() - lasting("sag")
    if known is not None and known.at.ran.max() >= oldest:
        every = known.followed_by(at, voltage, current)
        at, voltage, current = every.at, every.voltage, every.current
        oldest = at.ran.max() - lasting("sag")
    first = max(len(at) - MOST_RECENT, int(np.argmax(at.ran >= oldest)))
    return _Recent(at.take(slice(first, None)).settled(), voltage[first:].copy(), current[first:].copy())


def _share(name: str) -> float:
    """Return what is left where so many % are gone."""
    return 1 - threshold(name) / 100
