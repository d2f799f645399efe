"""An ESC whose valid throttle is missing: what it does until that comes back, and whether its motor goes on turning."""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.hold import STILL, Samples
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, NO_CHANNEL
from dissectors.tmotor.rules.joined.throttle_losses import ToldLosses, bases, opened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, Values, View
    from dissectors.tmotor.rules.joined.hold import Hold
    from dissectors.tmotor.rules.joined.joins import ReportingEsc
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports
    from dissectors.tmotor.rules.joined.throttle_losses import Losses, Stretches
    from dissectors.tmotor.rules.joined.valid_throttle import LastThrottle

_HALF = 0.5  # of its speed: without drive a propeller is slower by then; of its current: wind draws none
_CAME_BACK = "until throttle came back"


class Takeover(NamedTuple):
    """A packet that shows another throttle in charge, after the last valid one at `since`.

    It is not `sure` that it came as PWM where the width only repeated the throttle of CAN before (4.4.1 explanation 5).
    """

    since: int
    number: int
    text: str
    sure: bool


@dataclass(slots=True)
class Track:
    """One ESC: its last reports, its loss of throttle that is not over, and whether it ever told its throttle."""

    first: int
    tail: Samples | None = None
    hold: Hold | None = None
    tells: bool = False
    width: float = 0.0  # us, of the last packet before a loss
    repeats: bool = False  # it was that of the throttle by CAN
    takeovers: list[Takeover] = field(default_factory=list)

    def pwm(self, since: int, number: int) -> Takeover | None:
        """Return what took over in a loss up to a transfer."""
        return _took_over(self.takeovers, since, number)


class Motor:
    """The reports of an ESC in a batch, of those the ones of a motor that is driven when no ESC may hold its throttle.

    `told` says up to each report whether the ESC has told its throttle, `excused` which ones something excuses.
    """

    def __init__(
        self, view: View, unit: ReportingEsc, some: SpeedReports, throttle: LastThrottle, told: Array, losses: Losses,
        excused: Callable[[], Array],
    ) -> None:  # fmt: skip
        self.view, self.unit, self.some, self.losses = view, unit, some, losses
        self._throttle, self._told, self._excused = throttle, told, excused
        self._alone: list[int] = []
        self._doubtful: list[int] = []
        self._still = round(view.number("BUS-038", "still_s") * SECOND)

    @cached_property
    def _rpm(self) -> Array:
        return np.abs(self.some.rpm)

    @cached_property
    def _late(self) -> Array:
        """Reports behind the time in which an ESC may hold, of a motor that turns, and nothing excuses it."""
        fast = self._rpm > self.view.number("BUS-038", "turning_rpm")
        turns = fast & self.losses.lost & ~self._excused()
        return np.flatnonzero(turns & (self.some.t - self._throttle.t >= self._still))

    @cached_property
    def _negative(self) -> Array:
        last = self._throttle.last
        found: Array = (last < 0) & (last != NO_CHANNEL) & ~self._told
        return found

    def turns_on(self, track: Track, losses: Stretches, base: Samples, over: Array) -> Array:
        """Look at the reports of losses, before which the last ones were `base`; return which are `over` by then.

        A loss is over once it has lasted so long that no ESC may hold any more.
        """
        some, over = self.some, over.copy()
        long = some.t[losses.stop - 1] - losses.since >= self._still
        if not long.any():
            return over
        of = np.searchsorted(losses.first, self._late, "right") - 1
        mine = (of >= 0) & (self._late < losses.stop[of]) & long[of]
        at, of = self._late[mine], of[mine]
        speed, amperes = np.abs(base.rpm[of]), np.abs(base.current[of])
        fast = (speed > STILL) & (self._rpm[at] >= _HALF * speed)
        draws = fast & (~self._told[at] | (np.abs(some.current[at]) >= np.fmax(1.0, _HALF * amperes)))
        shows = (some.pct[at] > 0) | draws | self._negative[at]
        at, of = at[shows], of[shows]
        lasted = np.maximum.accumulate(np.where(self.losses.lasted(at, self._still), of, -1)) == of
        at, of = at[lasted | over[of]], of[lasted | over[of]]
        over[of] = True
        columns = at, losses.since[of], some.number[at], some.lost[at]
        for k, since, number, lost in zip(*(column.tolist() for column in columns), strict=True):
            pwm = track.pwm(since, number)
            if pwm is None or (lost and not pwm.sure):  # what PWM drives has not lost its throttle
                self._alone.append(k)
            elif not pwm.sure:
                self._doubtful.append(k)
        return over

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


