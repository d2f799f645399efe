"""How often rules are broken per flight hour: by firmware, and before and after a day."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.fleet.report.model import RuleRate, SinceThen, SoftwareUse, Worse
from analyzer.fleet.report.statistics import binomial_p, discoveries, rate_interval, seen_ratio

if TYPE_CHECKING:
    import duckdb

_FEWEST = 10  # flights of a firmware that is compared
_HUNDRED_HOURS = 100.0
# Of each firmware of ESCs the captures in which it flew; of each rule the captures in which an ESC broke it.
_VIEWS = """
create or replace temp view flown as select distinct c.key, c.vehicle, c.flights, c.flight_ns / 3.6e12 as hours,
    n.software from counted c join nodes n using (key, run) where n.software <> '' and c.flights > 0 and c.flight_ns > 0
    and exists (select 1 from esc_health h where h.key = c.key and h.run = c.run and h.bus = n.bus and h.node = n.node);
create or replace temp view broken as select distinct f.key, f.rule, f.title, n.software, c.vehicle, c.date,
    from counted c join findings f using (key, run) left join nodes n on n.key = f.key and n.run = f.run
    and n.bus = f.bus and n.node = f.node where f.severity <> 'note' and f.category <> 'capture' and not f.waived
    and c.flights > 0 and c.flight_ns > 0;
"""


def by_software(answers: duckdb.DuckDBPyConnection) -> tuple[list[SoftwareUse], list[RuleRate]]:
    """Return what firmware there is, and for each rule and firmware the rate, of those with enough flights."""
    answers.execute(_VIEWS)
    uses = [
        SoftwareUse(software, int(flights), float(hours), tuple(sorted(vehicles)))
        for software, flights, hours, vehicles in answers.execute(
            "select software, sum(flights), sum(hours), list(distinct vehicle) from flown group by 1 order by 1"
        ).fetchall()
    ]
    compared = [one for one in uses if one.flights >= _FEWEST]
    counts: dict[tuple[str, str], int] = {}
    rules: dict[str, str] = {}
    for rule, title, software, count in answers.execute(
        "select rule, min(title), software, count(distinct key) from broken "
        "where software is not null and software <> '' group by 1, 3 order by 1, 3"
    ).fetchall():
        counts[rule, software] = count
        rules[rule] = title
    rows = [
        (rule, one, counts.get((rule, one.software), 0), _rest(counts, compared, rule, one))
        for rule in sorted(rules)
        for one in compared
    ]
    chances = [
        binomial_p(count, count + rest, one.hours / (one.hours + hours)) for _, one, count, (rest, hours) in rows
    ]
    found = []
    for (rule, one, count, (rest, hours)), p, counts_ in zip(rows, chances, discoveries(chances), strict=True):
        low, high = rate_interval(count, one.hours / _HUNDRED_HOURS)
        more = hours > 0 and count / one.hours > rest / hours
        others = {vehicle for other in compared if other is not one for vehicle in other.vehicles}
        found.append(
            RuleRate(
                rule,
                rules[rule],
                one.software,
                count,
                count / one.hours * _HUNDRED_HOURS,
                low,
                high,
                p,
                differs=counts_ and more,
                separable=bool(others & set(one.vehicles)),
                only_on=one.vehicles,
            )
        )
    return uses, found


def _rest(
    counts: dict[tuple[str, str], int], compared: list[SoftwareUse], rule: str, one: SoftwareUse
) -> tuple[int, float]:
    """Return captures and flight hours of all other firmware."""
    others = [other for other in compared if other is not one]
    count = sum(counts.get((rule, other.software), 0) for other in others)
    return count, sum(other.hours for other in others)


def since_then(answers: duckdb.DuckDBPyConnection, since: str) -> SinceThen:
    """Return what is broken more often from a day on."""
    answers.execute(_VIEWS)
    ((before, after),) = answers.execute(
        "select coalesce(sum(flight_ns) filter (date < $1), 0) / 3.6e12, "
        "coalesce(sum(flight_ns) filter (date >= $1), 0) / 3.6e12 from counted",
        [since],
    ).fetchall()
    rows = answers.execute(
        "select rule, min(title), count(distinct key) filter (date < $1), count(distinct key) filter (date >= $1) "
        "from broken group by 1 order by 1",
        [since],
    ).fetchall()
    if not before or not after:
        return SinceThen(since, float(before), float(after))
    chances = [binomial_p(late, early + late, after / (before + after)) for _, _, early, late in rows]
    worse = tuple(
        Worse(rule, title, early / before * _HUNDRED_HOURS, late / after * _HUNDRED_HOURS, p)
        for (rule, title, early, late), p, counts in zip(rows, chances, discoveries(chances), strict=True)
        if counts and late / after > early / before
    )
    seen = {rule: seen_ratio(early, before, after) for rule, _, early, _ in rows if early}
    return SinceThen(since, float(before), float(after), worse, seen)
