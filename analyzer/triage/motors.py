"""Motors that do not do what they did at such a command: faster or slower, with more or less current."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.devices import fields
from analyzer.devices.rows import keyed, split, usable
from analyzer.triage.log import FlightEvent
from analyzer.triage.motor_past import LAW, MotorPast
from analyzer.triage.reports import ReportEvents
from analyzer.triage.spells import Spells
from analyzer.triage.thresholds import lasting, threshold
from dissectors.kit.order import groups
from dissectors.records import dataclass, field
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.triage.clock import Places
    from analyzer.triage.orders import CommandReader
    from analyzer.triage.reports import EventOrder
    from analyzer.triage.spells import Spell, SpellPart
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 256
MOST_RECENT = 4096  # commands within the window
_STANDS, _SAME, _TIMES = 0.02, 0.015, 2.0  # shares of what was before
_TOLD = 8  # reports by which it is told what happens
UNLOADED, DRAGGED, UNDRIVEN, SLOW = "unloaded", "dragged", "undriven", "slow"


class _Orders(NamedTuple):
    """Commands of a bus: when, the last frame of each, and the throttle of each channel (rows)."""

    ran: Array
    frame_end: Array
    columns: Array


class _Window(NamedTuple):
    """The throttle before each report, within the window: the least, the most, the mean and the last."""

    least: Array
    most: Array
    mean: Array
    last: Array


class _Reports(NamedTuple):
    """Reports of a device. A voltage that is not told is 1, a current NaN."""

    speed: Array
    volts: Array
    current: Array
    throttle: _Window
    at: Places


@dataclass(slots=True)
class _Memory:
    """The first reports of a spell: shares of the speed and the current of the past; `sure` if one is far off."""

    speed: list[float] = field(default_factory=list)
    current: list[float] = field(default_factory=list)
    count: int = 0
    sure: bool = False


class MotorEvents(ReportEvents):
    """Adds up batches. Bounds: `MOST_DEVICES`, and `MOST_RECENT` commands of a bus.

    Args:
        order: the plots, the clock, and who takes the events.
        commands: of the batch, fed before.
    """

    def __init__(self, order: EventOrder, commands: CommandReader) -> None:
        super().__init__(order)
        self._commands = commands
        self._orders: dict[int, _Orders] = {}
        self._pasts: dict[tuple[str, int], MotorPast] = {}
        self._spells = Spells(lasting("silent_motor"))
        self._open: dict[tuple[str, int], Spell] = {}  # that may go on

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells the speeds of numbered ESCs."""
        return bool(plot.esc.rpm) and bool(plot.who.column)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._take_orders()
        if not self._orders:
            return
        for plot in self._plots:
            if (table := batch.messages.get(plot.table)) is not None:
                self._feed_table(plot, usable(table))

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for spell in self._spells.finish():
            self._end(spell)
        for spell in self._open.values():
            self._tell(spell)

    def _take_orders(self) -> None:
        """Keep the commands of the batch, and those of the window before it."""
        for some in self._commands.now:
            first = some.plot.who.first
            columns = np.full((len(some.columns) + first, len(some.at)), np.nan, np.float32)
            columns[first:] = some.columns
            known = self._orders.get(some.bus)
            ran, ends = some.at.ran, some.at.frame_end
            if known is not None and len(known.columns) == len(columns):
                kept = int(np.searchsorted(known.ran, known.ran[-1] - 2 * lasting("motor_window")))
                kept = max(kept, len(known.ran) - MOST_RECENT)
                ran, ends = np.concatenate((known.ran[kept:], ran)), np.concatenate((known.frame_end[kept:], ends))
                columns = np.concatenate((known.columns[:, kept:], columns), axis=1)
            self._orders[some.bus] = _Orders(np.maximum.accumulate(ran), np.maximum.accumulate(ends), columns)

    def _feed_table(self, plot: Plot, table: pa.RecordBatch) -> None:
        table, device = keyed(table, plot.who)
        if not len(table):
            return
        of, at = self._registry.definition(plot.table), self._clock.of(table)
        columns = [
            fields.column(of, table, name) for name in (plot.esc.rpm, plot.esc.voltage, plot.esc.current) if name
        ]
        if not plot.esc.voltage or not plot.esc.current or not all(columns):
            return
        speed, volts, current = (
            np.where(one.has, one.values, np.nan) if one.has is not None else one.values.astype(np.float64)
            for (one, *_) in columns
        )
        speed = np.abs(speed)
        good = (at.t != NO_TIME) & np.isfinite(speed) & (volts > 1)
        for key, rows in groups(device):
            bus, _, number = split(key)
            orders = self._orders.get(bus)
            mine = rows[good[rows]]
            if orders is None or not len(mine) or number + plot.who.first >= len(orders.columns):
                continue
            where = at.take(mine)
            window, has = _window(orders, number + plot.who.first, where)
            if not has.all():
                mine, where = mine[has], where.take(has)
            if len(mine):
                self._judge(plot, key, _Reports(speed[mine], volts[mine], current[mine], window, where))

    def _judge(self, plot: Plot, key: int, some: _Reports) -> None:
        past = self._pasts.get((plot.table, key))
        if past is None:
            if len(self._pasts) >= MOST_DEVICES:
                return
            past = self._pasts[plot.table, key] = MotorPast()
        start = 0
        for count in past.steps(len(some.speed)):
            part = slice(start, start + count)
            start += count
            throttle = _Window(*(one[part] for one in some.throttle))
            reports = _Reports(some.speed[part], some.volts[part], some.current[part], throttle, some.at.take(part))
            off, shares = _compared(past, reports)
            self._follow((plot.table, key), off, shares, reports.at)
            steady = throttle.most - throttle.least <= threshold("motor_steady_percent")
            driven = (throttle.least > threshold("motor_steady_percent")) & (reports.speed > 0)
            calm = steady & driven & ~off & np.isfinite(reports.current)
            past.add(throttle.mean, reports.speed, reports.volts, reports.current, calm)

    def _follow(self, key: tuple[str, int], off: Array, shares: tuple[Array, Array], at: Places) -> None:
        for part in self._spells.feed(key, off, at):
            self._note(part, *shares)
            if part.over:
                self._end(part.spell)

    @staticmethod
    def _note(part: SpellPart, speed: Array, current: Array) -> None:
        memory = part.spell.memory = part.spell.memory or _Memory()
        rows = slice(part.start, part.stop)
        memory.count += part.stop - part.start
        wanted = _TOLD - len(memory.speed)
        memory.speed += speed[rows][:wanted].tolist()
        memory.current += current[rows][:wanted].tolist()
        low = (speed[rows] < threshold("motor_once_slow")) | (current[rows] < threshold("motor_once_unloaded"))
        memory.sure |= bool(low.any())

    def _end(self, spell: Spell) -> None:
        """Take a spell that is over; those of a motor that follow each other closely are one."""
        known = self._open.get(spell.key)
        if known is not None and spell.first.ran - known.last.ran <= lasting("motor_again"):
            known.last, known.after = spell.last, spell.after
            wanted = _TOLD - len(known.memory.speed)
            known.memory.speed += spell.memory.speed[:wanted]
            known.memory.current += spell.memory.current[:wanted]
            known.memory.count += spell.memory.count
            known.memory.sure |= spell.memory.sure
            return
        if known is not None:
            self._tell(known)
        self._open[spell.key] = spell

    def _tell(self, spell: Spell) -> None:
        memory: _Memory = spell.memory
        if memory.count < 2 and not memory.sure:
            return
        table, key = spell.key
        bus, node, number = split(key)
        plot = next(plot for plot in self._plots if plot.table == table)
        sign, speed, current = _told(memory)
        words = _WORDS[sign] if speed > _STANDS else "it stands"
        text = f"speed {_change(speed)}, current {_change(current)} at such a command: {words}"
        values = {"speed_share": round(speed, 3), "current_share": round(current, 3), "reports": memory.count}
        self._add(FlightEvent(
            "motor", text, spell.before, spell.first, spell.after, bus, node, number + plot.who.first, table, "",
            values, sign,
        ))  # fmt: skip


