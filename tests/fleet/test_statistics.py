"""Intervals and tests against values of tables and of exact formulas."""

from __future__ import annotations

import random

import numpy as np
import pytest

from analyzer.fleet.report.statistics import (
    binomial_p,
    discoveries,
    dispersed_p,
    dispersion,
    level_p,
    rate_interval,
    seen_ratio,
    stratified_p,
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


def test_a_level_is_told_from_noise() -> None:
    chance = np.random.default_rng(1)
    noise = chance.normal(0, 1, 40)
    assert level_p(noise[:5], noise[5:], 1.0) > 0.01 > level_p(noise[:5] + 4, noise[5:], 1.0)
    every = [level_p(*np.split(chance.normal(0, 1, 25), [5]), 1.0) for _ in range(4000)]
    assert sum(p < 0.01 for p in every) < 60


def test_sums_of_counts_with_chances_of_their_own() -> None:
    assert stratified_p([(8, 10, 0.5)]) == pytest.approx(binomial_p(8, 10, 0.5))
    assert stratified_p([(4, 5, 0.5), (4, 5, 0.5)]) == pytest.approx(binomial_p(8, 10, 0.5))
    assert stratified_p([(9, 9, 0.9), (1, 9, 0.1)]) > 0.5  # as many as each of them has by chance
    assert stratified_p([(5, 5, 1.0)]) == stratified_p([]) == 1.0
    many = [(2520, 5000, 0.5)]
    assert stratified_p(many) == pytest.approx(binomial_p(*many[0]), rel=0.01)


def test_counts_that_one_vehicle_has_say_less() -> None:
    even, uneven = [[(5, 1.0)] * 10, [(1, 1.0)] * 10], [[(50, 1.0), *[(0, 1.0)] * 9], [(1, 1.0)] * 10]
    assert dispersion(even) == 1.0
    assert dispersion(uneven) > 10
    assert dispersion([[(3, 1.0)], [(9, 1.0)]]) == 1.0  # nothing to tell it by
    p = binomial_p(50, 60, 0.5)
    assert dispersed_p(p, 1.0) == pytest.approx(p)
    assert dispersed_p(p, dispersion(uneven)) > 0.05


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_the_turn_is_where_it_is(slope: float) -> None:
    at = np.arange(40)
    values = np.where(at >= 25, slope * (at - 24) if slope else 8.0, 0.0) + np.random.default_rng(2).normal(0, 0.3, 40)
    assert abs(turning_point(values) - 25) <= 1


def test_what_would_have_been_seen() -> None:
    assert seen_ratio(1000, 100, 100) == 1.25
    assert seen_ratio(0, 100, 100) is None
    assert seen_ratio(1, 100, 1) is None
