"""Motors against their commands, and two ways to say what they do against each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule, breach
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.joined.driven import DrivenUnits
from dissectors.tmotor.rules.joined.joins import (
    FULL_THROTTLE,
    MOST_UNITS,
    NO_CHANNEL,
    InForce,
    LastCommands,
    RawCommands,
    ReportingEsc,
    commands,
    esc_reports,
    fresh,
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Occurrences, Severity, View
    from dissectors.tmotor.rules.joined.joins import EscReports

_CHANNELS = 32
_HIGH, _ZERO = 1, 2  # what a channel is: above the limit, or 0; 0 stands for anything else
_UNDRIVEN = (5, 7, 8)  # coast down and both folds turn without throttle


class _Throttle:
    """A bus's commands up to the batch: the time of the last one, what each channel is and since when."""

    def __init__(self) -> None:
        self.t = NO_TIME
        self.kind = np.zeros(_CHANNELS, np.int8)
        self.since = np.full(_CHANNELS, NO_TIME)

    def feed(self, sent: RawCommands, high: int, timeout: int) -> None:
        """Make this batch's commands the last ones."""
        count = min(len(sent.cmd), _CHANNELS)
        kind = _kinds(sent.cmd[:count], high)
        changed = np.concatenate((kind[:, :1] != self.kind[:count, None], kind[:, 1:] != kind[:, :-1]), axis=1)
        changed |= sent.paused(self.t, timeout)
        for channel in np.flatnonzero(changed.any(axis=1)).tolist():
            self.since[channel] = sent.t[np.flatnonzero(changed[channel])[-1]]
        self.kind[:] = 0
        self.kind[:count], self.t = kind[:, -1], int(sent.t[-1])


@dataclass(slots=True)
class _State:
    """An ESC's reports up to the batch: its runs that may go on."""

    kind: int = 0
    first: int = NO_TIME
    breach: bool = False
    negative: Occurrence | None = None
    reports: int = 0
    confirmed: bool = False


class _Joined(NamedTuple):
    """An ESC's reports of a batch, and the command in force at each."""

    unit: ReportingEsc
    table: DecodedTable
    rows: Array
    t: Array
    command: InForce


class Following(Rule):
    """ESCs against the throttle of their channel."""

    rules = ("BUS-016", "BUS-028")

    def __init__(self) -> None:
        self._throttles: dict[int, _Throttle] = {}
        self._states: dict[ReportingEsc, _State] = {}
        self._last, self._driven = LastCommands(), DrivenUnits()

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Join each report with the command before it."""
        if view.start == NO_TIME:
            return
        now, reports = commands(view), esc_reports(view)
        high = int(view.number("BUS-028", "high_pct") / 100 * FULL_THROTTLE)
        timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        self._driven.feed(view)
        if reports is not None:
            yield from self._join(view, reports, high, timeout)
        for bus, sent in now.items():
            self._throttles.setdefault(bus, _Throttle()).feed(sent, high, timeout)
        self._last.feed(view)

    def _join(self, view: View, reports: EscReports, high: int, timeout: int) -> Iterator[Occurrence]:
        """Look at the ESCs with reports that do not fit; the others follow."""
        command, now, rpm = self._last.at_reports(view, reports), commands(view), reports.column("rpm")
        recent, cmd = fresh(reports.t, command.t, timeout), command.cmd
        kind = np.where(cmd > high, _HIGH, np.where(cmd == 0, _ZERO, 0)) * recent
        turning = np.abs(rpm) > view.number("BUS-028", "turning_rpm")
        suspect = np.where(((kind == _HIGH) & (rpm == 0)) | ((kind == _ZERO) & turning), kind, 0)
        negative = recent & (cmd < 0) & (cmd != NO_CHANNEL)
        odd = zip(reports.any(suspect != 0), reports.any(negative), strict=True)
        for unit, part, (suspicious, some_negative) in zip(reports.escs, reports.parts, odd, strict=True):
            if unit not in self._states and len(self._states) >= MOST_UNITS:
                continue
            state = self._states.setdefault(unit, _State())
            if not suspicious:
                state.kind, state.breach = 0, False
            if not (suspicious or some_negative or state.negative):
                continue
            forced = InForce(*(column[part] for column in command))
            joined = _Joined(unit, reports.table, reports.rows[part], reports.t[part], forced)
            if suspicious:
                throttle, sent = self._throttles.get(unit.bus, _Throttle()), now.get(unit.bus)
                yield from self._follow(view, state, joined, (suspect[part].copy(), throttle, sent, high, timeout))
            if some_negative or state.negative:
                yield from _negative(view, state, joined, negative[part])

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield negative throttle up to the end."""
        for state in self._states.values():
            yield from _judge(view, state)

    def _follow(self, view: View, state: _State, joined: _Joined, what: Any) -> Iterator[Occurrence]:
        suspect, throttle, sent, high, timeout = what
        table, rows, unit = joined.table, joined.rows, joined.unit
        rpm = table["rpm"][rows]
        cmd = joined.command.cmd
        if (suspect == _ZERO).any():
            number = table["transfer"][rows].astype(np.int64)
            driven = self._driven.at(unit.bus, unit.index, number)
            excused = np.isin(table["error_count.mode"][rows], _UNDRIVEN) | driven
            suspect[(suspect == _ZERO) & excused] = 0
        if not suspect.any():
            state.kind, state.breach = 0, False
            return
        began = np.concatenate(([suspect[0] != state.kind], suspect[1:] != suspect[:-1]))
        first = np.maximum.accumulate(np.where(began, joined.t, state.first))
        since = np.maximum(first, _since(throttle, sent, unit.index, high, timeout)[joined.command.k])
        limits = np.array([0, view.number("BUS-028", "high_s"), view.number("BUS-028", "zero_s")]) * SECOND
        breach = (suspect != 0) & (joined.t - np.maximum(since, 0) >= limits[suspect])
        fresh_ones = breach & ~(np.concatenate(([state.breach], breach[:-1])) & ~began)
        for at in np.flatnonzero(fresh_ones).tolist():
            pct = 100 * int(cmd[at]) / FULL_THROTTLE
            values = {"channel": unit.index + 1, "throttle_pct": pct, "rpm": int(rpm[at])}
            yield _report(view, "BUS-028", joined, at, values)
        state.kind, state.first, state.breach = int(suspect[-1]), int(first[-1]), bool(breach[-1])


