"""ESCs whose valid throttle is missing: what each does, whether PWM takes over, and who goes on turning."""

from __future__ import annotations

from bisect import bisect_left
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Pauses, Rule, breach
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.hold import STILL, Hold, Samples
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, NO_CHANNEL, ReportingEsc, commands, fresh
from dissectors.tmotor.rules.joined.speed_reports import SpeedReporters
from dissectors.tmotor.rules.joined.throttle_losses import RECENT, Losses, ToldLosses, opened, told_later
from dissectors.tmotor.rules.joined.valid_throttle import LastThrottle, ValidThrottle

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, Occurrence, Occurrences, Values, View
    from dissectors.tmotor.rules.joined.joins import RawCommands
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports

_COAST_DOWN, _FOLDS = 5, (7, 8)  # operating modes that turn without throttle
_TAIL = 150 * MILLISECOND  # reports that are kept beyond the timeout, to see what was before a loss
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
            hold = track.hold
            if hold is not None and not isinstance(hold.place, int | None) and not hold.rests:
                course = hold.course("to the end of the recording", _taken(track.pwm(hold.since, 1 << 62)))
                yield told_later(hold, hold.place, course)

    def _at(self, bus: int, channel: int, number: Array, now: Mapping[int, RawCommands]) -> LastThrottle:
        return self._throttles.get(bus, ValidThrottle()).at(now.get(bus), channel, number)

    def _take_over(self, view: View, now: Mapping[int, RawCommands]) -> Iterator[Occurrence]:
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
        self, view: View, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, RawCommands]
    ) -> Iterator[Occurrences | Occurrence]:
        track, sent = self._tracks[unit], now.get(unit.bus)
        new = Samples(some.t, some.rpm, some.pct, some.current)
        whole = new if track.tail is None else track.tail.joined(new)
        told = np.logical_or.accumulate(np.concatenate(([track.tells], new.pct > 0)))[1:]
        steady = self._throttles.get(unit.bus, ValidThrottle()).steady
        if track.hold is not None or not steady(sent, unit.index, int(some.t[-1]), self._timeout):
            throttle = self._at(unit.bus, unit.index, some.number, now)
            lost = (throttle.t != NO_TIME) & ~fresh(some.t, throttle.t, self._timeout)
            if lost.any() or track.hold is not None:
                losses = Losses(self._pauses or Pauses(self._timeout), unit.bus, whole.t, lost, throttle.t, track.hold)
                motor = _Motor(self, view, unit, some, throttle, told, now, losses)
                yield from self._lose(track, motor, losses, whole)
        track.tells = bool(told[-1])
        recent = whole.t >= int(whole.t[-1]) - self._timeout - _TAIL
        recent[-RECENT:] = True
        track.tail = Samples(*(column[recent].copy() for column in whole))

    def _lose(self, track: _Track, motor: _Motor, losses: Losses, whole: Samples) -> Iterator[Occurrences | Occurrence]:
        """Follow the losses of an ESC; `whole` are its reports, and those before them."""
        told = ToldLosses(motor.view, motor.unit, motor.some)
        each, known = whole.each(), len(whole.t) - len(losses.lost)
        number = motor.some.number
        for first, stop, since, spare, heard in losses.stretches(self._timeout + 1):
            if track.hold is not None and (not losses.lost[first] or since != track.hold.since):
                taken = _taken(track.pwm(track.hold.since, number.item(first)))
                yield from told.tell(track.hold, partial(track.hold.course, "until throttle came back", taken))
                track.hold = None
            if not losses.lost[first]:
                continue
            if track.hold is None:
                track.hold = opened(whole.t, each, known + first, since, spare)
                track.hold.place = first if heard else None
            track.hold.feed(each[known + first : known + stop])
            if track.hold.still != NO_TIME and track.hold.place is not None:
                course = track.hold.course("", _taken(track.pwm(since, number.item(stop - 1))))
                yield from told.tell(track.hold, partial(str, course))
            motor.turns_on(track, first, stop)
        yield from motor.found()
        yield from told.occurrences()
        if track.hold is not None and isinstance(track.hold.place, int):
            track.hold.place = told.kept(track.hold.place, track.hold.since)

    def excused(self, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, RawCommands]) -> Array:
        """Return a mask of reports of an ESC that something else drives, or that folds or coasts down."""
        coasts = (some.mode == _COAST_DOWN) & (some.pct == 0)
        found: Array = np.isin(some.mode, _FOLDS) | coasts
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


