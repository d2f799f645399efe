"""The odd ESC: against its own past, against the others, and what is no oddity."""

from __future__ import annotations

import json
from functools import cache
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.fleet import START, flight
from kit.simulated import simulation, text_of
from kit.strategies import examples

import analyzer
from analyzer.flight.flights import FlightFinder
from analyzer.flight.odd.finder import OddFinder
from analyzer.flight.odd.layers import layers
from analyzer.flight.reading import FlightReading
from analyzer.report.triage.json import plain, schema
from analyzer.report.triage.text import render

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer.flight.odd.judge import OddReport
    from dissectors import Registry

    Judged = Callable[..., OddReport]

CURRENT, SPEED = "current at equal speed", "speed per command"


@pytest.fixture
def judged(decode: Callable[..., Any], registry: Registry) -> Judged:
    """Gives what is odd in a text, or in its pieces."""

    def run(*chunks: bytes) -> OddReport:
        reading = FlightReading(registry)
        odd, flights = OddFinder(reading.clock, reading.escs), FlightFinder(registry, reading.order)
        for batch in decode(*chunks).batches:
            reading.feed(batch)
            odd.feed()
            flights.feed(batch)
        return odd.found(flights.flights())

    return run


def told(found: OddReport) -> list[tuple[int | None, str, str]]:
    return [(one.ch, one.quantity, one.against) for one in found.odd]


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("escs", "hz", "seconds"), [(4, 1, 160), (6, 10, 60), (8, 50, 24)])
def test_one_takes_more_current_than_before(escs: int, hz: float, seconds: float, judged: Judged) -> None:
    half = seconds / 2
    found = judged(flight(escs, seconds, hz, lambda esc, t: {"current": 0.1} if esc == 1 and t > half else {}))
    (one,) = found.odd
    assert told(found) == [(2, CURRENT, "own past")]
    assert one.difference == pytest.approx(10, abs=2.5)
    assert (one.since - START) / 1e9 == pytest.approx(half, abs=4 if hz > 1 else 12)
    assert one.gist.endswith("more current than before")


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("escs", "hz", "seconds"), [(4, 1, 160), (6, 10, 60), (8, 50, 24)])
@pytest.mark.parametrize("seed", [2, 3])
def test_equal_ones_are_never_odd(escs: int, hz: float, seconds: float, seed: int, judged: Judged) -> None:
    found = judged(flight(escs, seconds, hz, seed=seed))
    assert (found.odd, found.facts) == ([], [])
    assert len(found.compared) == escs


@pytest.mark.slow
def test_one_that_ages_in_a_long_flight(judged: Judged) -> None:
    found = judged(flight(seconds=300, hz=5, odd=lambda esc, t: {"current": 0.12 * t / 300} if esc == 2 else {}))
    (one,) = found.odd
    assert told(found) == [(3, CURRENT, "own past")]
    assert 6 < one.difference < 12


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("what", "size", "quantity"), [
    ("speed", -0.04, SPEED), ("degrees", 15, "temperature at equal power"), ("volts", -0.02, "supply voltage"),
])  # fmt: skip
def test_other_quantities(what: str, size: float, quantity: str, judged: Judged) -> None:
    found = judged(flight(seconds=90, odd=lambda esc, t: {what: size} if esc == 3 and t > 45 else {}))
    assert (4, quantity, "own past") in told(found)
    assert {one.ch for one in found.odd} == {4}
    assert all(one.difference * size > 0 for one in found.odd if one.quantity == quantity)


@pytest.mark.slow
def test_reports_that_get_lost(judged: Judged) -> None:
    found = judged(flight(seconds=60, hz=30, odd=lambda esc, t: {"lost": 0.1} if esc == 0 and t > 30 else {}))
    assert told(found) == [(1, "lost reports", "own past")]
    assert judged(flight(seconds=60, hz=30, odd=lambda _, __: {"lost": 0.1})).odd == []


def test_different_from_the_start_is_a_fact(judged: Judged) -> None:
    found = judged(flight(seconds=40, odd=lambda esc, _: {"current": 0.16} if esc == 1 else {}))
    (one,) = found.odd
    assert told(found) == [(2, CURRENT, "peers")]
    assert one.always
    assert one.gist.endswith("than the others, always so")


