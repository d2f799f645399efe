"""How often ESCs report: as configured."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, breach, sender, usable
from dissectors.kit.order import steps
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.joins import esc_reports
from dissectors.tmotor.rules.joined.periods import PeriodHistogram

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import EscReports

OPEN = 0xFFFF  # no rate
MOST_MEASURED = 256  # nodes
_STRAY = 0.1  # an index with a smaller share of the reports is no ESC of its own
_SKIPS = 0.25  # a larger share of transfer IDs that do not count up by 1 says nothing of what was lost


@dataclass(slots=True)
class _Measured:
    """The reports of a node since its rate was last set.

    `periods` are those of all reports by their transfer IDs, `heard` the times between those of one index. `skipped`
    of `counted` IDs are not that of the report before plus 1.
    """

    configured: int | None = None
    periods: PeriodHistogram = field(default_factory=PeriodHistogram)
    heard: PeriodHistogram = field(default_factory=PeriodHistogram)
    skipped: int = 0
    counted: int = 0
    latest: dict[int, int] = field(default_factory=dict)
    indexes: Counter[int] = field(default_factory=Counter)
    first: int = NO_TIME
    last: int = NO_TIME
    place: Occurrence | None = None

    def restart(self) -> None:
        self.periods, self.indexes, self.first = PeriodHistogram(), Counter(), NO_TIME
        self.heard, self.skipped, self.counted, self.latest = PeriodHistogram(), 0, 0, {}


class ReportRate(Rule):
    """The rate of ESCStatus against that of the last ParamGet; the first 256 nodes."""

    rules = ("BUS-018",)

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, int], _Measured] = {}
        self._set = False  # whether somebody has set a rate

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Measure between the reports of parameters, in the order of transfers."""
        if view.start == NO_TIME:
            return
        done: dict[tuple[int, int], int] = {}
        parameters, settings = view.table("ParamGet"), view.table("ParamCfg")
        every = esc_reports(view)
        reports = None if every is None else _Reports(view, every)
        sets = [] if settings is None else _numbers(settings, usable(settings) & (settings["esc_fdb_rate"] != OPEN))
        if parameters is not None:
            for row in _changes(parameters):
                number, who = int(parameters["transfer"][row]), (int(parameters.bus[row]), int(parameters.src[row]))
                one = self._node(who)
                if one is None:
                    continue
                configured = int(parameters["esc_fdb_rate"][row])
                if configured == one.configured:
                    continue
                if reports is not None:
                    _measure(one, reports, who, (done.get(who, -1), number))
                done[who] = number
                known = self._set or any(before < number for before in sets)
                if one.configured is not None or known:
                    yield from _judge(view, one)
                    one.restart()
                one.configured = configured
                one.place = breach(view, parameters, row, "BUS-018", {}, held=True)
        for who in () if reports is None else reports.places:
            one = self._node(who)
            if one is not None and reports is not None:
                _measure(one, reports, who, (done.get(who, -1), None))
        self._set = self._set or bool(sets)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Judge the last settings."""
        for one in self._nodes.values():
            yield from _judge(view, one)

    def _node(self, who: tuple[int, int]) -> _Measured | None:
        one = self._nodes.get(who)
        if one is None and len(self._nodes) < MOST_MEASURED:
            one = self._nodes[who] = _Measured()
        return one


class _Reports:
    """The reports of a batch, by the nodes that sent them."""

    def __init__(self, view: View, reports: EscReports) -> None:
        self.of, t = reports, view.transfers
        self.periods = _periods(view)[reports.rows]
        self.apart = steps(reports.t, reports.t.item(0))
        row = reports.table.row[reports.rows]
        counted = t.has("step")[row]
        self.counted = np.append(0, np.cumsum(counted))  # up to each: transfer IDs, and those that do not count up by 1
        self.skipped = np.append(0, np.cumsum(counted & (t.step[row] != 1)))
        self.places: dict[tuple[int, int], list[int]] = {}
        for k, esc in enumerate(reports.escs):
            self.places.setdefault((esc.bus, esc.node), []).append(k)


def _measure(one: _Measured, reports: _Reports, who: tuple[int, int], span: tuple[int, int | None]) -> None:
    """Take the reports of a node between two transfers."""
    every, (after, before) = reports.of, span
    for k in reports.places.get(who, ()):
        index, first, stop = every.escs[k].index, every.first.item(k), every.first.item(k + 1)
        if after >= 0:
            first += int(np.searchsorted(every.number[first:stop], after, "right"))
        if before is not None:
            stop = first + int(np.searchsorted(every.number[first:stop], before))
        if first >= stop:
            continue
        begin, one.last = every.t.item(first), every.t.item(stop - 1)
        one.indexes[index] += stop - first
        one.first = begin if one.first == NO_TIME else one.first
        one.periods.feed(reports.periods[first:stop])
        reports.apart[first] = begin - one.latest.get(index, begin)
        one.heard.feed(reports.apart[first:stop])
        one.latest[index] = one.last
        one.counted += reports.counted.item(stop) - reports.counted.item(first)
        one.skipped += reports.skipped.item(stop) - reports.skipped.item(first)


def _periods(view: View) -> Array:
    """Return the period of each ESCStatus, 0 if unknown; lost ones are counted by the transfer ID."""
    table, transfers = view.table("ESCStatus"), view.transfers
    if table is None:
        return np.empty(0, np.int64)
    row = table.row
    gap, step = transfers.gap[row].astype(np.int64), transfers.step[row].astype(np.int64)
    good = transfers.has("gap")[row] & transfers.has("step")[row] & (step > 0)
    return np.where(good, gap // np.maximum(step, 1), 0)


def _changes(table: DecodedTable) -> Iterator[int]:
    """Yield usable ParamGet, in order, without those that say the same rate as the node's one before in the batch."""
    rows = np.flatnonzero(usable(table))
    node, rate = sender(table, rows), table["esc_fdb_rate"][rows]
    order = np.argsort(node, kind="stable")
    node, rate = node[order], rate[order]
    same = (node[1:] == node[:-1]) & (rate[1:] == rate[:-1])
    yield from np.sort(rows[order[np.concatenate(([True], ~same))[: len(rows)]]]).tolist()


