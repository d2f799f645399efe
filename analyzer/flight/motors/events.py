"""Motors that do not do what they did at such a command: faster or slower, with more or less current."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from analyzer.devices.rows import split
from analyzer.flight.log import FlightEvent
from analyzer.flight.motors.halves import speeds_alone
from analyzer.flight.motors.reports import channel
from analyzer.flight.motors.spans import TroubleSpans
from analyzer.flight.motors.watch import DRAWING, GIVEN, GOOD, LOADED, TURNING, MotorWatch
from analyzer.flight.reports import ReportEvents
from analyzer.flight.robust import of_few
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.motors.reports import EscReader
    from analyzer.flight.motors.spans import MotorTrouble
    from analyzer.flight.reports import EventOrder
    from dissectors.picture import Plot

MOST_DEVICES = 256
UNLOADED, DRAGGED, UNDRIVEN, SLOW = "unloaded", "dragged", "undriven", "slow"
_STANDS, _SAME, _TIMES = 0.02, 0.015, 2.0  # shares of what was before
_WORDS = {
    UNLOADED: "its load is gone",
    DRAGGED: "something brakes it, or it is out of step",
    UNDRIVEN: "it is not driven as commanded",
    SLOW: "it is slower",
}


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
        self._spans: dict[tuple[str, int], TroubleSpans] = {}
        self._spare = order.spare

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
                self._spans[plot.table, key] = TroubleSpans()
            for trouble in self._spans[plot.table, key].feed(watch.feed(told)):
                self._tell((plot.table, key), trouble)

    def learned(self, bus: int, node: int) -> int | None:
        """Return when it was known what each motor of an ESC does at a command; None if it never was."""
        mine = [watch.learned for (_, key), watch in self._watches.items() if split(key)[:2] == (bus, node)]
        known = [one.ran for one in mine if one is not None]
        return max(known) if known and len(known) == len(mine) else None

    def finish(self) -> None:
        """Tell what lasts to the end."""
        for key, spans in self._spans.items():
            if spans.open is not None:
                self._tell(key, spans.open)

    def _tell(self, of: tuple[str, int], trouble: MotorTrouble) -> None:
        table, key = of
        bus, node, _ = split(key)
        if not trouble.counts or not self._spare("motor", bus, node, table):
            return
        plot = next(plot for plot in self._plots if plot.table == table)
        sign, speed, current, reported = _told(trouble)
        well = [trouble.well[way] for way in _contradicting(sign, speed, current, reported)]
        # Who was never well may have been so from its first report on.
        unknown = self._watches[of].first
        before = max((one for one in well if one is not None), key=lambda one: one.ran, default=unknown)
        words = _WORDS[sign] if speed > _STANDS else "it stands"
        if sign == UNLOADED and current > threshold("motor_bare"):
            words = "a part of its load is gone"
        text = f"speed {_change(speed)}, current {_change(current)} at such a command: {words}"
        if sign == UNDRIVEN and isfinite(reported):
            text += f" (it reports {100 * reported:.0f} % of what is commanded)"
        values = {"speed_share": round(speed, 3), "current_share": round(current, 3), "reports": trouble.count}
        if isfinite(reported):
            values["reported_share"] = round(reported, 3)
        self._add(FlightEvent(
            "motor", text, before, trouble.first, trouble.after, bus, node, channel(plot, key), table, "",
            values, sign,
        ))  # fmt: skip


def _change(share: float) -> str:
    """Return a share of what was before as people say it."""
    if share >= _TIMES:
        return f"{share:.1f} times"
    return f"{100 * (share - 1):+.0f} %" if abs(share - 1) >= _SAME else "as before"


def _told(trouble: MotorTrouble) -> tuple[str, float, float, float]:
    """Return of what it is a sign, and the shares of speed, current and command that show it."""
    speed = of_few(trouble.speed)
    currents = [share for share in trouble.current if isfinite(share)] or [1.0]
    given = [share for share in trouble.reported if isfinite(share)]
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