@pytest.mark.slow
def test_a_coaxial_vehicle(judged: Judged) -> None:
    """Lower motors take more: that is said of all of them together, and one that changes is seen all the same."""
    calm = judged(flight(8, 40, odd=lambda esc, _: {"current": 0.12} if esc > 3 else {}))
    assert calm.odd == []
    (fact,) = calm.facts
    assert fact.startswith("ch5, ch6, ch7, ch8: ")
    assert fact.endswith("a fact of the vehicle, no cause")
    odd = judged(flight(8, 60, odd=lambda esc, t: {"current": 0.12 + 0.1 * (esc == 5 and t > 30)} if esc > 3 else {}))
    assert told(odd) == [(6, CURRENT, "own past")]
    assert odd.facts


@pytest.mark.slow
def test_two_packs(judged: Judged) -> None:
    """They are told from voltages, also if one of them falls faster; a plug that gets worse is seen in its pack."""
    packs = judged(flight(8, 40, odd=lambda esc, t: {"volts": -(0.015 + 0.0002 * t) * (esc % 2)}))
    assert packs.odd == []
    assert packs.facts[0].startswith("ch1, ch3, ch5, ch7 share a supply: ")
    worse = judged(flight(8, 60, odd=lambda esc, t: {"volts": -0.015 * (esc % 2) - 0.02 * (esc == 3 and t > 30)}))
    assert told(worse) == [(4, "supply voltage", "own past")]


def test_an_earlier_flight_is_the_past(judged: Judged) -> None:
    found = judged(flight(seconds=80, rests=[(40, 46)], odd=lambda esc, t: {"current": 0.06 * (esc == 3 and t > 43)}))
    (one,) = found.odd
    assert one.gist.endswith("more current than its own flight 1")
    assert (one.since - START) / 1e9 == pytest.approx(46, abs=0.3)


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("without", "left"), [
    ("voltage", {CURRENT, SPEED}), ("current", {SPEED}), ("temperature", {CURRENT, SPEED}),
    ("power_rating_pct", {CURRENT, SPEED}), ("rpm", set()),
])  # fmt: skip
def test_what_is_not_measured_is_not_compared(without: str, left: set[str], judged: Judged) -> None:
    odd = {"current": 0.1, "speed": -0.05}
    found = judged(flight(seconds=60, without=[without], odd=lambda esc, t: odd if esc == 1 and t > 30 else {}))
    assert {one.quantity for one in found.odd} == left
    assert {one.ch for one in found.odd} <= {2}


def test_one_or_two_alone_are_compared_with_their_past(judged: Judged) -> None:
    found = judged(flight(1, 60, odd=lambda _, t: {"current": 0.12 * (t > 30)}))
    assert told(found) == [(1, CURRENT, "own past")]
    assert judged(flight(2, 60)).odd == []


def test_too_short_to_compare(judged: Judged) -> None:
    assert judged(flight(seconds=5, odd=lambda esc, _: {"current": 0.5 * (esc == 1)})).odd == []


@cache
def _ageing() -> bytes:
    return flight(4, 30, 20, lambda esc, t: {"current": 0.1 * (esc == 2 and t > 15), "lost": 0.02})


@pytest.mark.slow
@given(st.lists(st.integers(0, 1 << 20), max_size=6))
@examples(10)
def test_any_cut_gives_the_same(judged: Judged, places: list[int]) -> None:
    text = _ageing()
    cuts = sorted({place % len(text) for place in places})
    pieces = [text[a:b] for a, b in zip([0, *cuts], [*cuts, len(text)], strict=True)]
    whole = judged(text)
    assert told(whole) == [(3, CURRENT, "own past")]
    assert judged(*pieces) == whole


@pytest.mark.sampled(30)
@pytest.mark.parametrize("seed", range(1, 61))
def test_healthy_flights_of_the_simulator(seed: int, judged: Judged) -> None:
    plan = ("hover", "mission")[seed % 2]
    made = simulation(24, flight=plan, seed=seed, escs=(4, 6, 8)[seed % 3], rate=(5, 10, 30, 50, 1)[seed % 5])
    assert judged(text_of(made, made.frames()).encode()).odd == []