def follow(track: Track, motor: Motor, whole: Samples, timeout: int) -> Iterator[Occurrences | Occurrence]:
    """Follow the losses of an ESC, of throttle that is older than so many ns.

    `whole` are its reports, and those before them.
    """
    told = ToldLosses(motor.view, motor.unit, motor.some)
    stretches = motor.losses.stretches(timeout + 1)
    last, begin = len(stretches.first) - 1, 0
    if track.hold is not None:
        yield from _goes_on(track, motor, told, stretches.take(slice(1)), whole)
        begin = 1
        if last:
            yield from _ends(track, motor, told, stretches.first.item(1))
    if begin < last:
        between = stretches.take(slice(begin, last))
        _take_whole(track, motor, told, between.take(motor.losses.lost[between.first]), whole)
    if begin <= last:
        yield from _goes_on(track, motor, told, stretches.take(slice(last, None)), whole)
    yield from motor.found()
    yield from told.occurrences()
    if track.hold is not None and isinstance(track.hold.place, int):
        track.hold.place = told.kept(track.hold.place, track.hold.since)


def _ends(track: Track, motor: Motor, told: ToldLosses, at: int) -> Iterator[Occurrence]:
    """Tell the loss of an ESC that ends with the throttle before a report, if there is one."""
    hold, track.hold = track.hold, None
    if hold is not None:
        pwm = taken(track.pwm(hold.since, motor.some.number.item(at)))
        yield from told.tell(hold, partial(hold.course, _CAME_BACK, pwm))


def _goes_on(track: Track, motor: Motor, told: ToldLosses, now: Stretches, whole: Samples) -> Iterator[Occurrence]:
    """Follow an ESC through reports since one throttle; its loss may have begun before them, and go on behind them."""
    first, stop, since, spare, heard = (column.item(0) for column in now)
    lost, known = motor.losses.lost.item(first), len(whole.t) - len(motor.losses.lost)
    if track.hold is not None and (not lost or since != track.hold.since):
        yield from _ends(track, motor, told, first)
    if not lost:
        return
    hold = track.hold
    if hold is None:
        hold = track.hold = opened(whole, known + first, since, spare)
        hold.place = first if heard else None
    hold.feed(whole.each(known + first, known + stop))
    if hold.still != NO_TIME and hold.place is not None:
        course = hold.course("", taken(track.pwm(since, motor.some.number.item(stop - 1))))
        yield from told.tell(hold, partial(str, course))
    base = Samples(*(np.array([cell]) for cell in hold.base))
    hold.over = motor.turns_on(track, now, base, np.array([hold.over])).item(0)


def _take_whole(track: Track, motor: Motor, told: ToldLosses, losses: Stretches, whole: Samples) -> None:
    """Follow an ESC through losses that begin and end in this batch: nothing is made but of those that are shown."""
    known, number, takeovers = len(whole.t) - len(motor.losses.lost), motor.some.number, [*track.takeovers]
    base = bases(whole.t, known + losses.first, losses.since)
    rests = (np.abs(whole.rpm[base]) <= STILL) & (whole.pct[base] == 0)
    some = losses.take(losses.heard & ~rests)

    def course(k: int) -> str:
        first, stop, since, spare, _ = (column.item(k) for column in some)
        hold = opened(whole, known + first, since, spare)
        hold.feed(whole.each(known + first, known + stop))
        stood = hold.still != NO_TIME
        until = number.item(stop - 1 if stood else stop)
        return hold.course("" if stood else _CAME_BACK, taken(_took_over(takeovers, since, until)))

    told.add(some, whole.t[known + some.stop - 1], course)
    motor.turns_on(track, losses, whole.take(base), np.zeros(len(base), bool))


def _took_over(takeovers: Iterable[Takeover], since: int, number: int) -> Takeover | None:
    """Return what took over in a loss up to a transfer."""
    return next((one for one in takeovers if one.since == since and one.number <= number), None)


def taken(one: Takeover | None) -> str:
    """Say what took over."""
    if one is None:
        return ""
    what = "PWM took over" if one.sure else "followed PWM, or commands that are not recorded"
    return f"{what} ({one.text})"
