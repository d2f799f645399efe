"""ESCs whose valid throttle is missing: what each does, whether PWM takes over, and who goes on turning."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Pauses, Rule, breach
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.hold import STILL, Hold, Samples
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, NO_CHANNEL, ReportingEsc, commands, fresh
from dissectors.tmotor.rules.joined.speed_reports import SpeedReporters
from dissectors.tmotor.rules.joined.valid_throttle import LastThrottle, ValidThrottle

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, Occurrence, Occurrences, Values, View
    from dissectors.tmotor.rules.joined.joins import Commands
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports

_COAST_DOWN, _FOLDS = 5, (7, 8)  # operating modes that turn without throttle
_TAIL = 150 * MILLISECOND  # reports that are kept beyond the timeout, to see what was before a loss
_RECENT = 6  # reports that show how often an ESC reports; a bus is silent if it misses two of them
_HALF = 0.5  # of its speed: without drive a propeller is slower by then; of its current: wind draws none
# A PWM width stands for so much throttle, in us: UAV, spraying drone (4.4.1 explanation 5).
_WIDTHS, _RANGE = (1040.0, 1050.0), 900.0
_SAME_WIDTH, _ALIKE_PCT = 1.5, 6.0  # us, %
_REPEATS = 20.0  # us: a width so close to the throttle by CAN is that one, or one just before
_FRESH = 20 * MILLISECOND  # a throttle that an ESC follows right now
_TAKEOVERS = 4  # the last ones of an ESC that a loss may still end with
_LEAST_WIDTH = 1060.0  # us: of a throttle above 0


class _Takeover(NamedTuple):
    """A packet that shows another throttle in charge, after the last valid one at `since`.

    It is not `sure` that it came as PWM where the width only repeated the throttle of CAN before (4.4.1 explanation 5).
    """

    since: int
    number: int
    text: str
    sure: bool


@dataclass(slots=True)
class _Track:
    """One ESC: its last reports, its loss of throttle that is not over, and whether it ever told its throttle."""

    first: int
    tail: Samples | None = None
    hold: Hold | None = None
    tells: bool = False
    width: float = 0.0  # us, of the last packet before a loss
    repeats: bool = False  # it was that of the throttle by CAN
    takeovers: list[_Takeover] = field(default_factory=list)

    def pwm(self, since: int, number: int) -> _Takeover | None:
        """Return what took over in a loss up to a transfer."""
        return next((one for one in self.takeovers if one.since == since and one.number <= number), None)


class WithoutThrottle(Rule):
    """Joins what ESCs report with the last valid throttle before it; the first `MOST_UNITS` ESCs count."""

    rules = ("BUS-017", "BUS-034", "BUS-038")

    def __init__(self) -> None:
        self._throttles: dict[int, ValidThrottle] = {}
        self._tracks: dict[ReportingEsc, _Track] = {}
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
                self._tracks[unit] = _Track(int(some.number[0]))
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
            yield from self._close(track, 1 << 62, "to the end of the recording")

    def _at(self, bus: int, channel: int, number: Array, now: Mapping[int, Commands]) -> LastThrottle:
        return self._throttles.get(bus, ValidThrottle()).at(now.get(bus), channel, number)

    def _take_over(self, view: View, now: Mapping[int, Commands]) -> Iterator[Occurrence]:
        """Yield packets whose PWM width is what the ESC follows, and not the throttle that it had, or was 0 before."""
        wait = round(view.number("BUS-034", "wait_ms") * MILLISECOND)
        for (bus, node), (table, rows, number, index, _) in self._reporters.packets(view):
            t = table.t[rows]
            throttle = self._at(bus, index, number, now)
            width, pct = table["pwm"][rows], table["throttle"][rows]
            late = (throttle.t != NO_TIME) & ~fresh(t, throttle.t, wait)
            held, repeats = (_stands_for(width, throttle.value, within) for within in (_SAME_WIDTH, _REPEATS))
            turns = late & (table["speed"][rows] != 0) & (pct > 0) & (width >= _LEAST_WIDTH) & ~held
            track = self._tracks.get(ReportingEsc(bus, node, index))
            if track is None:
                continue
            del track.takeovers[:-_TAKEOVERS]
            recent = fresh(t, throttle.t, _FRESH)
            before = np.maximum.accumulate(np.where(recent, np.arange(len(recent)), -1))
            known = {one.since for one in track.takeovers}
            for k in np.flatnonzero(turns).tolist():
                since, last = int(throttle.t[k]), int(before[k])
                was = track.width if last < 0 else float(width[last])
                if since not in known and (was == 0 or _alike(width[k], pct[k])):
                    known.add(since)
                    values = {"microseconds": float(width[k]), "rpm": int(table["speed"][rows[k]])}
                    text = f"{values['microseconds']:.1f} us, {values['rpm']} rpm"
                    sure = not (track.repeats if last < 0 else bool(repeats[last]))
                    track.takeovers.append(_Takeover(since, int(number[k]), text, sure))
                    yield breach(view, table, int(rows[k]), "BUS-034", values)
            if before[-1] >= 0:
                track.width, track.repeats = float(width[before[-1]]), bool(repeats[before[-1]])

    def _follow(
        self, view: View, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, Commands]
    ) -> Iterator[Occurrences | Occurrence]:
        track, sent = self._tracks[unit], now.get(unit.bus)
        new = Samples(some.t, some.rpm, some.pct, some.current)
        whole = new if track.tail is None else track.tail.joined(new)
        known = len(whole.t) - len(new.t)
        told = np.logical_or.accumulate(np.concatenate(([track.tells], new.pct > 0)))[1:]
        steady = self._throttles.get(unit.bus, ValidThrottle()).steady
        if track.hold is not None or not steady(sent, unit.index, int(some.t[-1]), self._timeout):
            throttle = self._at(unit.bus, unit.index, some.number, now)
            lost = (throttle.t != NO_TIME) & ~fresh(some.t, throttle.t, self._timeout)
            edges = np.flatnonzero((lost[1:] != lost[:-1]) | (throttle.t[1:] != throttle.t[:-1])) + 1
            for part in np.split(np.arange(len(lost)), edges) if lost.any() or track.hold is not None else ():
                first, stop = int(part[0]), int(part[-1]) + 1
                since = int(throttle.t[first])
                if track.hold is not None and (not lost[first] or since != track.hold.since):
                    yield from self._close(track, int(some.number[first]), "until throttle came back")
                if not lost[first]:
                    continue
                if track.hold is None:
                    place = breach(view, some.table, int(some.rows[first]), "BUS-017", {})
                    place = replace(place, values={"channel": unit.index + 1}, drops=True, since=since)
                    track.hold = _opened(whole, known + first, since, place)
                    track.hold.told = self._heard(unit.bus, track.hold, int(some.t[first])) <= self._timeout
                track.hold.feed(whole.part(slice(known + first, known + stop)))
                if track.hold.still != NO_TIME and not track.hold.told:
                    yield from self._tell(track, int(some.number[stop - 1]), "")
                yield from self._turning(view, unit, some, (part, throttle, told), now)
        if track.hold is not None and not (track.hold.told or track.hold.place.lines):
            place = track.hold.place  # told with a later batch, if at all
            track.hold.place = replace(place, lines=view.lines(place.frames))
        track.tells = bool(told[-1])
        recent = whole.t >= int(whole.t[-1]) - self._timeout - _TAIL
        recent[-_RECENT:] = True
        track.tail = Samples(*(column[recent].copy() for column in whole))

    def _close(self, track: _Track, number: int, end: str) -> Iterator[Occurrence]:
        """End a loss, and tell what is not told."""
        if track.hold is not None and not track.hold.told:
            yield from self._tell(track, number, end)
        track.hold = None

    def _tell(self, track: _Track, number: int, end: str) -> Iterator[Occurrence]:
        hold = track.hold
        if hold is not None:
            hold.told = True
            if not hold.rests:
                course = hold.course(end, _taken(track.pwm(hold.since, number)))
                until = max(hold.last.t, hold.place.t)
                yield replace(hold.place, values={**hold.place.values, "course": course}, until=until)

    def _turning(
        self, view: View, unit: ReportingEsc, some: SpeedReports, what: tuple[Array, LastThrottle, Array],
        now: Mapping[int, Commands],
    ) -> Iterator[Occurrences]:  # fmt: skip
        """Yield the reports of a motor that is still driven when no ESC may hold its throttle any more."""
        part, throttle, told = what
        track = self._tracks[unit]
        hold = track.hold
        least = round(view.number("BUS-038", "still_s") * SECOND)
        if hold is None or int(some.t[part[-1]]) - hold.since < least:
            return
        rpm, pct = np.abs(some.rpm[part]), some.pct[part]
        turns = (rpm > view.number("BUS-038", "turning_rpm")) & (some.t[part] - hold.since >= least)
        if not turns.any():
            return
        fast = (abs(hold.base.rpm) > STILL) & (rpm >= _HALF * abs(hold.base.rpm))
        draws = np.abs(some.current[part]) >= max(1.0, _HALF * abs(hold.base.current))
        negative = (throttle.last[part] < 0) & (throttle.last[part] != NO_CHANNEL)
        driven = (pct > 0) | (fast & (draws | ~told[part])) | (negative & ~told[part])
        if not (turns & driven).any():
            return
        mode = some.mode[part]
        excused = np.isin(mode, _FOLDS) | ((mode == _COAST_DOWN) & (pct == 0))
        excused |= self._driven.at(unit.bus, unit.index, some.number[part])
        excused |= self._elsewhere(unit, some.number[part], some.t[part], now)
        excused |= self._priority.at(unit.bus, unit.node, some.number[part])
        wrong = turns & driven & ~excused
        rows = [k for k in np.flatnonzero(wrong).tolist() if self._lasted(unit.bus, hold, int(some.t[part[k]]), least)]
        taken = [track.pwm(hold.since, int(some.number[part[k]])) for k in rows]
        says = some.lost[part]  # what PWM drives has not lost its throttle
        alone = [k for k, one in zip(rows, taken, strict=True) if one is None or (says[k] and not one.sure)]
        doubtful = [k for k, one in zip(rows, taken, strict=True) if one is not None and not (one.sure or says[k])]
        if alone:
            yield _still(view, unit, some, part[alone], throttle)
        if doubtful:
            yield replace(_still(view, unit, some, part[doubtful], throttle), severity="warning")

    def _lasted(self, bus: int, hold: Hold, t: int, least: int) -> bool:
        """Return whether a loss is that long, silence of the bus left out."""
        hold.over = hold.over or self._heard(bus, hold, t) >= least
        return hold.over

    def _heard(self, bus: int, hold: Hold, t: int) -> float:
        """Return how long a loss has lasted without the time in which nobody was heard."""
        silent = 0.0 if self._pauses is None else self._pauses.inside(bus, hold.since, t, hold.spare)
        return t - hold.since - silent

    def _elsewhere(self, unit: ReportingEsc, number: Array, t: Array, now: Mapping[int, Commands]) -> Array:
        """Return where the ESC, which reports on another bus too, has its throttle from there."""
        found = np.zeros(len(number), bool)
        for bus in self._throttles.keys() | now.keys():
            other = self._tracks.get(unit._replace(bus=bus))
            if bus != unit.bus and other is not None:
                throttle = self._at(bus, unit.index, number, now)
                found |= fresh(t, throttle.t, self._timeout) & (other.first <= number)
        return found


def _opened(whole: Samples, at: int, since: int, place: Occurrence) -> Hold:
    """Return a loss that begins with the report `at`; those since the last throttle belong to it."""
    before = np.flatnonzero(whole.t[:at] <= since)
    base = int(before[-1]) if len(before) else 0
    apart = np.sort(np.diff(whole.t[max(at - _RECENT, 0) : at]))
    spare = 2 * int((apart[len(apart) // 2] + apart[(len(apart) - 1) // 2]) / 2) if len(apart) else 0
    hold = Hold(since, whole.at(base), place, spare)
    if base + 1 < at:
        hold.feed(whole.part(slice(base + 1, at)))
    return hold


def _taken(one: _Takeover | None) -> str:
    if one is None:
        return ""
    what = "PWM took over" if one.sure else "followed PWM, or commands that are not recorded"
    return f"{what} ({one.text})"


def _stands_for(width: Array, value: Array, within: float) -> Array:
    """Return which widths (us) are those of throttles that were commanded, within some us."""
    found = np.zeros(len(width), bool)
    for low in _WIDTHS:
        found |= np.abs(width - (low + _RANGE * value / FULL_THROTTLE)) <= within
    return found


def _alike(width: float, pct: float) -> bool:
    """Return whether a width (us) stands for the throttle (%) that the ESC applies."""
    return any(abs(100 * (width - low) / _RANGE - pct) <= _ALIKE_PCT for low in _WIDTHS)


def _still(view: View, unit: ReportingEsc, some: SpeedReports, at: Array, throttle: LastThrottle) -> Occurrences:
    table, rows = some.table, some.rows[at]
    place = {int(row): int(k) for row, k in zip(rows, at, strict=True)}

    def values(row: int) -> Values:
        k = place[row]
        last, value = int(throttle.last[k]), 100 * int(throttle.value[k]) / FULL_THROTTLE
        why = "no command since" if last >= 0 else f"{last} since" if last != NO_CHANNEL else "no channel since"
        return {
            "channel": unit.index + 1, "rpm": int(some.rpm[k]), "pct": float(some.pct[k]), "valid_pct": value,
            "why": why, "seconds": (int(some.t[k]) - int(throttle.t[k])) / SECOND,
        }  # fmt: skip

    worst: Any = {"rpm": ("strongest", some.rpm[at])}
    first = np.zeros(len(at), bool)
    return view.among_rows("BUS-038", table, rows, values, drops=True, since=throttle.t[at], worst=worst, rises=first)
