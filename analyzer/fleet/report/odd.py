"""ESCs that are odd: against their own past first, then against others with the same firmware."""

from __future__ import annotations

from itertools import groupby
from math import sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.fleet.report.model import EscOutlier
from analyzer.fleet.report.statistics import (
    discoveries,
    level_p,
    normal_p,
    spread,
    turning_point,
)
from analyzer.fleet.rows import day

if TYPE_CHECKING:
    from collections.abc import Iterator

    import duckdb

    from dissectors.kit import Array


class ComparedQuantity(NamedTuple):
    """Compared: a difference in units, or a `share` of the others' value; `least` is what matters to people."""

    column: str
    what: str
    share: bool
    least: float


# Least differences: sensors of one kind differ by 2 to 3 K, propellers and motors of one kind by some percent.
QUANTITIES = (
    ComparedQuantity("temperature_median", "temperature", share=False, least=4.0),
    ComparedQuantity("current_per_krpm2", "current/(1000 rpm)^2", share=True, least=0.05),
    ComparedQuantity("rpm_per_percent", "speed per percent", share=True, least=0.03),
)
_FEWEST_ESCS = 8  # of a firmware, among which one may be odd
_SIGMAS = 4.0  # of an ESC's flights: less is what flights differ by
_STRONG = 6.0
_LASTING = 0.75  # of the flights that say how it is now: a few odd ones at the right place are no change
_BEFORE = 2  # flights at least that say how it was
_NOW = 5  # flights that say how it is now, or a fifth if that is more


class FlightSeries(NamedTuple):
    """The differences of an ESC in its flights, in order."""

    vehicle: str
    ch: int | None
    node: int
    software: str
    days: list[str]
    values: Array


def odd_escs(answers: duckdb.DuckDBPyConnection, least: int) -> tuple[list[EscOutlier], int]:
    """Return those that are odd, the worst first, and how many series were tested; `least` flights each.

    Raises `ValueError` for so few of them that now and then would be the same flights.
    """
    if least < _BEFORE + _NOW:
        raise ValueError(f"--flights {least}: at least {_BEFORE + _NOW}, to tell how an ESC is from how it was")
    found: list[EscOutlier] = []
    tested = 0
    for quantity in QUANTITIES:
        series = [one for one in _series(answers, quantity) if len(one.values) >= least]
        tested += len(series)
        if series:
            changed = _changed(series, quantity)
            known = {(one.vehicle, one.ch, one.node) for one in changed}
            found += changed
            found += [one for one in _unlike(series, quantity) if (one.vehicle, one.ch, one.node) not in known]
    return sorted(found, key=lambda one: (-abs(one.difference - one.fleet) / one.spread, one.vehicle)), tested


def _series(answers: duckdb.DuckDBPyConnection, quantity: ComparedQuantity) -> Iterator[FlightSeries]:
    column = f"h.{quantity.column}"
    others = f"{column}_others"
    difference = f"{column} / {others} - 1" if quantity.share else f"{column} - {others}"
    rows = answers.execute(
        f"select c.vehicle, h.ch, h.node, max(h.software), h.t_ns, avg({difference}) "  # noqa: S608 - our names
        "from esc_health h join counted c using (key, run) "
        f"where {column} is not null and {others} is not null and {others} <> 0 and c.vehicle <> '' "
        "group by c.vehicle, h.ch, h.node, h.t_ns, c.url, h.flight order by c.vehicle, h.ch, h.node, h.t_ns, c.url"
    ).fetchall()
    # An ESC on two buses, one as the other's reserve, flies once.
    for (vehicle, ch, node), group in groupby(rows, key=lambda row: row[:3]):
        some: list[Any] = list(group)
        yield FlightSeries(
            vehicle, ch, node, some[-1][3], [day(row[4]) for row in some], np.array([row[5] for row in some])
        )


def _changed(series: list[FlightSeries], quantity: ComparedQuantity) -> list[EscOutlier]:
    """Return those that are not as they were, among all that were tested."""
    usual = _noise(series, quantity)
    parts = [_now_and_past(one.values) for one in series]
    noises = [max(usual, _own_noise(one.values)) for one in series]
    chances = [level_p(now, past, noise) for (now, past), noise in zip(parts, noises, strict=True)]
    found = []
    for one, (now, past), noise, p, counts in zip(series, parts, noises, chances, discoveries(chances), strict=True):
        level, before = float(np.median(now)), float(np.median(past))
        change = abs(level - before)
        lasting = np.mean((now - before) * np.sign(level - before) > change / 2) >= _LASTING
        if counts and lasting and change >= quantity.least and change >= _SIGMAS * noise:
            since = one.days[turning_point(one.values)]
            strong = change >= _STRONG * noise and p < 1e-4
            found.append(_odd(one, quantity, level, (before, noise), p, since, "own past", strong=strong))
    return found


def _now_and_past(values: Array) -> tuple[Array, Array]:
    """Return the flights that say how it is, and how it was."""
    return values[-max(_NOW, len(values) // 5) :], values[: max(_BEFORE, len(values) // 3)]


def _unlike(series: list[FlightSeries], quantity: ComparedQuantity) -> list[EscOutlier]:
    """Return those that are unlike others with their firmware; they may have been so from the start."""
    found, tests = [], []
    for software in sorted({one.software for one in series}):
        group = [one for one in series if one.software == software]
        if len(group) < _FEWEST_ESCS:
            continue
        usual = np.array([np.median(one.values) for one in group])
        middle, width = float(np.median(usual)), max(spread(usual), quantity.least / _SIGMAS)
        tests += [(one, float(value), middle, width) for one, value in zip(group, usual, strict=True)]
    chances = [normal_p((value - middle) / width) for _, value, middle, width in tests]
    for (one, value, middle, width), p, counts in zip(tests, chances, discoveries(chances), strict=True):
        off = abs(value - middle)
        if counts and off >= quantity.least:
            strong = off >= _STRONG * width
            found.append(_odd(one, quantity, value, (middle, width), p, "", "same firmware", strong=strong))
    return found


def _noise(series: list[FlightSeries], quantity: ComparedQuantity) -> float:
    """Return by how much flights of any one ESC differ."""
    return max(float(np.median([_own_noise(one.values) for one in series])), quantity.least / 8)


def _own_noise(values: Array) -> float:
    """Return by how much flights differ: from one to the next, so that what changes slowly is not in it."""
    return spread(np.diff(values)) / sqrt(2)


def _odd(
    one: FlightSeries, quantity: ComparedQuantity, value: float, usual: tuple[float, float], p: float, since: str,
    against: str, *, strong: bool,
) -> EscOutlier:  # fmt: skip
    return EscOutlier(
        vehicle=one.vehicle, ch=one.ch, node=one.node, quantity=quantity.column, what=quantity.what,
        share=quantity.share, difference=value, fleet=usual[0], spread=usual[1], flights=len(one.values), since=since,
        against=against, support="strong" if strong else "weak", p=p,
        points=tuple(zip(one.days, map(float, one.values), strict=True)),
    )  # fmt: skip
