"""Histograms of periods, stretches of malformed reports and lost packets in columns, and what they forget."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest

from dissectors.kit import TransferTable
from dissectors.kit.view import Settled
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


@pytest.mark.parametrize("waits", [False, True])
def test_the_oldest_stretches_of_a_node_become_one(waits: bool) -> None:
    reports, node = MalformedReports(20), ReportingEsc(0, 5, 0)
    t = np.arange(2000) * 100
    for part in np.array_split(t, 3):
        reports._note(np.zeros(len(part), np.uint8), np.full(len(part), 5), part, part + 10)
        if not waits:
            reports._stretch()
    without = reports.between(node, 0, 200_000)
    assert len(without) == 1025
    assert without[:3] == [(0, 0), (97_610, 97_700), (97_710, 97_800)]
    assert without[-1] == (199_910, 200_000)


@pytest.mark.parametrize("seed", range(8))
def test_stretches_of_many_nodes_are_those_of_each(seed: int) -> None:
    chance = np.random.default_rng(seed)
    reports, expected = MalformedReports(20), dict[tuple[int, int], list[list[int]]]()
    for turn in range(4):
        bus, node = chance.integers(0, 2, 50).astype(np.uint8), chance.integers(1, 4, 50)
        first = chance.integers(0, 3000, 50)
        last = first + chance.integers(0, 30, 50)
        reports._note(bus, node, first, last)
        for *who, since, until in zip(*(column.tolist() for column in (bus, node, first, last)), strict=True):
            known = expected.setdefault((who[0], who[1]), [])
            if known and known[-1][0] <= since <= known[-1][1] + 20:
                known[-1][1] = max(known[-1][1], until)
            else:
                known.append([since, until])
        if turn % 2:  # what waits is told, too
            for (place, src), stretches in expected.items():
                parts = reports.between(ReportingEsc(place, src, 0), 0, 4000)
                silent = {t for begin, end in parts for t in range(begin, end)}
                assert silent == {t for t in range(4000) if not any(since <= t < until for since, until in stretches)}
    reports._stretch()
    found = {
        (node >> 7, node & 0x7F): [list(one) for one in zip(*known, strict=True)]
        for node, known in reports._stretches.items()
    }
    assert found == expected
    assert list(found) == list(expected)


@pytest.mark.parametrize("seed", range(8))
def test_lost_reports_are_counted_up_to_each_transfer(seed: int) -> None:
    chance, type_id, count = np.random.default_rng(seed), 1034, 80
    reports, lost = MalformedReports(20), dict[tuple[int, int], int]()
    for _ in range(3):
        t = pa.array(np.arange(count), pa.timestamp("ns"))
        steps = pa.array(chance.integers(0, 5, count).astype(np.uint8), mask=chance.random(count) < 0.2)
        columns: dict[str, Any] = {
            "t": t, "t_end": t, "bus": chance.integers(0, 2, count).astype(np.uint8),
            "src": chance.integers(1, 4, count).astype(np.uint8), "kind": np.zeros(count, np.uint8),
            "type_id": (type_id + (chance.random(count) < 0.1)).astype(np.uint16), "step": steps,
        }  # fmt: skip
        view = SimpleNamespace(
            transfers=TransferTable(pa.record_batch(columns)), frames=SimpleNamespace(verdict=np.zeros(0)),
            settled=Settled(*(np.zeros(0, np.int64) for _ in range(2)), *(np.zeros(0, bool) for _ in range(7))),
            definition=lambda _: SimpleNamespace(type_id=type_id), table=lambda _: None,
        )  # fmt: skip
        reports.feed(cast("Any", view))
        expected: dict[tuple[int, int], list[int]] = {(bus, src): [] for bus in range(3) for src in range(5)}
        rows = zip(columns["bus"], columns["src"], columns["type_id"], steps.to_pylist(), strict=True)
        for bus, src, kind, step in rows:
            if kind == type_id and step:
                lost[bus, src] = lost.get((bus, src), 0) + max(step - 1, 0)
            for who, counts in expected.items():
                counts.append(lost.get(who, 0))
        size = np.full(len(expected), count)
        found = reports.lost(*zip(*expected, strict=True), size, np.tile(np.arange(count), len(expected)))
        assert found.tolist() == [one for counts in expected.values() for one in counts]
