"""Quantiles: exact for few values, within the stated error for many, the same however the values come."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit.strategies import examples

from analyzer.stats.distribution import ERROR, EXACT, Distribution

SHARES = (0.0, 0.05, 0.5, 0.95, 0.99, 1.0)
NUMBERS = st.floats(-1e12, 1e12).map(lambda value: 0.0 if abs(value) < 1e-6 else value)


def told(one: Distribution) -> list[float | None]:
    return [one.count, one.mean, one.low, one.high, *(one.quantile(share) for share in SHARES)]


def of(*parts: list[float]) -> Distribution:
    one = Distribution()
    for part in parts:
        one.feed(np.array(part, np.float64))
    return one


@examples(50)
@given(st.lists(NUMBERS, min_size=1, max_size=40), st.integers(1, 60), st.data())
@example([0.1, 0.2, 0.3], 1, None)
def test_any_cut_gives_the_same(values: list[float], often: int, data: st.DataObject | None) -> None:
    values = values * often
    cuts = sorted(data.draw(st.lists(st.integers(0, len(values)), max_size=5))) if data else [1]
    parts = [values[a:b] for a, b in zip([0, *cuts], [*cuts, len(values)], strict=True)]
    assert told(of(*parts)) == told(of(values))


@pytest.mark.parametrize("count", [1, 2, EXACT])
def test_few_values_are_exact(count: int) -> None:
    values = np.random.default_rng(count).normal(0, 100, count)
    one = of(values.tolist())
    assert [one.quantile(share) for share in SHARES] == [float(np.quantile(values, share)) for share in SHARES]
    assert one.mean == pytest.approx(float(values.mean()), abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_many_values_are_within_the_error(seed: int) -> None:
    make = np.random.default_rng(seed)
    values = (make.normal(20, 30, 20_000), make.lognormal(0, 6, 20_000), -make.exponential(5, 20_000))[seed]
    one = of(values.tolist())
    for share in SHARES:
        nearest = float(np.quantile(values, share, method="lower"))
        assert one.quantile(share) == pytest.approx(nearest, rel=ERROR * 1.0001, abs=1e-9)
    assert (one.low, one.high, one.count) == (values.min(), values.max(), len(values))


def test_the_sum_is_not_rounded_on_the_way() -> None:
    values = [1e16, 1.0, -1e16, 0.1] * 500
    assert of(values).total == math.fsum(values)
    assert of(*([value] for value in values)).mean == math.fsum(values) / len(values)


def test_what_is_no_number_is_left_out() -> None:
    one = of([math.nan, 1.0, math.nan], [])
    assert told(one) == [1, 1.0, 1.0, 1.0, *[1.0] * len(SHARES)]
    assert told(of([math.nan]))[:2] == [0, None]
    one = of([math.inf, 1.0, -math.inf, math.nan])
    assert (one.high, one.low, one.count, one.left_out) == (1.0, 1.0, 1, 3)