class _Motor:
    """The reports of an ESC in a batch, of those the ones of a motor that is driven when no ESC may hold its throttle.

    `told` says up to each report whether the ESC has told its throttle.
    """

    def __init__(
        self, rule: WithoutThrottle, view: View, unit: ReportingEsc, some: SpeedReports, throttle: LastThrottle,
        told: Array, now: Mapping[int, RawCommands], losses: Losses,
    ) -> None:  # fmt: skip
        self.view, self.unit, self.some = view, unit, some
        self._rule, self._throttle, self._told, self._now, self._losses = rule, throttle, told, now, losses
        self._alone: list[int] = []
        self._doubtful: list[int] = []
        self._still = round(view.number("BUS-038", "still_s") * SECOND)

    @cached_property
    def _rpm(self) -> Array:
        return np.abs(self.some.rpm)

    @cached_property
    def _late(self) -> list[int]:
        """Reports behind the time in which an ESC may hold, of a motor that turns, and nothing excuses it."""
        fast = self._rpm > self.view.number("BUS-038", "turning_rpm")
        turns = fast & self._losses.lost & ~self._rule.excused(self.unit, self.some, self._now)
        late: list[int] = np.flatnonzero(turns & (self.some.t - self._throttle.t >= self._still)).tolist()
        return late

    @cached_property
    def _lasted(self) -> dict[int, bool]:
        """A mask of those by which the loss has lasted as long."""
        lasted = self._losses.lasted(np.array(self._late, np.int64), self._still)
        return dict(zip(self._late, lasted.tolist(), strict=True))

    @cached_property
    def _negative(self) -> Array:
        last = self._throttle.last
        found: Array = (last < 0) & (last != NO_CHANNEL) & ~self._told
        return found

    def turns_on(self, track: _Track, first: int, stop: int) -> None:
        """Look at some reports of a loss."""
        hold, some = track.hold, self.some
        if hold is None or some.t.item(stop - 1) - hold.since < self._still:
            return
        late = self._late[bisect_left(self._late, first) : bisect_left(self._late, stop)]
        speed, amperes = abs(hold.base.rpm), abs(hold.base.current)
        for k in late:
            fast = speed > STILL and self._rpm.item(k) >= _HALF * speed
            draws = fast and (not self._told[k] or abs(some.current.item(k)) >= max(1.0, _HALF * amperes))
            if not (some.pct.item(k) > 0 or draws or self._negative[k]):
                continue
            hold.over = hold.over or self._lasted[k]
            if not hold.over:
                continue
            taken, lost = track.pwm(hold.since, some.number.item(k)), bool(some.lost[k])
            if taken is None or (lost and not taken.sure):  # what PWM drives has not lost its throttle
                self._alone.append(k)
            elif not taken.sure:
                self._doubtful.append(k)

    def found(self) -> Iterator[Occurrences]:
        """Yield what was found."""
        if self._alone:
            yield self._said(self._alone)
        if self._doubtful:
            yield replace(self._said(self._doubtful), severity="warning")

    def _said(self, at: list[int]) -> Occurrences:
        some, throttle, channel = self.some, self._throttle, self.unit.index + 1
        rows = some.rows[at]
        place = dict(zip(rows.tolist(), at, strict=True))

        def values(row: int) -> Values:
            k = place[row]
            last, value = int(throttle.last[k]), 100 * int(throttle.value[k]) / FULL_THROTTLE
            why = "no command since" if last >= 0 else f"{last} since" if last != NO_CHANNEL else "no channel since"
            return {
                "channel": channel, "rpm": int(some.rpm[k]), "pct": float(some.pct[k]), "valid_pct": value,
                "why": why, "seconds": (int(some.t[k]) - int(throttle.t[k])) / SECOND,
            }  # fmt: skip

        return self.view.among_rows(
            "BUS-038", some.table, rows, values, drops=True, since=throttle.t[at],
            worst={"rpm": ("strongest", some.rpm[at])}, rises=np.zeros(len(at), bool),
        )  # fmt: skip


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
