"""PUSH-407: the power-on count and the runtime of a unit only go up (4.4.5 table 1 no 24-27)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule, sender, sound
from dissectors.records import dataclass
from dissectors.tmotor.rules.packets.carried import occurrence, unit_key

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import DecodedTable, Occurrence, View

_WRAP = 1 << 16
_SLACK = 2  # s, of a clock that counts whole seconds
_WITHOUT_TIMES = 60  # s that two packets are apart at most, if nobody knows
_MOST_UNITS = 4096
_MOST_HELD = 4096


class _Life(NamedTuple):
    t: int
    powered: int
    runtime: int


@dataclass(frozen=True, slots=True)
class _Doubt:
    """A runtime that went back; unless the node says that it started after `since`, that is a breach."""

    node: int
    since: int
    transfer: int
    found: Occurrence


class Lives(Rule):
    """Follows both counters of every node and unit. A lower runtime waits for the node's next uptime."""

    rules = ("PUSH-407",)

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._last: dict[int, _Life] = {}
        self._doubts: list[_Doubt] = []
        self._started: dict[int, int] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield counters that went back, as far as it is known why."""
        packets = view.table("PUSHCAN.MotorStatus")
        if packets is not None:
            yield from self._follow(view, packets)
        status = view.table("uavcan.protocol.NodeStatus")
        if status is not None:
            yield from self._excuse(status)

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield those for which no uptime came any more."""
        for doubt in self._doubts:
            if self._started.get(doubt.node, NO_TIME) <= doubt.since:
                yield doubt.found

    def _follow(self, view: View, table: DecodedTable) -> Iterator[Occurrence]:
        rows = sound(table).nonzero()[0]
        if not rows.size:
            return
        # A node that turns out to send the high byte first starts anew: its numbers before were read wrongly.
        keys = unit_key(table)[rows] << 1 | table["big_endian"][rows]
        order = np.argsort(keys, kind="stable")
        rows, keys = rows[order], keys[order]
        powered = table["power_on_count"][rows].astype(np.int64)
        runtime = table["runtime"][rows].astype(np.int64)
        first = np.ones(len(rows), bool)
        first[1:] = keys[1:] != keys[:-1]
        back = np.zeros(len(rows), bool)
        back[1:] = ~first[1:] & ((powered[1:] < powered[:-1]) | (runtime[1:] < runtime[:-1]))
        for k in (first | back).nonzero()[0].tolist():
            was = self._last.get(keys.item(k)) if first[k] else _life(table, int(rows[k - 1]))
            if was is not None and (powered.item(k) < was.powered or runtime.item(k) < was.runtime):
                yield from self._compare(view, table, int(rows[k]), was)
        ends = np.append(first[1:], True).nonzero()[0]
        columns = keys[ends], table.t[rows[ends]], powered[ends], runtime[ends]
        for key, *life in zip(*(column.tolist() for column in columns), strict=True):
            if key in self._last or len(self._last) < _MOST_UNITS:
                self._last[key] = _Life(*life)

    def _compare(self, view: View, table: DecodedTable, row: int, was: _Life) -> Iterator[Occurrence]:
        now = _life(table, row)
        known = NO_TIME not in (was.t, now.t)
        elapsed = (now.t - was.t) // SECOND + _SLACK if known else _WITHOUT_TIMES
        more = (now.powered - was.powered) % _WRAP
        if now.powered < was.powered and more > elapsed:
            values = {"field": "power-on count", "before": was.powered, "value": now.powered}
            yield occurrence(view, table, row, "PUSH-407", values)
        restarted = now.powered > was.powered or 0 < more <= elapsed
        if now.runtime < was.runtime and not restarted and (now.runtime - was.runtime) % _WRAP > elapsed:
            values = {"field": "runtime", "before": was.runtime, "value": now.runtime}
            found = occurrence(view, table, row, "PUSH-407", values, held=known)
            if not known:
                yield found
                return
            self._doubts.append(_Doubt(int(sender(table)[row]), was.t, int(table["transfer"][row]), found))
            if len(self._doubts) > _MOST_HELD:
                yield self._doubts.pop(0).found

    def _excuse(self, status: DecodedTable) -> Iterator[Occurrence]:
        """Decide by the first uptime after each packet in doubt, and the last one before it."""
        good = status.trusted & (status.t != NO_TIME)
        nodes = sender(status)
        started = status.t - status["uptime_sec"].astype(np.int64) * SECOND
        kept = []
        for doubt in self._doubts:
            rows = (good & (nodes == doubt.node)).nonzero()[0]
            at = int(status["transfer"][rows].searchsorted(doubt.transfer))
            seen = [*started[rows[max(at - 1, 0) : at + 1]].tolist(), self._started.get(doubt.node, NO_TIME)]
            if at == len(rows):
                kept.append(doubt)
            elif max(seen) <= doubt.since:
                yield doubt.found
        self._doubts = kept
        rows = good.nonzero()[0]
        last = np.full(int(nodes[rows].max(initial=0)) + 1, -1)
        last[nodes[rows]] = rows  # of a node's rows the last one stays
        found = (last >= 0).nonzero()[0]
        for node, t in zip(found.tolist(), started[last[found]].tolist(), strict=True):
            if node in self._started or len(self._started) < _MOST_UNITS:
                self._started[node] = t


def _life(table: DecodedTable, row: int) -> _Life:
    return _Life(int(table.t[row]), int(table["power_on_count"][row]), int(table["runtime"][row]))
