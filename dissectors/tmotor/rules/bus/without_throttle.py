"""ESCs whose valid throttle is missing: what each does, whether PWM takes over, and who goes on turning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, Pauses, Rule, breach, last_set
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.hold import Samples
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, ReportingEsc, commands, fresh
from dissectors.tmotor.rules.joined.lost_throttle import Motors, Takeover, Track, follow, taken
from dissectors.tmotor.rules.joined.speed_reports import SpeedReporters, SpeedReports
from dissectors.tmotor.rules.joined.throttle_losses import RECENT, Losses, told_later
from dissectors.tmotor.rules.joined.valid_throttle import CommandGaps, LastThrottle, ValidThrottles

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import RawCommands
    from dissectors.tmotor.rules.joined.speed_reports import PacketRows

_COAST_DOWN, _FOLDS = 5, (7, 8)  # operating modes that turn without throttle
_TAIL = 150 * MILLISECOND  # reports that are kept beyond the timeout, to see what was before a loss
# A PWM width stands for so much throttle, in us: UAV, spraying drone (4.4.1 explanation 5).
_WIDTHS, _RANGE = (1040.0, 1050.0), 900.0
_SAME_WIDTH, _ALIKE_PCT = 1.5, 6.0  # us, %
_REPEATS = 20.0  # us: a width so close to the throttle by CAN is that one, or one just before
_FRESH = 20 * MILLISECOND  # a throttle that an ESC follows right now
_TAKEOVERS = 4  # the last ones of an ESC that a loss may still end with
_LEAST_WIDTH = 1060.0  # us: of a throttle above 0
_NONE = Samples(*(np.empty(0, kind) for kind in (np.int64, np.int64, np.float64, np.float32)))


class WithoutThrottle(Rule):
    """Joins what ESCs report with the last valid throttle before it; the first `MOST_UNITS` ESCs count."""

    rules = ("BUS-017", "BUS-034", "BUS-038")

    def __init__(self) -> None:
        self._throttles = ValidThrottles()
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
        now, packets = commands(view), self._reporters.feed(view)
        reports = [list(self._reporters.alone(packets)), list(self._reporters.by_status(view))]
        for unit, some in (one for part in reports for one in part):
            if unit not in self._tracks and len(self._tracks) < MOST_UNITS:
                self._tracks[unit] = Track(int(some.number[0]))
        if packets is not None:
            yield from self._take_over(view, packets, now)
        for part in reports:
            yield from self._follow_all(view, [(unit, some) for unit, some in part if unit in self._tracks], now)
        self._throttles.feed(now)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield losses that last to the end."""
        del view
        for track in self._tracks.values():
            hold = track.hold
            if hold is not None and not isinstance(hold.place, int | None) and not hold.rests:
                course = hold.course("to the end of the recording", taken(track.pwm(hold.since, 1 << 62)))
                yield told_later(hold, hold.place, course)

    def _take_over(self, view: View, packets: PacketRows, now: Mapping[int, RawCommands]) -> Iterator[Occurrence]:
        """Yield packets whose PWM width is what the ESC follows, and not the throttle that it had, or was 0 before."""
        wait = round(view.number("BUS-034", "wait_ms") * MILLISECOND)
        table, rows, groups = packets.table, packets.rows, packets.groups
        t, width = table.t[rows], table["pwm"][rows]
        bus, index = (packets.each(column) for column in zip(*((one.bus, one.index) for one in groups), strict=True))
        throttle = self._throttles.at(now, bus, index, packets.number)
        in_time = fresh(t, throttle.t, _FRESH)
        last, late = last_set(in_time), (throttle.t != NO_TIME) & ~fresh(t, throttle.t, wait)
        repeats = _stands_for(width, throttle.value, _REPEATS)
        any_late = np.append(0, np.cumsum(late)).tolist()
        for group in groups:
            track, part = self._tracks.get(group.esc), group.part
            if track is None:
                continue
            del track.takeovers[:-_TAKEOVERS]
            if any_late[part.stop] > any_late[part.start]:
                mine = LastThrottle(*(column[part] for column in throttle))
                before = last[part] - part.start, repeats[part]
                packet = table, rows[part], packets.number[part]
                yield from self._taken(view, track, packet, mine, np.flatnonzero(late[part]), before)
            at = last.item(part.stop - 1)
            if at >= part.start:
                track.width, track.repeats = width.item(at), repeats.item(at)

    def _taken(
        self, view: View, track: Track, packets: tuple[DecodedTable, Array, Array], throttle: LastThrottle,
        late: Array, before: tuple[Array, Array],
    ) -> Iterator[Occurrence]:  # fmt: skip
        """Yield which of the packets that come late after a throttle show another.

        `before` is of each the last one in time, below 0 for one of an earlier batch, and whether each one's width
        repeats the throttle.
        """
        (table, rows, number), (last, same) = packets, before
        width, pct, speed = (table[name][rows] for name in ("pwm", "throttle", "speed"))
        held = _stands_for(width[late], throttle.value[late], _SAME_WIDTH)
        turns = late[(speed[late] != 0) & (pct[late] > 0) & (width[late] >= _LEAST_WIDTH) & ~held]
        known = {one.since for one in track.takeovers}
        for k, at in zip(turns.tolist(), last[turns].tolist(), strict=True):
            since = throttle.t.item(k)
            was, repeats = (width.item(at), same.item(at)) if at >= 0 else (track.width, track.repeats)
            if since not in known and (was == 0 or _alike(width[k], pct[k])):
                known.add(since)
                values = {"microseconds": float(width[k]), "rpm": int(speed[k])}
                text = f"{values['microseconds']:.1f} us, {values['rpm']} rpm"
                track.takeovers.append(Takeover(since, number.item(k), text, not repeats))
                yield breach(view, table, rows.item(k), "BUS-034", values)

    def _follow_all(
        self, view: View, reports: list[tuple[ReportingEsc, SpeedReports]], now: Mapping[int, RawCommands]
    ) -> Iterator[Occurrences | Occurrence]:
        """Follow ESCs, of which none stands there twice."""
        if not reports:
            return
        gaps = {bus: CommandGaps.of(sent) for bus, sent in now.items()}
        tracks = [self._tracks[unit] for unit, _ in reports]
        told = [Samples(some.t, some.rpm, some.pct, some.current) for _, some in reports]
        parts = [part for track, new in zip(tracks, told, strict=True) for part in (track.tail or _NONE, new)]
        whole = Samples(*map(np.concatenate, zip(*parts, strict=True)))
        stop = np.cumsum([len(part.t) for part in parts])[1::2]
        ends = [0, *stop.tolist()]
        odd = [
            k
            for k, (track, one) in enumerate(zip(tracks, reports, strict=True))
            if track.hold is not None or not self._steady(*one, gaps)
        ]
        if odd:
            some = Samples(*(_picked(column, ends, odd) for column in whole))
            starts = np.append(0, np.cumsum([ends[k + 1] - ends[k] for k in odd]))
            yield from self._follow(view, [tracks[k] for k in odd], [reports[k] for k in odd], (some, starts), now)
        size = stop - np.append(0, stop[:-1])
        recent = whole.t >= np.repeat(whole.t[stop - 1] - self._timeout - _TAIL, size)
        recent |= np.repeat(stop, size) - np.arange(len(recent)) <= RECENT
        kept = whole.take(recent)
        ends = [0, *np.cumsum(recent)[stop - 1].tolist()]
        for track, new, first, end in zip(tracks, told, ends[:-1], ends[1:], strict=True):
            track.tells = track.tells or bool((new.pct > 0).any())
            track.tail = Samples(*(column[first:end].copy() for column in kept))

    def _steady(self, esc: ReportingEsc, some: SpeedReports, gaps: Mapping[int, CommandGaps]) -> bool:
        """Return whether an ESC has its throttle throughout."""
        throttle = self._throttles.of(esc.bus)
        return throttle.steady(gaps.get(esc.bus), esc.index, some.t.item(-1), self._timeout)

    def _follow(
        self, view: View, tracks: list[Track], reports: list[tuple[ReportingEsc, SpeedReports]],
        known: tuple[Samples, Array], now: Mapping[int, RawCommands],
    ) -> Iterator[Occurrences | Occurrence]:  # fmt: skip
        """Follow ESCs that may lose their throttle.

        `known` are their reports, those of each behind earlier ones, and where these begin.
        """
        units, each = zip(*reports, strict=True)
        table, columns = each[0].table, zip(*(one[1:] for one in each), strict=True)
        some = SpeedReports(table, *map(np.concatenate, columns))
        ends = np.append(0, np.cumsum([len(one.t) for one in each]))
        of = np.repeat(np.arange(len(units)), ends[1:] - ends[:-1])
        bus, index = np.array([unit.bus for unit in units]), np.array([unit.index for unit in units])
        throttle = self._throttles.at(now, bus[of], index[of], some.number)
        lost = (throttle.t != NO_TIME) & ~fresh(some.t, throttle.t, self._timeout)
        if not lost.any() and not any(track.hold is not None for track in tracks):
            return
        (whole, starts), pauses = known, self._pauses or Pauses(self._timeout)
        holds = [track.hold for track in tracks]
        losses = Losses(pauses, self._timeout, bus, ends, whole.t, starts, lost, throttle.t, holds)
        motors = Motors(view, some, ends, throttle, tracks, lambda k: self._excused(units[k], each[k], now))
        yield from follow(tracks, units, motors, losses, whole)

    def _excused(self, unit: ReportingEsc, some: SpeedReports, now: Mapping[int, RawCommands]) -> Array:
        """Return a mask of reports of an ESC that something else drives, or that folds or coasts down."""
        coasts = (some.mode == _COAST_DOWN) & (some.pct == 0)
        found: Array = (some.mode == _FOLDS[0]) | (some.mode == _FOLDS[1]) | coasts
        if not self._driven.never(unit.bus, unit.index):
            found |= self._driven.at(unit.bus, unit.index, some.number)
        if not self._priority.never(unit.bus, unit.node):
            found |= self._priority.at(unit.bus, unit.node, some.number)
        found |= self._elsewhere(unit, some.number, some.t, now)
        return found

    def _elsewhere(self, unit: ReportingEsc, number: Array, t: Array, now: Mapping[int, RawCommands]) -> Array:
        """Return where the ESC, which reports on another bus too, has its throttle from there."""
        found = np.zeros(len(number), bool)
        for bus in self._throttles.buses() | now.keys():
            other = self._tracks.get(unit._replace(bus=bus))
            if bus != unit.bus and other is not None:
                throttle = self._throttles.of(bus).at(now.get(bus), unit.index, number)
                found |= fresh(t, throttle.t, self._timeout) & (other.first <= number)
        return found


def _picked(values: Array, ends: list[int], some: list[int]) -> Array:
    """Return the values of some ESCs, whose values begin and end there."""
    if len(some) == len(ends) - 1:
        return values
    return np.concatenate([values[ends[k] : ends[k + 1]] for k in some])


def _stands_for(width: Array, value: Array, within: float) -> Array:
    """Return which widths (us) are those of throttles that were commanded, within some us."""
    found = np.zeros(len(width), bool)
    for low in _WIDTHS:
        found |= np.abs(width - (low + _RANGE * value / FULL_THROTTLE)) <= within
    return found


def _alike(width: float, pct: float) -> bool:
    """Return whether a width (us) stands for the throttle (%) that the ESC applies."""
    return any(abs(100 * (width - low) / _RANGE - pct) <= _ALIKE_PCT for low in _WIDTHS)