def _kinds(cmd: Array, high: int) -> Array:
    kind: Array = (cmd > high).view(np.int8) + (cmd == 0).view(np.int8) * np.int8(_ZERO)
    return kind


def _since(throttle: _Throttle, sent: RawCommands | None, channel: int, high: int, timeout: int) -> Array:
    """Return since when a channel has been what it is, for the command before the batch and each of the batch."""
    before = throttle.since[channel : channel + 1]
    if sent is None or channel >= len(sent.cmd):
        return before if sent is None else np.concatenate((before, sent.t))
    kind = np.concatenate((throttle.kind[channel : channel + 1], _kinds(sent.cmd[channel], high)))
    start = (kind[1:] != kind[:-1]) | sent.paused(throttle.t, timeout)
    return np.concatenate((before, np.maximum.accumulate(np.where(start, sent.t, before[0]))))


def _report(view: View, rule: str, joined: _Joined, at: int, values: Mapping[str, Any]) -> Occurrence:
    return breach(view, joined.table, int(joined.rows[at]), rule, values, held=True)


def _negative(view: View, state: _State, joined: _Joined, negative: Array) -> Iterator[Occurrence]:
    """Yield runs of reports while a channel is negative (BUS-016)."""
    abnormal = joined.table["error_count.throttle_abnormal"][joined.rows]
    edges = np.flatnonzero(np.diff(negative)) + 1
    for part in np.split(np.arange(len(negative)), edges):
        if not negative[part[0]]:
            yield from _judge(view, state)
            continue
        if state.negative is None:
            values = {"channel": joined.unit.index + 1, "value": int(joined.command.cmd[part[0]])}
            state.negative = _report(view, "BUS-016", joined, int(part[0]), values)
        state.reports += len(part)
        state.confirmed |= bool(abnormal[part].any())


def _judge(view: View, state: _State) -> Iterator[Occurrence]:
    """Yield the end of such a run."""
    if state.negative is not None and state.reports >= view.number("BUS-016", "min_reports"):
        answer = "the ESC sets bit 4, as it should," if state.confirmed else "the ESC is silent (bit 4 is 0)"
        values = {**state.negative.values, "reports": state.reports, "answer": answer}
        severity: Severity | None = "note" if state.confirmed else None
        yield replace(state.negative, values=values, severity=severity, dialects={"dronecan": None})
    state.negative, state.reports, state.confirmed = None, 0, False