def test_two_groups_or_one() -> None:
    numpy = pytest.importorskip("numpy")
    level = numpy.array([0.0, 0.1, 12.0, 12.2, 0.05, 12.1])
    assert layers(level, 5, 1).tolist() == [False, False, True, True, False, True]
    assert not layers(numpy.array([0.0, 0.1, 12.0, 0.05]), 5, 1).any()
    assert not layers(numpy.array([0.0, 3, 6, 9, 12, 15]), 2, 1).any()


@pytest.mark.parametrize("level", [
    [-6.6, -4.3, -4.3, -4.2, 8.3, 9.0, 5.8, 4.4], [-7.5, -2.6, -5.9, -4.4, 11.8, 2.6, 3.6, 8.6],
    [-5.5, 10.7, -5.1, 3.0, -6.3, 8.4, -2.1, 5.4],
])  # fmt: skip
def test_noisy_loads_hide_no_layer_that_a_vehicle_is_built_of(level: list[float]) -> None:
    """The first two are what coaxial flights of the simulator have, the third has every other motor below."""
    numpy = pytest.importorskip("numpy")
    found = layers(numpy.array(level), 5, 2, range(1, 9))
    assert found.tolist() == [one > 0 for one in level]


def test_nor_do_they_make_one() -> None:
    """Motors whose load is as noisy, one in eight too high, halves that are no halves, and the weight aft."""
    numpy = pytest.importorskip("numpy")
    dice = numpy.random.default_rng(5)
    drawn = [layers(row, 5, 2, range(1, 9)).any() for row in dice.normal(0, 2.5, (2000, 8))]
    assert sum(drawn) < 10
    for level in ([0, 1, -1, 2, 0, -2, 1, 14.0], [-7.5, 2.6, -5.9, -4.4, 11.8, -2.6, 3.6, 8.6],
                  [-2.8, 3.3, 3.2, 1.2, 0.1, 0.4, -3.4, -3.6]):  # fmt: skip
        assert not layers(numpy.array(level), 5, 2, range(1, 9)).any()
    assert not layers(numpy.array([-7.5, -2.6, -5.9, -4.4, 11.8, 2.6, 3.6, 8.6]), 5, 2, [None] * 8).any()


def test_triage_tells_it(tmp_path: Path) -> None:
    path = tmp_path / "ages.log"
    path.write_bytes(_ageing())
    found = analyzer.triage(path)
    said = json.loads(json.dumps(plain(found)))
    jsonschema.validate(said, schema())
    (one,) = said["odd"]
    assert (one["bus"], one["node"], one["ch"], one["against"]) == ("can0", 13, 3, "own past")
    (line,) = [line for line in render(found).splitlines() if line.startswith("Notes")]
    assert " ".join(line.split()).startswith("Notes ch3 ")
    assert " ".join(line.split()).endswith(" % more current than before tailbyte stats odd")
    assert len(line) <= 80


def test_statistics(tmp_path: Path, command: Callable[..., Any]) -> None:
    path = tmp_path / "ages.log"
    path.write_bytes(_ageing())
    text = command("stats", "odd", str(path))[1]
    assert "! ch3 node 13  1" in text
    assert max(map(len, text.splitlines())) <= 80
    found = json.loads(command("stats", "odd", str(path), "-T", "json")[1])["statistics"]
    assert [row["ch"] for row in found["odd"]["rows"]] == ["3"]
    assert [row["odd"] for row in found["odd_compared"]["rows"]] == ["", "", "odd", ""]
    assert command("stats", "odd", str(path), "-T", "csv", "-Y", "ch == 1")[1].count("\n") == 1
    assert "own past" not in command("stats", "odd", str(path), "-T", "csv", "--from", "16")[1]
    assert "ch3" in command("decode", "-q", "-z", "odd", str(path))[1]
    marked = [line for line in command("stats", "nodes", str(path))[1].splitlines() if line.endswith("odd")]
    assert [line.split()[0] for line in marked if line.startswith("13")] == ["13"]
