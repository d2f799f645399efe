"""Motors that do not do what they did at such a command: faster or slower, with more or less current."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from analyzer.devices.rows import split
from analyzer.flight.log import FlightEvent
from analyzer.flight.motors.halves import speeds_alone
from analyzer.flight.motors.reports import channel
from analyzer.flight.motors.watch import DRAWING, GIVEN, GOOD, LOADED, TURNING, MotorWatch
from analyzer.flight.reports import ReportEvents
from analyzer.flight.robust import of_few
from analyzer.flight.spells import Spells
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Spot
    from analyzer.flight.motors.reports import EscReader
    from analyzer.flight.motors.watch import ComparedReports
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.spells import Spell
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 256
UNLOADED, DRAGGED, UNDRIVEN, SLOW = "unloaded", "dragged", "undriven", "slow"
_TOLD = 8  # reports by which it is told what happens
_STANDS, _SAME, _TIMES = 0.02, 0.015, 2.0  # shares of what was before
_FASTER, _LAW = 0.05, 3  # of its speed; the power of a propeller goes with the third power of the speed
_WORDS = {
    UNLOADED: "its load is gone",
    DRAGGED: "something brakes it, or it is out of step",
    UNDRIVEN: "it is not driven as commanded",
    SLOW: "it is slower",
}


@dataclass(slots=True)
class _Memory:
    """The first reports of a spell, as shares of the past and of the command; `sure` if one is far off.

    `well` are the last reports before them that were well, each way.
    """

    well: Sequence[Spot | None] = ()
    speed: list[float] = field(default_factory=list)
    current: list[float] = field(default_factory=list)
    reported: list[float] = field(default_factory=list)
    count: int = 0
    sure: bool = False

    def note(self, some: ComparedReports, far: Array, start: int, stop: int) -> None:
        """Take the next reports; `far` off are those of which one is enough."""
        for mine, its in ((self.speed, some.speed), (self.current, some.current), (self.reported, some.reported)):
            if (room := _TOLD - len(mine)) > 0:
                mine.extend(its[start : min(stop, start + room)].tolist())
        self.count += stop - start
        self.sure = self.sure or bool(far[start:stop].any())

    @property
    def driven_faster(self) -> bool:
        """True if it just turns faster, with no more current than a propeller takes for that: it was learned slower."""
        speed, currents = of_few(self.speed), [share for share in self.current if isfinite(share)]
        return speed > 1 + _FASTER and bool(currents) and 1 <= of_few(currents) <= speed**_LAW

    def add(self, other: _Memory) -> None:
        """Take what follows."""
        for mine, its in ((self.speed, other.speed), (self.current, other.current), (self.reported, other.reported)):
            mine.extend(its[: _TOLD - len(mine)])
        self.count += other.count
        self.sure |= other.sure


class MotorEvents(ReportEvents):
    """Adds up batches. Bound: `MOST_DEVICES`.

    Args:
        order: the plots, the clock, and who takes the events.
        escs: the batch's reports, fed before.
    """

    def __init__(self, order: EventOrder, escs: EscReader) -> None:
        super().__init__(order)
        self._escs = escs
        self._tables = {plot.table for plot in self._plots}
        self._watches: dict[tuple[str, int], MotorWatch] = {}
        self._spells = Spells(lasting("silent_motor"))
        self._open: dict[tuple[str, int], Spell] = {}  # that may go on

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells speeds, voltages and currents, or another message of the same ESC tells the rest."""
        return speeds_alone(plot) or bool(
            plot.esc.rpm and plot.esc.voltage and plot.esc.current and plot.who.column
        )  # fmt: skip

    def feed(self, _: Batch) -> None:
        """Add the next batch."""
        for plot, key, told in self._escs.now:
            if plot.table not in self._tables:
                continue
            watch = self._watches.get((plot.table, key))
            if watch is None:
                whole = told.rows.some_whole(told.part.start, told.part.stop)
                if not whole or len(self._watches) >= MOST_DEVICES:
                    continue
                watch = self._watches[plot.table, key] = MotorWatch()
            self._follow((plot.table, key), watch.feed(told))

    def learned(self, bus: int, node: int) -> int | None:
        """Return when it was known what each motor of an ESC does at a command; None if it never was."""
        mine = [watch.learned for (_, key), watch in self._watches.items() if split(key)[:2] == (bus, node)]
        known = [one.ran for one in mine if one is not None]
        return max(known) if known and len(known) == len(mine) else None

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for spell in self._spells.finish():
            self._end(spell)
        for spell in self._open.values():
            self._tell(spell)

    def _follow(self, key: tuple[str, int], some: ComparedReports) -> None:
        far = (some.speed < threshold("motor_once_slow")) | (some.current < threshold("motor_once_unloaded"))
        for part in self._spells.feed(key, some.off, some.at):
            if part.spell.memory is None:
                part.spell.memory = _Memory(some.before(part.start) if part.stop > part.start else ())
            part.spell.memory.note(some, far, part.start, part.stop)
            if part.over:
                self._end(part.spell)

    def _end(self, spell: Spell) -> None:
        """Take a spell that is over; those of a motor that follow each other closely are one."""
        known = self._open.get(spell.key)
        if known is not None and spell.first.ran - known.last.ran <= lasting("motor_again"):
            known.last, known.after = spell.last, spell.after
            known.memory.add(spell.memory)
            return
        if known is not None:
            self._tell(known)
        self._open[spell.key] = spell

    def _tell(self, spell: Spell) -> None:
        memory: _Memory = spell.memory
        if (memory.count <= 1 and not memory.sure) or memory.driven_faster:
            return
        table, key = spell.key
        bus, node, _ = split(key)
        plot = next(plot for plot in self._plots if plot.table == table)
        sign, speed, current, reported = _told(memory)
        well = [memory.well[way] for way in _contradicting(sign, speed, current, reported) if memory.well]
        # Who was never well may have been so from its first report on.
        unknown = self._watches[spell.key].first if memory.well else spell.before
        before = max((one for one in well if one is not None), key=lambda one: one.ran, default=unknown)
        words = _WORDS[sign] if speed > _STANDS else "it stands"
        if sign == UNLOADED and current > threshold("motor_bare"):
            words = "a part of its load is gone"
        text = f"speed {_change(speed)}, current {_change(current)} at such a command: {words}"
        if sign == UNDRIVEN and isfinite(reported):
            text += f" (it reports {100 * reported:.0f} % of what is commanded)"
        values = {"speed_share": round(speed, 3), "current_share": round(current, 3), "reports": memory.count}
        if isfinite(reported):
            values["reported_share"] = round(reported, 3)
        self._add(FlightEvent(
            "motor", text, before, spell.first, spell.after, bus, node, channel(plot, key), table, "",
            values, sign,
        ))  # fmt: skip