_WORDS = {
    UNLOADED: "its load is gone",
    DRAGGED: "something brakes it, or it is out of step",
    UNDRIVEN: "it is not driven as commanded",
    SLOW: "it is slower",
}


def _change(share: float) -> str:
    """Return a share of what was before as people say it."""
    if share >= _TIMES:
        return f"{share:.1f} times"
    return f"{100 * (share - 1):+.0f} %" if abs(share - 1) >= _SAME else "as before"


def _told(memory: _Memory) -> tuple[str, float, float]:
    """Return of what it is a sign, and the shares of speed and current that show it."""
    speed = float(np.median(memory.speed))
    currents = [share for share in memory.current if isfinite(share)] or [1.0]
    middle, most = float(np.median(currents)), max(currents)
    if speed >= (1 + threshold("motor_slow")) / 2:
        return (UNLOADED, speed, middle) if middle < 1 else (DRAGGED, speed, most)
    if most >= 1 / threshold("motor_once_slow"):
        return DRAGGED, speed, most
    return (UNDRIVEN if middle < threshold("motor_once_slow") else SLOW), speed, middle


def _window(orders: _Orders, ch: int, at: Places) -> tuple[_Window, Array]:
    """Return the throttles of a channel before reports, and for which reports there are any: only those are in it.

    Commands count that were whole before a report began, however batches are cut.
    """
    column = orders.columns[ch]
    stop = np.minimum(np.searchsorted(orders.frame_end, at.frame), np.searchsorted(orders.ran, at.ran, "right"))
    start = np.searchsorted(orders.ran, at.ran - lasting("motor_window"))
    has = (start < stop) & ~np.isnan(column[np.minimum(start, len(column) - 1)])
    start, stop = start[has], stop[has]
    if not len(start):
        none = np.zeros(0)
        return _Window(none, none, none, none), has
    borders = np.column_stack((start, stop)).ravel()
    column = np.append(column, column[-1])
    sums = np.concatenate(([0.0], np.cumsum(column, dtype=np.float64)))
    least, most = (one.reduceat(column, borders)[::2].astype(np.float64) for one in (np.minimum, np.maximum))
    mean = (sums[stop] - sums[start]) / (stop - start)
    return _Window(least, most, mean, column[stop - 1].astype(np.float64)), has


