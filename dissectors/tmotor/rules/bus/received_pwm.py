"""The PWM width that an ESC says it receives against the throttle by CAN (4.4.1 explanation 5, 4.4.5 no 10-11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule, groups
from dissectors.kit.order import spans
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.driven import DrivenUnits, PwmPriority
from dissectors.tmotor.rules.joined.joins import (
    FULL_THROTTLE,
    MOST_UNITS,
    LastCommands,
    ReportingEsc,
    esc_reports,
    fresh,
)
from dissectors.tmotor.rules.joined.recent_throttle import RecentThrottles
from dissectors.tmotor.rules.joined.speed_reports import StatusPackets
from dissectors.tmotor.rules.packets.carried import occurrence

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View
    from dissectors.tmotor.rules.joined.speed_reports import PacketGroup, PacketRows

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


class _Packets(NamedTuple):
    """Packets of one ESC: widths in us, throttles in %, whether they can be judged, and whether they are off then."""

    t: Array
    width: Array
    wanted: Array
    judged: Array
    off: Array


class _Extent(NamedTuple):
    """Range of widths (us) and throttles (%) in packets of one ESC that are `judged`, if there are any.

    `doubt` is since when there has been none, `NO_TIME` if the last one is judged.
    """

    narrowest: float
    least: float
    widest: float
    most: float
    judged: bool
    doubt: int


class _Claims:
    """First claims of what belongs to one alone: units and indexes to a node, and the other way round."""

    def __init__(self) -> None:
        self._first: dict[_Claim, dict[int, int]] = {}

    def note(self, claim: _Claim, who: int, number: int) -> None:
        """Add a transfer."""
        known = self._first.get(claim)
        if known is not None:
            known.setdefault(who, number)
        elif len(self._first) < 4 * MOST_UNITS:
            self._first[claim] = {who: number}

    def others(self, claim: _Claim, who: int) -> int:
        """Return the first transfer of anybody else."""
        known = self._first.get(claim, {})
        if len(known) == 1 and who in known:
            return _NEVER
        return min((number for one, number in known.items() if one != who), default=_NEVER)


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
        packets = self._packets.of(view)
        for group in () if packets is None else packets.groups:
            if packets is not None:
                number = packets.number.item(group.part.start)
                self._claims.note(("units of", group.bus, group.node), group.unit, number)
                self._claims.note(("unit", group.bus, group.unit), group.node, number)
        reports = esc_reports(view)
        if reports is not None:
            for one, first in zip(reports.escs, reports.number[reports.first[:-1]].tolist(), strict=True):
                self._claims.note(("indexes of", one.bus, one.node), one.index, first)
                self._claims.note(("index", one.bus, one.index), one.node, first)
        if packets is not None:
            yield from self._follow(view, packets)
        self._last.feed(view)
        self._recent.feed(view)

    def _clear(self, group: PacketGroup) -> int:
        """Return from which transfer on packets do not speak for one ESC alone, as far as is known by then."""
        bus, node, unit, index, alone, _ = group
        asked: list[tuple[_Claim, int]] = [(("units of", bus, node), unit), (("indexes of", bus, node), index)]
        asked.append((("unit", bus, unit) if alone else ("index", bus, index), node))
        return min(self._claims.others(claim, who) for claim, who in asked)

    def _follow(self, view: View, packets: PacketRows) -> Iterator[Occurrence]:
        joined = self._joined(view, packets)
        turned = packets.table["big_endian"][packets.rows]
        starts = np.array([group.part.start for group in packets.groups])
        any_off, some, every = (
            reduce.reduceat(mask, starts).tolist()
            for reduce, mask in ((np.logical_or, joined.off), (np.logical_or, turned), (np.logical_and, turned))
        )
        for k, (group, extent) in enumerate(zip(packets.groups, _extents(joined, starts), strict=True)):
            parts: list[tuple[bool, Array | slice]] = [(every[k], group.part)]
            if some[k] != every[k]:
                parts = [(bool(way), places + group.part.start) for way, places in groups(turned[group.part])]
            for way, places in parts:
                key = group.esc, way
                if key in self._escs or len(self._escs) < MOST_UNITS:
                    esc = self._escs.setdefault(key, _Esc())
                    if any_off[k] or len(parts) > 1:
                        mine = _Packets(*(column[places] for column in joined))
                        yield from self._runs(view, packets.table, esc, (group.esc, packets.rows[places], mine))
                    else:
                        _pass(esc, extent)

    def _runs(
        self, view: View, table: DecodedTable, esc: _Esc, what: tuple[ReportingEsc, Array, _Packets]
    ) -> Iterator[Occurrence]:
        """Follow packets of which some may be off, one by one."""
        unit, rows, packets = what
        lasts = view.number("BUS-043", "lasts_s") * SECOND
        for row, *columns in zip(rows.tolist(), *(column.tolist() for column in packets), strict=True):
            t, width, wanted, judged, off = columns
            if not judged:
                esc.run.doubt = t if esc.run.doubt == NO_TIME else esc.run.doubt
                continue
            esc.widths = min(esc.widths[0], width), max(esc.widths[1], width)
            esc.wanted = min(esc.wanted[0], wanted), max(esc.wanted[1], wanted)
            if not off or (esc.run.doubt != NO_TIME and t - esc.run.doubt > _DOUBT):
                esc.run = _Run()
            if not off:
                continue
            run = esc.run
            run.doubt = NO_TIME
            if run.since == NO_TIME:
                said = {"channel": unit.index + 1, "wanted_pct": wanted, "microseconds": width}
                said["pct"] = min(max(100 * (width - _UAV) / _RANGE, 0.0), 100.0)
                run.since, run.place = t, occurrence(view, table, row, "BUS-043", said, held=True)
            run.packets += 1
            long = t - run.since >= lasts and run.packets >= _ENOUGH
            if run.place is not None and not run.told and long and not _unused(esc):
                run.told = True
                values = {**run.place.values, "seconds": (t - run.since) / SECOND, "packets": run.packets}
                yield replace(run.place, values=values)

    def _joined(self, view: View, packets: PacketRows) -> _Packets:
        table, rows, groups_ = packets.table, packets.rows, packets.groups
        t, width = table.t[rows], table["pwm"][rows].astype(np.float64)
        bus, index = (packets.each(column) for column in zip(*((one.bus, one.index) for one in groups_), strict=True))
        command = self._last.at_rows(view, table, rows, bus, index)
        timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        judged = fresh(t, command.t, timeout) & (command.cmd > 0) & (table["fault"][rows] == 0)
        judged &= (width >= _KNOWN[0]) & (width <= _KNOWN[1])
        judged &= packets.number < packets.each([self._clear(group) for group in groups_])
        for group in groups_:
            part = group.part
            if not self._priority.never(group.bus, group.node):
                judged[part] &= ~self._priority.at(group.bus, group.node, packets.number[part])
            if not self._driven.never(group.bus, group.index):
                judged[part] &= ~self._driven.at(group.bus, group.index, packets.number[part])
        wanted = command.cmd * 100 / FULL_THROTTLE
        near = np.abs(width - (_UAV + _RANGE * wanted / 100)) <= _STANDS
        low, high = self._lately(view, packets, (bus, index, t), (wanted, judged & ~near))
        judged &= high - low <= view.number("BUS-043", "steady_pct")
        off_us = view.number("BUS-043", "off_us")
        least, most = _UAV + _RANGE * low / 100 - off_us, _SPRAYING + _RANGE * high / 100 + off_us
        return _Packets(t, width, wanted, judged, judged & ~((least <= width) & (width <= most)))

    def _lately(
        self, view: View, packets: PacketRows, where: tuple[Array, Array, Array], what: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """Return the lowest and highest throttle (%) just before each packet; what is near is not asked for."""
        (bus, index, t), (wanted, ask) = where, what
        low, high = wanted.copy(), wanted.copy()
        at = np.flatnonzero(ask)
        for one, begin, end in spans(bus[at]):
            some = at[begin:end]
            asked = zip(*(column[some].tolist() for column in (index, packets.number, t)), strict=True)
            found = np.array(list(self._recent.spans(view, one, asked)), np.int64)
            low[some], high[some] = (found * 100 / FULL_THROTTLE).T
        return low, high


def _extents(packets: _Packets, starts: Array) -> Iterator[_Extent]:
    """Yield the extents of packets that can be judged, of each ESC: where the ones of each begin is given."""
    judged, count = packets.judged, len(packets.judged)
    last = np.maximum.reduceat(np.where(judged, np.arange(count), -1), starts)
    behind = np.maximum(last + 1, starts)
    ends = np.append(starts[1:], count)
    lowest = (np.minimum.reduceat(np.where(judged, column, np.inf), starts) for column in packets[1:3])
    highest = (np.maximum.reduceat(np.where(judged, column, -np.inf), starts) for column in packets[1:3])
    doubt = np.where(behind < ends, packets.t[np.minimum(behind, count - 1)], NO_TIME)
    columns = *lowest, *highest, last >= 0, doubt
    return map(_Extent._make, zip(*(column.tolist() for column in columns), strict=True))


def _pass(esc: _Esc, extent: _Extent) -> None:
    """Note packets of which none is off."""
    if extent.judged:
        esc.widths = min(esc.widths[0], extent.narrowest), max(esc.widths[1], extent.widest)
        esc.wanted = min(esc.wanted[0], extent.least), max(esc.wanted[1], extent.most)
        esc.run = _Run()
    if esc.run.doubt == NO_TIME:
        esc.run.doubt = extent.doubt


def _unused(esc: _Esc) -> bool:
    """Return whether the width may be that of an input of its own: it rests, or stands while the throttle moves."""
    stands = esc.widths[1] - esc.widths[0] <= _STANDS
    moves = _RANGE * (esc.wanted[1] - esc.wanted[0]) / 100 > 2 * _STANDS
    return all(map(_rests, esc.widths)) or (stands and moves)


def _rests(width: float) -> bool:
    return width <= _RESTS or abs(width - _MIDDLE) <= _NEAR_MIDDLE