def _change(share: float) -> str:
    """Return a share of what was before as people say it."""
    if share >= _TIMES:
        return f"{share:.1f} times"
    return f"{100 * (share - 1):+.0f} %" if abs(share - 1) >= _SAME else "as before"


def _told(memory: _Memory) -> tuple[str, float, float, float]:
    """Return of what it is a sign, and the shares of speed, current and command that show it."""
    speed = of_few(memory.speed)
    currents = [share for share in memory.current if isfinite(share)] or [1.0]
    given = [share for share in memory.reported if isfinite(share)]
    middle, most, reported = of_few(currents), max(currents), of_few(given)
    if reported < threshold("motor_given"):
        return UNDRIVEN, speed, middle, reported
    if speed >= (1 + threshold("motor_slow")) / 2:
        return (UNLOADED, speed, middle, reported) if middle < 1 else (DRAGGED, speed, most, reported)
    if most >= 1 / threshold("motor_once_slow"):
        return DRAGGED, speed, most, reported
    weak = middle < threshold("motor_once_slow") or speed >= middle > _STANDS
    return (UNDRIVEN if weak else SLOW), speed, middle, reported


def _contradicting(sign: str, speed: float, current: float, reported: float) -> Sequence[int]:
    """Return in which ways a report is well that speaks against a sign: until then it was not so.

    While commands change, what a motor does at a command is hidden, but not that it turns, is given what is commanded,
    or has its load: a bare motor takes next to nothing, even where it gains speed, for it has done so at once.
    """
    if sign == UNLOADED:
        return (GOOD, LOADED, DRAWING) if current <= threshold("motor_bare") else (GOOD, LOADED)
    if sign == UNDRIVEN and reported < threshold("motor_given") and speed > _STANDS:
        return GOOD, GIVEN
    if speed < (1 + threshold("motor_slow")) / 2:
        return GOOD, TURNING
    return (GOOD,)