def _numbers(table: DecodedTable, rows: Array) -> list[int]:
    return [int(number) for number in table["transfer"][np.flatnonzero(rows)]]


def _judge(view: View, one: _Measured) -> Iterator[Occurrence]:
    """Yield a rate that is not as configured."""
    enough = one.periods.count and one.periods.count + 1 >= view.number("BUS-018", "min_transfers")
    if one.configured is None or one.configured == OPEN or one.place is None or not enough:
        return
    if one.last - one.first < view.number("BUS-018", "min_s") * SECOND:
        return
    escs = sum(count > max(one.indexes.values()) * _STRAY for count in one.indexes.values())
    measures = [(one.periods.below(0.5), escs)]
    if one.skipped > _SKIPS * one.counted and one.heard.count:
        # Lost, or never sent? What is as configured either way is right.
        measures.append((one.heard.below(0.5), 1))
    tolerance = view.number("BUS-018", "tolerance_pct") / 100 * one.configured
    if not any(_fits(one.configured, tolerance, period, escs, view.resolution) for period, escs in measures):
        period, escs = measures[-1]
        yield replace(one.place, values={"configured": one.configured, "measured": SECOND / period / escs})


def _fits(rate: int, tolerance: float, period: float, escs: int, coarse: int) -> bool:
    """Return whether a period may be that of so many ESCs at a rate; it is known no better than times are."""
    least, most = (SECOND / max(period + way * coarse, 1) / escs for way in (1, -1))
    return least - tolerance <= rate <= most + tolerance
