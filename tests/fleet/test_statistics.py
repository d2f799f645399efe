"""Intervals and tests against values of tables and of exact formulas."""

from __future__ import annotations

import random

import numpy as np
import pytest

from analyzer.fleet.report.statistics import (
    binomial_p,
    discoveries,
    rate_interval,
    seen_ratio,
    trend_p,
    turning_point,
)


@pytest.mark.parametrize(
    ("count", "low", "high"), [(0, 0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.39), (100, 81.36, 121.6)]
)
def test_a_rate_has_the_exact_interval_of_poisson(count: int, low: float, high: float) -> None:
    assert rate_interval(count, 1.0) == pytest.approx((low, high), rel=0.03, abs=0.03)


def test_a_rate_is_per_exposure() -> None:
    assert rate_interval(10, 5.0) == tuple(one / 5 for one in rate_interval(10, 1.0))


@pytest.mark.parametrize(
    ("count", "of", "part", "p"), [(5, 10, 0.5, 1.0), (0, 10, 0.5, 2 / 1024), (10, 10, 0.5, 2 / 1024)]
)
def test_a_binomial_test_is_exact(count: int, of: int, part: float, p: float) -> None:
    assert binomial_p(count, of, part) == pytest.approx(p)


def test_a_binomial_test_of_nothing_says_nothing() -> None:
    assert binomial_p(0, 0, 0.5) == binomial_p(0, 10, 0.0) == 1.0


def test_thousands_of_tests_of_chance_find_next_to_nothing() -> None:
    chance = random.Random(1)
    assert sum(discoveries([chance.random() for _ in range(10_000)])) == 0
    assert discoveries([1e-9, 0.5, 0.9]) == [True, False, False]
    assert discoveries([]) == []


def test_a_trend_is_told_from_noise() -> None:
    chance = np.random.default_rng(1)
    noise = chance.normal(0, 1, 40)
    assert trend_p(noise) > 0.01 > trend_p(noise + np.arange(40) * 0.2)
    assert trend_p(np.zeros(40)) == 1.0


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_the_turn_is_where_it_is(slope: float) -> None:
    at = np.arange(40)
    values = np.where(at >= 25, slope * (at - 24) if slope else 8.0, 0.0) + np.random.default_rng(2).normal(0, 0.3, 40)
    assert abs(turning_point(values) - 25) <= 1


def test_what_would_have_been_seen() -> None:
    assert seen_ratio(1000, 100, 100) == 1.25
    assert seen_ratio(0, 100, 100) is None
    assert seen_ratio(1, 100, 1) is None
