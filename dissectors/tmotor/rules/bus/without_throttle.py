"""ESCs whose valid throttle is missing: what each does, whether PWM takes over, and who goes on turning."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, Pauses, Rule, breach, last_set
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.hold import Samples
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, ReportingEsc, commands, fresh
from dissectors.tmotor.rules.joined.lost_throttle import Motor, Takeover, Track, follow, taken
from dissectors.tmotor.rules.joined.speed_reports import SpeedReporters
from dissectors.tmotor.rules.joined.throttle_losses import RECENT, Losses, told_later
from dissectors.tmotor.rules.joined.valid_throttle import LastThrottle, ValidThrottle

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import RawCommands
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports

_COAST_DOWN, _FOLDS = 5, (7, 8)  # operating modes that turn without throttle
_TAIL = 150 * MILLISECOND  # reports that are kept beyond the timeout, to see what was before a loss
# A PWM width stands for so much throttle, in us: UAV, spraying drone (4.4.1 explanation 5).
_WIDTHS, _RANGE = (1040.0, 1050.0), 900.0
_SAME_WIDTH, _ALIKE_PCT = 1.5, 6.0  # us, %
_REPEATS = 20.0  # us: a width so close to the throttle by CAN is that one, or one just before
_FRESH = 20 * MILLISECOND  # a throttle that an ESC follows right now
_TAKEOVERS = 4  # the last ones of an ESC that a loss may still end with
_LEAST_WIDTH = 1060.0  # us: of a throttle above 0


class WithoutThrottle(Rule):
    """Joins what ESCs report with the last valid throttle before it; the first `MOST_UNITS` ESCs count."""

    rules = ("BUS-017", "BUS-034", "BUS-038")

    def __init__(self) -> None:
        self._throttles: dict[int, ValidThrottle] = {}
        self._tracks: dict[ReportingEsc, Track] = {}
        self._reporters = SpeedReporters()
        self._driven, self._priority = DrivenUnits(), PwmPriority()
        self._pauses: Pauses | None = None
        self._timeout = 0

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Follow the reports of this batch."""
        if view.start == NO_TIME:
            return
        self._timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        self._pauses = self._pauses or Pauses(self._timeout)
        self._pauses.feed(view)
        self._driven.feed(view)
        self._priority.feed(view)
        now = commands(view)
        reports = list(self._reporters.feed(view))
        for unit, some in reports:
            if unit not in self._tracks and len(self._tracks) < MOST_UNITS:
                self._tracks[unit] = Track(int(some.number[0]))
        yield from self._take_over(view, now)
        for unit, some in reports:
            if unit in self._tracks:
                yield from self._follow(view, unit, some, now)
        for bus, sent in now.items():
            self._throttles.setdefault(bus, ValidThrottle()).feed(sent)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield losses that last to the end."""
        del view
        for track in self._tracks.values():
            hold = track.hold
            if hold is not None and not isinstance(hold.place, int | None) and not hold.rests:
                course = hold.course("to the end of the recording", taken(track.pwm(hold.since, 1 << 62)))
                yield told_later(hold, hold.place, course)

    def _at(self, bus: int, channel: int, number: Array, now: Mapping[int, RawCommands]) -> LastThrottle:
        return self._throttles.get(bus, ValidThrottle()).at(now.get(bus), channel, number)

    def _take_over(self, view: View, now: Mapping[int, RawCommands]) -> Iterator[Occurrence]:
        """Yield packets whose PWM width is what the ESC follows, and not the throttle that it had, or was 0 before."""
        wait = round(view.number("BUS-034", "wait_ms") * MILLISECOND)
        for (bus, node), (table, rows, number, index, _) in self._reporters.packets(view):
            track = self._tracks.get(ReportingEsc(bus, node, index))
            if track is None:
                continue
            t, width = table.t[rows], table["pwm"][rows]
            throttle = self._at(bus, index, number, now)
            del track.takeovers[:-_TAKEOVERS]
            last = last_set(fresh(t, throttle.t, _FRESH))
            late = np.flatnonzero((throttle.t != NO_TIME) & ~fresh(t, throttle.t, wait))
            if len(late):
                yield from self._taken(view, track, (table, rows, number), throttle, late, last)
            track.width, track.repeats = _before(track, width, throttle, last.item(-1))

    def _taken(
        self, view: View, track: Track, packets: tuple[DecodedTable, Array, Array], throttle: LastThrottle,
        late: Array, last: Array,
    ) -> Iterator[Occurrence]:  # fmt: skip
        """Yield which of the packets that come late after a throttle show another; `last` are those in time."""
        table, rows, number = packets
        width, pct, speed = (table[name][rows] for name in ("pwm", "throttle", "speed"))
        held = _stands_for(width[late], throttle.value[late], _SAME_WIDTH)
        turns = late[(speed[late] != 0) & (pct[late] > 0) & (width[late] >= _LEAST_WIDTH) & ~held]
        known = {one.since for one in track.takeovers}
        for k, before in zip(turns.tolist(), last[turns].tolist(), strict=True):
            since = throttle.t.item(k)
            was, repeats = _before(track, width, throttle, before)
            if since not in known and (was == 0 or _alike(width[k], pct[k])):
                known.add(since)
                values = {"microseconds": float(width[k]), "rpm": int(speed[k])}
                text = f"{values['microseconds']:.1f} us, {values['rpm']} rpm"
                track.takeovers.append(Takeover(since, number.item(k), text, not repeats))
                yield breach(view, table, rows.item(k), "BUS-034", values)

    def _follow(
        self, view: View, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, RawCommands]
    ) -> Iterator[Occurrences | Occurrence]:
        track, sent = self._tracks[unit], now.get(unit.bus)
        new = Samples(some.t, some.rpm, some.pct, some.current)
        whole = new if track.tail is None else track.tail.joined(new)
        tells = new.pct > 0
        steady = self._throttles.get(unit.bus, ValidThrottle()).steady
        if track.hold is not None or not steady(sent, unit.index, int(some.t[-1]), self._timeout):
            throttle = self._at(unit.bus, unit.index, some.number, now)
            lost = (throttle.t != NO_TIME) & ~fresh(some.t, throttle.t, self._timeout)
            if lost.any() or track.hold is not None:
                told = last_set(tells) >= 0 if not track.tells else np.ones(len(tells), bool)
                losses = Losses(self._pauses or Pauses(self._timeout), unit.bus, whole.t, lost, throttle.t, track.hold)
                motor = Motor(view, unit, some, throttle, told, losses, partial(self._excused, unit, some, now))
                yield from follow(track, motor, whole, self._timeout)
        track.tells |= bool(tells.any())
        recent = whole.t >= int(whole.t[-1]) - self._timeout - _TAIL
        recent[-RECENT:] = True
        track.tail = Samples(*(column[recent].copy() for column in whole))

    def _excused(self, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, RawCommands]) -> Array:
        """Return a mask of reports of an ESC that something else drives, or that folds or coasts down."""
        coasts = (some.mode == _COAST_DOWN) & (some.pct == 0)
        found: Array = (some.mode == _FOLDS[0]) | (some.mode == _FOLDS[1]) | coasts
        found |= self._driven.at(unit.bus, unit.index, some.number)
        found |= self._elsewhere(unit, some.number, some.t, now)
        found |= self._priority.at(unit.bus, unit.node, some.number)
        return found

    def _elsewhere(self, unit: ReportingEsc, number: Array, t: Array, now: Mapping[int, RawCommands]) -> Array:
        """Return where the ESC, which reports on another bus too, has its throttle from there."""
        found = np.zeros(len(number), bool)
        for bus in self._throttles.keys() | now.keys():
            other = self._tracks.get(unit._replace(bus=bus))
            if bus != unit.bus and other is not None:
                throttle = self._at(bus, unit.index, number, now)
                found |= fresh(t, throttle.t, self._timeout) & (other.first <= number)
        return found


def _before(track: Track, width: Array, throttle: LastThrottle, last: int) -> tuple[float, bool]:
    """Return the last width in time, which may be one of an earlier batch, and whether it repeats the throttle."""
    if last < 0:
        return track.width, track.repeats
    one = slice(last, last + 1)
    return width.item(last), bool(_stands_for(width[one], throttle.value[one], _REPEATS))


def _stands_for(width: Array, value: Array, within: float) -> Array:
    """Return which widths (us) are those of throttles that were commanded, within some us."""
    found = np.zeros(len(width), bool)
    for low in _WIDTHS:
        found |= np.abs(width - (low + _RANGE * value / FULL_THROTTLE)) <= within
    return found


def _alike(width: float, pct: float) -> bool:
    """Return whether a width (us) stands for the throttle (%) that the ESC applies."""
    return any(abs(100 * (width - low) / _RANGE - pct) <= _ALIKE_PCT for low in _WIDTHS)
