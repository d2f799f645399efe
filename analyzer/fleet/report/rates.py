"""How often rules are broken per flight hour: by firmware, and before and after a day."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.fleet.report.model import RuleRate, SinceThen, SoftwareUse, Worse
from analyzer.fleet.report.statistics import (
    binomial_p,
    discoveries,
    dispersed_p,
    dispersion,
    rate_interval,
    seen_ratio,
    stratified_p,
)

if TYPE_CHECKING:
    import duckdb

FEWEST = 10  # flights of a firmware that is compared
_HUNDRED_HOURS = 100.0
# Of each firmware of ESCs the captures in which it flew; of each rule the captures in which an ESC broke it.
_VIEWS = """
create or replace temp view flown as select distinct c.key, c.vehicle, c.flights, c.flight_ns / 3.6e12 as hours,
    n.software from counted c join nodes n using (key, run) where n.software <> '' and c.flights > 0 and c.flight_ns > 0
    and exists (select 1 from esc_health h where h.key = c.key and h.run = c.run and h.bus = n.bus and h.node = n.node);
create or replace temp view broken as select distinct f.key, f.rule, f.title, n.software, c.vehicle, c.date
    from counted c join findings f using (key, run) left join nodes n on n.key = f.key and n.run = f.run
    and n.bus = f.bus and n.node = f.node where f.severity <> 'note' and f.category <> 'capture' and not f.waived
    and c.flights > 0 and c.flight_ns > 0;
"""


def by_software(answers: duckdb.DuckDBPyConnection) -> tuple[list[SoftwareUse], list[RuleRate]]:
    """Return what firmware there is, and for each rule and firmware the rate, of those with enough flights."""
    answers.execute(_VIEWS)
    uses, hours = [], {}
    for software, flights, some in answers.execute(
        "select software, sum(flights)::bigint, map_from_entries(list((vehicle, hours) order by vehicle)) from "
        "(select software, vehicle, sum(flights) as flights, sum(hours) as hours from flown group by 1, 2) "
        "group by 1 order by 1"
    ).fetchall():
        uses.append(SoftwareUse(software, flights, sum(some.values()), tuple(some)))
        hours[software] = some
    compared = [one for one in uses if one.flights >= FEWEST]
    broken: dict[str, _Broken] = {}
    for rule, title, software, vehicle, count in answers.execute(
        "select rule, min(title), software, vehicle, count(distinct key) from broken "
        "where software is not null and software <> '' group by 1, 3, 4 order by 1, 3, 4"
    ).fetchall():
        if any(one.software == software for one in compared):
            broken.setdefault(rule, _Broken(title, {})).counts[software, vehicle] = count
    tests = [
        (rule, one, *_compared(broken[rule].counts, one, compared, hours))
        for rule in sorted(broken)
        for one in compared
    ]
    found = []
    for (rule, one, count, rest, by, p), counts in zip(tests, discoveries([test[-1] for test in tests]), strict=True):
        low, high = rate_interval(count / by, one.hours / _HUNDRED_HOURS / by)
        others = {vehicle for other in compared if other is not one for vehicle in other.vehicles}
        found.append(RuleRate(
            rule=rule, title=broken[rule].title, software=one.software, captures=count,
            rate=count / one.hours * _HUNDRED_HOURS, low=low, high=high, p=p,
            differs=counts and count / one.hours > rest, separable=bool(others & set(one.vehicles)),
            only_on=one.vehicles,
        ))  # fmt: skip
    return uses, found


class _Broken(NamedTuple):
    """A rule, and how many captures break it by firmware and vehicle."""

    title: str
    counts: dict[tuple[str, str], int]


def _compared(
    counts: dict[tuple[str, str], int],
    one: SoftwareUse,
    compared: list[SoftwareUse],
    hours: dict[str, dict[str, float]],
) -> tuple[int, float, float, float]:
    """Return captures of a firmware, the rate of all others, by how much vehicles differ beyond chance, and p."""
    groups = [
        [(counts.get((each.software, vehicle), 0), some) for vehicle, some in hours[each.software].items()]
        for each in compared
    ]
    by = dispersion(groups)
    totals = [sum(count for count, _ in group) for group in groups]
    mine, rest = totals[compared.index(one)], sum(totals) - totals[compared.index(one)]
    other = sum(each.hours for each in compared) - one.hours
    if not other:
        return mine, 0.0, by, 1.0
    p = binomial_p(mine, mine + rest, one.hours / (one.hours + other))
    return mine, rest / other, by, dispersed_p(p, by)


def since_then(answers: duckdb.DuckDBPyConnection, since: str) -> SinceThen:
    """Return what is broken more often from a day on, by the vehicles that flew before and after it."""
    answers.execute(_VIEWS)
    hours = {
        vehicle: (before, after)
        for vehicle, before, after in answers.execute(
            "select vehicle, coalesce(sum(flight_ns) filter (date < $1), 0) / 3.6e12, "
            "coalesce(sum(flight_ns) filter (date >= $1), 0) / 3.6e12 from counted group by 1",
            [since],
        ).fetchall()
    }
    before, after = (sum(one[place] for one in hours.values()) for place in (0, 1))
    hours = {vehicle: both for vehicle, both in hours.items() if all(both)}
    early_hours, late_hours = (sum(one[place] for one in hours.values()) for place in (0, 1))
    if not hours:
        return SinceThen(since, before, after)
    rules: dict[str, list[tuple[int, int, float]]] = {}
    titles: dict[str, str] = {}
    for rule, title, vehicle, early, late in answers.execute(
        "select rule, min(title), vehicle, count(distinct key) filter (date < $1), "
        "count(distinct key) filter (date >= $1) from broken group by 1, 3 order by 1, 3",
        [since],
    ).fetchall():
        if vehicle in hours:
            first, last = hours[vehicle]
            rules.setdefault(rule, []).append((late, early + late, last / (first + last)))
            titles[rule] = title
    chances = [stratified_p(counts) for counts in rules.values()]
    worse, seen = [], {}
    for (rule, counts), p, known in zip(rules.items(), chances, discoveries(chances), strict=True):
        late, every = sum(one[0] for one in counts), sum(one[1] for one in counts)
        if known and late > sum(of * part for _, of, part in counts):
            rates = ((every - late) / early_hours * _HUNDRED_HOURS, late / late_hours * _HUNDRED_HOURS)
            worse.append(Worse(rule, titles[rule], *rates, p))
        if every > late:
            seen[rule] = seen_ratio(every - late, early_hours, late_hours)
    return SinceThen(since, before, after, tuple(worse), seen, vehicles=len(hours))
