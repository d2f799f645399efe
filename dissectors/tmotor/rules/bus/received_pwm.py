"""The PWM width that an ESC says it receives against the throttle by CAN (4.4.1 explanation 5, 4.4.5 no 10-11)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.joins import (
    FULL_THROTTLE,
    MOST_UNITS,
    LastCommands,
    ReportingEsc,
    fresh,
    units,
)
from dissectors.tmotor.rules.joined.recent_throttle import RecentThrottles
from dissectors.tmotor.rules.joined.speed_reports import StatusPackets
from dissectors.tmotor.rules.packets.carried import occurrence

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, View
    from dissectors.tmotor.rules.joined.speed_reports import PacketRows

    _Claim = tuple[str, int, int]

# us: throttle 0 of a UAV and of a spraying drone, and how much more full throttle is (4.4.1 explanation 5).
_UAV, _SPRAYING, _RANGE = 1040.0, 1050.0, 900.0
_KNOWN = (800.0, 2200.0)  # us: what an ESC recognizes
# us: an input that nobody drives rests below the first width, or near the middle of reversible outputs.
_RESTS, _MIDDLE, _NEAR_MIDDLE = 1100.0, 1500.0, 10.0
_STANDS = 20.0  # us: what moves less does not move
_ENOUGH = 3  # packets
_DOUBT = SECOND  # after packets that cannot be judged for longer it begins anew
_NEVER = 1 << 62
_AGO = 300 * MILLISECOND  # so old may the throttle be that a packet was made of


@dataclass(slots=True)
class _Run:
    """Packets of an ESC that are off, one after the other: since when, how many, the first one, whether it was told.

    `doubt` is since when packets that cannot be judged have been coming; they prove nothing, neither way.
    """

    since: int = NO_TIME
    doubt: int = NO_TIME
    packets: int = 0
    place: Occurrence | None = None
    told: bool = False


@dataclass(slots=True)
class _Esc:
    """Range of widths (us) and throttles (%) in the packets of one ESC."""

    widths: tuple[float, float] = (np.inf, -np.inf)
    wanted: tuple[float, float] = (np.inf, -np.inf)
    run: _Run = field(default_factory=_Run)


class _Packet(NamedTuple):
    """One packet: width in us, throttle in %, lowest and highest of the last moment, and whether it can be judged."""

    t: int
    width: float
    wanted: float
    low: float
    high: float
    judged: bool


class _Claims:
    """First claims of what belongs to one alone: units and indexes to a node, and the other way round."""

    def __init__(self) -> None:
        self._first: dict[_Claim, dict[int, int]] = {}

    def note(self, claim: _Claim, who: int, number: int) -> None:
        """Add a transfer."""
        if claim in self._first or len(self._first) < 4 * MOST_UNITS:
            self._first.setdefault(claim, {}).setdefault(who, number)

    def others(self, claim: _Claim, who: int) -> int:
        """Return the first transfer of anybody else."""
        return min((number for one, number in self._first.get(claim, {}).items() if one != who), default=_NEVER)


class ReceivedPwm(Rule):
    """Follows the status packets of each ESC; a node that speaks for several is left out."""

    rules = ("BUS-043",)

    def __init__(self) -> None:
        self._last, self._recent = LastCommands(), RecentThrottles(_AGO)
        self._packets = StatusPackets()
        self._driven, self._priority = DrivenUnits(), PwmPriority()
        self._escs: dict[tuple[ReportingEsc, bool], _Esc] = {}
        self._claims = _Claims()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield widths that are off for long enough."""
        if view.start == NO_TIME:
            return
        for part in (self._packets, self._driven, self._priority):
            part.feed(view)
        packets = list(self._packets.of(view))
        for (bus, node), some in packets:
            unit, number = int(some.table["unit_id"][some.rows[0]]), int(some.number[0])
            self._claims.note(("units of", bus, node), unit, number)
            self._claims.note(("unit", bus, unit), node, number)
        reports = view.table("ESCStatus")
        for one, rows in units(view).items():
            number = -1 if reports is None else int(reports["transfer"][rows[0]])
            self._claims.note(("indexes of", one.bus, one.node), one.index, number)
            self._claims.note(("index", one.bus, one.index), one.node, number)
        for (bus, node), some in packets:
            yield from self._follow(view, ReportingEsc(bus, node, some.esc_index), some)
        self._last.feed(view)
        self._recent.feed(view)

    def _clear(self, unit: ReportingEsc, some: PacketRows) -> Array:
        """Return which packets speak for one ESC that no other node speaks for, as far as is known by then."""
        number = int(some.table["unit_id"][some.rows[0]])
        asked: list[tuple[_Claim, int]] = [(("units of", unit.bus, unit.node), number)]
        asked.append((("indexes of", unit.bus, unit.node), unit.index))
        asked.append((("unit", unit.bus, number) if some.alone else ("index", unit.bus, unit.index), unit.node))
        found: Array = some.number < min(self._claims.others(claim, who) for claim, who in asked)
        return found

    def _follow(self, view: View, unit: ReportingEsc, some: PacketRows) -> Iterator[Occurrence]:
        table, lasts = some.table, view.number("BUS-043", "lasts_s") * SECOND
        reversed_ = table["big_endian"][some.rows]
        for packet, row, turned in zip(self._joined(view, unit, some), some.rows.tolist(), reversed_, strict=True):
            key = unit, bool(turned)
            if key not in self._escs and len(self._escs) >= MOST_UNITS:
                return
            esc = self._escs.setdefault(key, _Esc())
            if not packet.judged:
                esc.run.doubt = packet.t if esc.run.doubt == NO_TIME else esc.run.doubt
                continue
            off = _is_off(esc, packet, view.number("BUS-043", "off_us"))
            if not off or (esc.run.doubt != NO_TIME and packet.t - esc.run.doubt > _DOUBT):
                esc.run = _Run()
            if not off:
                continue
            run = esc.run
            run.doubt = NO_TIME
            if run.since == NO_TIME:
                said = {"channel": unit.index + 1, "wanted_pct": packet.wanted, "microseconds": packet.width}
                said["pct"] = min(max(100 * (packet.width - _UAV) / _RANGE, 0.0), 100.0)
                run.since, run.place = packet.t, occurrence(view, table, row, "BUS-043", said, held=True)
            run.packets += 1
            long = packet.t - run.since >= lasts and run.packets >= _ENOUGH
            if run.place is not None and not run.told and long and not _unused(esc):
                run.told = True
                values = {**run.place.values, "seconds": (packet.t - run.since) / SECOND, "packets": run.packets}
                yield replace(run.place, values=values)

    def _joined(self, view: View, unit: ReportingEsc, some: PacketRows) -> Iterator[_Packet]:
        table, rows = some.table, some.rows
        t, width = table.t[rows], table["pwm"][rows].astype(np.float64)
        command = self._last.in_force(view, unit.bus, unit.index, table, rows)
        timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        judged = fresh(t, command.t, timeout) & (command.cmd > 0) & (table["fault"][rows] == 0)
        judged &= (width >= _KNOWN[0]) & (width <= _KNOWN[1])
        judged &= ~self._priority.at(unit.bus, unit.node, some.number)
        judged &= ~self._driven.at(unit.bus, unit.index, some.number) & self._clear(unit, some)
        wanted = command.cmd * 100 / FULL_THROTTLE
        near = np.abs(width - (_UAV + _RANGE * wanted / 100)) <= _STANDS
        low, high = self._lately(view, unit, some, t, (wanted, judged & ~near))
        judged &= high - low <= view.number("BUS-043", "steady_pct")
        columns = (t, width, wanted, low, high, judged)
        yield from map(_Packet._make, zip(*(column.tolist() for column in columns), strict=True))

    def _lately(
        self, view: View, unit: ReportingEsc, some: PacketRows, t: Array, what: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """Return the lowest and highest throttle (%) just before each packet; what is near is not asked for."""
        wanted, ask = what
        low, high = wanted.copy(), wanted.copy()
        for k in np.flatnonzero(ask).tolist():
            span = self._recent.span(view, unit.bus, unit.index, int(some.number[k]), int(t[k]))
            low[k], high[k] = (one * 100 / FULL_THROTTLE for one in span)
        return low, high


def _is_off(esc: _Esc, packet: _Packet, off_us: float) -> bool:
    """Note what a judged packet shows, and return whether its width is that of another throttle."""
    esc.widths = min(esc.widths[0], packet.width), max(esc.widths[1], packet.width)
    esc.wanted = min(esc.wanted[0], packet.wanted), max(esc.wanted[1], packet.wanted)
    least, most = _UAV + _RANGE * packet.low / 100 - off_us, _SPRAYING + _RANGE * packet.high / 100 + off_us
    return not least <= packet.width <= most


def _unused(esc: _Esc) -> bool:
    """Return whether the width may be that of an input of its own: it rests, or stands while the throttle moves."""
    stands = esc.widths[1] - esc.widths[0] <= _STANDS
    moves = _RANGE * (esc.wanted[1] - esc.wanted[0]) / 100 > 2 * _STANDS
    return all(map(_rests, esc.widths)) or (stands and moves)


def _rests(width: float) -> bool:
    return width <= _RESTS or abs(width - _MIDDLE) <= _NEAR_MIDDLE
