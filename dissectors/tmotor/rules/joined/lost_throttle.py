"""ESCs whose valid throttle is missing: what each does until that comes back, and whether its motor goes on turning."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, last_set
from dissectors.kit.cells import floats
from dissectors.records import dataclass, field
from dissectors.tmotor.rules.joined.hold import STILL
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, NO_CHANNEL
from dissectors.tmotor.rules.joined.throttle_losses import ToldLosses, opened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dissectors.kit import Array, Occurrence, Occurrences, Severity, Values, View
    from dissectors.tmotor.rules.joined.hold import Hold, Samples
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


class Motors:
    """The reports of ESCs in a batch, of those the ones of motors that are driven when no ESC may hold its throttle.

    Args:
        view: the batch.
        some: the reports, one ESC after the other.
        ends: where those of each begin, and where the last ones end.
        throttle: the last valid one before each.
        tracks: the ESCs.
        excused: tells which reports of one of them something excuses.
    """

    def __init__(
        self, view: View, some: SpeedReports, ends: Array, throttle: LastThrottle, tracks: Sequence[Track],
        excused: Callable[[int], Array],
    ) -> None:  # fmt: skip
        self.view, self.some, self.ends = view, some, ends
        self._throttle, self._tracks, self._excused = throttle, tracks, excused
        self._still = round(view.number("BUS-038", "still_s") * SECOND)
        self._found: list[tuple[Array, list[int], Severity | None]] = []

    def _late(self, losses: Losses) -> Array:
        """Return reports behind the time in which an ESC may hold, of motors that turn, and nothing excuses it."""
        late = losses.lost & (np.abs(self.some.rpm) > self.view.number("BUS-038", "turning_rpm"))
        late &= self.some.t - self._throttle.t >= self._still
        for k, (begin, end) in enumerate(pairwise(self.ends.tolist())):
            part = slice(begin, end)
            if late[part].any():
                late[part] &= ~self._excused(k)
        found: Array = late.nonzero()[0]
        return found

    def _told(self) -> Array:
        """Return up to each report whether its ESC has told its throttle."""
        size = self.ends[1:] - self.ends[:-1]
        told: Array = last_set(self.some.pct > 0) >= np.repeat(self.ends[:-1], size)
        told |= np.repeat([track.tells for track in self._tracks], size)
        return told

    def turn_on(self, losses: Losses, speed: Array, current: Array, over: Array) -> Array:
        """Look at the reports of losses; return which of these are `over` by then, a place for each stretch.

        `speed` and `current` are what there was before. A loss is over once it has lasted so long that no ESC may hold
        any more.
        """
        some, stretches = self.some, losses.stretches
        long = some.t[stretches.stop - 1] - stretches.since >= self._still
        if not long.any():
            return over
        at = self._late(losses)
        at = at[long[losses.of(at)[0]]]
        which, esc = losses.of(at)
        told, last = self._told()[at], self._throttle.last[at]
        fast = (speed[which] > STILL) & (np.abs(some.rpm[at]) >= _HALF * speed[which])
        draws = fast & (~told | (np.abs(some.current[at]) >= np.fmax(1.0, _HALF * current[which])))
        negative = (last < 0) & (last != NO_CHANNEL) & ~told
        shows = (some.pct[at] > 0) | draws | negative
        at, which, esc = at[shows], which[shows], esc[shows]
        lasted = np.where(losses.lasted(at, which, self._still), which, -1)
        lasted = (np.maximum.accumulate(lasted) == which) | over[which]
        at, which, esc = at[lasted], which[lasted], esc[lasted]
        over[which] = True
        self._judge(at, esc, stretches.since[which])
        return over

    def _judge(self, at: Array, esc: Array, since: Array) -> None:
        """Leave out what PWM drives for sure: that has not lost its throttle."""
        alone, doubtful = np.ones(len(at), bool), np.zeros(len(at), bool)
        driven = np.array([bool(track.takeovers) for track in self._tracks])[esc].nonzero()[0]
        for k in driven.tolist():
            pwm = self._tracks[esc[k]].pwm(since.item(k), self.some.number.item(at[k]))
            alone[k] = pwm is None or (self.some.lost.item(at[k]) and not pwm.sure)
            doubtful[k] = pwm is not None and not alone[k] and not pwm.sure
        kinds: tuple[tuple[Array, Severity | None], ...] = ((alone, None), (doubtful, "warning"))
        for mask, severity in kinds:
            places = at[mask]
            if len(places):
                self._found.append((places, places.searchsorted(self.ends).tolist(), severity))

    def found(self, k: int, unit: ReportingEsc) -> Iterator[Occurrences]:
        """Yield what was found of an ESC."""
        for at, ends, severity in self._found:
            if ends[k] < ends[k + 1]:
                yield self._said(at[ends[k] : ends[k + 1]], unit.index + 1, severity)

    def _said(self, at: Array, channel: int, severity: Severity | None) -> Occurrences:
        some, throttle = self.some, self._throttle
        rows = some.rows[at]

        def values(row: int) -> Values:
            k = at.item((rows == row).argmax())
            last, value = int(throttle.last[k]), 100 * int(throttle.value[k]) / FULL_THROTTLE
            why = "no command since" if last >= 0 else f"{last} since" if last != NO_CHANNEL else "no channel since"
            return {
                "channel": channel, "rpm": int(some.rpm[k]), "pct": float(some.pct[k]), "valid_pct": value,
                "why": why, "seconds": (int(some.t[k]) - int(throttle.t[k])) / SECOND,
            }  # fmt: skip

        return self.view.among_rows(
            "BUS-038", some.table, rows, values, drops=True, since=throttle.t[at], severity=severity,
            worst={"rpm": ("strongest", some.rpm[at])}, rises=np.zeros(len(at), bool),
        )  # fmt: skip


def follow(
    tracks: Sequence[Track], units: Sequence[ReportingEsc], motors: Motors, losses: Losses, whole: Samples
) -> Iterator[Occurrences | Occurrence]:
    """Follow the losses of throttle of ESCs.

    `whole` are their reports, those of each ESC behind earlier ones of it.
    """
    stretches, some = losses.stretches, motors.some
    over = motors.turn_on(losses, *_had(tracks, losses, whole))
    shown = _shown(stretches, whole)
    for k, (track, unit) in enumerate(zip(tracks, units, strict=True)):
        first, stop = losses.ends[k : k + 2]
        if first == stop and track.hold is None:
            continue
        begin, end = motors.ends[k : k + 2].tolist()
        told = ToldLosses(motors.view, unit, some)
        if track.hold is not None:
            until = begin
            if first < stop and losses.holding[first]:
                until = stretches.stop.item(first)
                yield from _goes_on(track, told, stretches.take(slice(first, first + 1)), whole, some.number)
                first += 1
            if until < end:
                yield from _ends(track, told, some.number.item(until))
        if first < stop:
            lasts = stretches.stop.item(stop - 1) == end
            told.add(shown[first : stop - lasts], _course([*track.takeovers], stretches, whole, some.number))
            if lasts:
                yield from _begins(track, told, stretches.take(slice(stop - 1, stop)), whole, some.number)
        if track.hold is not None:
            track.hold.over = over.item(stop - 1)
        yield from motors.found(k, unit)
        yield from told.occurrences()
        if track.hold is not None and isinstance(track.hold.place, int):
            track.hold.place = told.kept(track.hold.place, track.hold.since)


def _had(tracks: Sequence[Track], losses: Losses, whole: Samples) -> tuple[Array, Array, Array]:
    """Return speed and current of the last report before each loss, and whether no ESC may hold any more by then."""
    base = losses.stretches.base
    speed, current, over = whole.rpm[base], floats(whole.current[base]), np.zeros(len(base), bool)
    for at in losses.holding.nonzero()[0].tolist():
        hold = tracks[losses.esc.item(at)].hold
        if hold is not None:
            speed[at], current[at], over[at] = hold.base.rpm, hold.base.current, hold.over
    return np.abs(speed), np.abs(current), over


def _ends(track: Track, told: ToldLosses, number: int) -> Iterator[Occurrence]:
    """Tell the loss of an ESC that ends with the throttle before the report of a transfer, if there is one."""
    hold, track.hold = track.hold, None
    if hold is not None:
        yield from told.tell(hold, partial(hold.course, _CAME_BACK, taken(track.pwm(hold.since, number))))


def _begins(track: Track, told: ToldLosses, now: Stretches, whole: Samples, number: Array) -> Iterator[Occurrence]:
    """Follow an ESC through reports with which a loss begins that goes on behind them."""
    track.hold = opened(whole, now, 0)
    track.hold.place = now.first.item(0) if now.heard.item(0) else None
    yield from _goes_on(track, told, now, whole, number)


def _goes_on(track: Track, told: ToldLosses, now: Stretches, whole: Samples, number: Array) -> Iterator[Occurrence]:
    """Follow an ESC through reports of its loss."""
    hold = track.hold
    if hold is None:
        return
    hold.feed(now.each(whole, 0))
    if hold.still != NO_TIME and hold.place is not None:
        course = hold.course("", taken(track.pwm(hold.since, number.item(now.stop.item(0) - 1))))
        yield from told.tell(hold, partial(str, course))


def _shown(losses: Stretches, whole: Samples) -> list[tuple[int, int, int, int] | None]:
    """Return place, time of the throttle and of the last report, and number of each loss to be told, None of others.

    Where a motor stood there was nothing to hold.
    """
    rests = (np.abs(whole.rpm[losses.base]) <= STILL) & (whole.pct[losses.base] == 0)
    told, last = (losses.heard & ~rests).tolist(), whole.t[losses.known + losses.stop - 1]
    columns = (column.tolist() for column in (losses.first, losses.since, last))
    return [(*one, k) if told[k] else None for k, one in enumerate(zip(*columns, strict=True))]


def _course(takeovers: list[Takeover], losses: Stretches, whole: Samples, number: Array) -> Callable[[int], str]:
    """Return what says of losses that begin and end in this batch what the ESC did: few of them are shown."""

    def course(k: int) -> str:
        hold = opened(whole, losses, k)
        hold.feed(losses.each(whole, k))
        stood, stop = hold.still != NO_TIME, losses.stop.item(k)
        pwm = _took_over(takeovers, hold.since, number.item(stop - 1 if stood else stop))
        return hold.course("" if stood else _CAME_BACK, taken(pwm))

    return course


def _took_over(takeovers: Iterable[Takeover], since: int, number: int) -> Takeover | None:
    """Return what took over in a loss up to a transfer."""
    return next((one for one in takeovers if one.since == since and one.number <= number), None)


def taken(one: Takeover | None) -> str:
    """Say what took over."""
    if one is None:
        return ""
    what = "PWM took over" if one.sure else "followed PWM, or commands that are not recorded"
    return f"{what} ({one.text})"