def _compared(past: MotorPast, some: _Reports) -> tuple[Array, tuple[Array, Array]]:
    """Return which reports are not as they were in the past, and what share of its speed and current each has."""
    throttle, none = some.throttle, np.zeros(len(some.speed), bool)
    at_mean = past.expected(throttle.mean, some.volts)
    driven = throttle.least > threshold("motor_steady_percent")
    if at_mean is None or not driven.any():
        return none, (some.speed, some.current)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = some.speed / at_mean.speed, some.current / at_mean.current
        slowest, fastest = (at_mean.speed * one / throttle.mean for one in (throttle.least, throttle.most))
        wide = np.where(at_mean.far, threshold("motor_far"), 1.0)
        slow = some.speed / slowest < 1 - (1 - threshold("motor_slow")) * wide
        fast = some.speed / fastest > 1 + (threshold("motor_fast") - 1) * wide
        wanted = at_mean.current * (some.speed / at_mean.speed) ** LAW
        ratio = np.where(wanted > threshold("motor_least_a"), some.current / wanted, np.nan)
        few = throttle.last >= throttle.mean - threshold("motor_steady_percent") / 3
        much = throttle.last <= throttle.mean + threshold("motor_steady_percent") / 3
        even = throttle.most - throttle.least <= threshold("motor_even_percent")
        unloaded = even & few & (ratio < threshold("motor_unloaded") / wide)
        dragged = even & much & (ratio > threshold("motor_dragged") * wide)
    off = driven & (slow | (fast & few & ~(ratio > 1)) | unloaded | dragged)
    return off, shares
