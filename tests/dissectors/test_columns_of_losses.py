"""Histograms of periods, stretches of malformed reports and lost packets in columns, and what they forget."""

from __future__ import annotations

import numpy as np
import pytest

from dissectors.tmotor.rules.bus.malformed import MalformedReports
from dissectors.tmotor.rules.joined.joins import ReportingEsc
from dissectors.tmotor.rules.joined.periods import PeriodHistogram


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_a_histogram_of_periods_knows_their_shares_to_a_thousandth(share: float) -> None:
    chance = np.random.default_rng(1)
    periods = chance.lognormal(16, 1, 5000).astype(np.int64)
    found = PeriodHistogram()
    for part in np.array_split(periods, 7):
        found.feed(part)
    found.feed(np.array([-5, 0]))
    assert found.count == len(periods)
    assert found.below(share) == pytest.approx(np.quantile(periods, share, method="inverted_cdf"), rel=2e-3)


def test_a_histogram_takes_periods_out_of_its_range_as_the_shortest_and_the_longest() -> None:
    found = PeriodHistogram()
    found.feed(np.array([1, 1 << 60]))
    assert found.below(0.5) == pytest.approx(1e3, rel=2e-3)
    assert found.below(1.0) == pytest.approx(1e11, rel=2e-3)


def test_the_oldest_stretches_of_a_node_become_one() -> None:
    reports, node = MalformedReports(), ReportingEsc(0, 5, 0)
    t = np.arange(2000) * 100
    for part in np.array_split(t, 3):
        reports._note_all(np.zeros(len(part), np.uint8), np.full(len(part), 5), part, part + 10, 20)
    without = reports.between(node, 0, 200_000)
    assert len(without) == 1025
    assert without[:3] == [(0, 0), (97_610, 97_700), (97_710, 97_800)]
    assert without[-1] == (199_910, 200_000)
