"""The health of ESCs in figures: per flight, the same however a capture is cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit.fleet import flight

from analyzer.flight.flights import FlightFinder
from analyzer.flight.health import HealthFinder

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.flight.health import EscHealth
    from dissectors import Registry

    Told = Callable[..., list[EscHealth]]


@pytest.fixture
def health(decode: Callable[..., Any], registry: Registry) -> Told:
    """Gives the figures of a text, or of its pieces."""

    def run(*chunks: bytes) -> list[EscHealth]:
        finder, flights = HealthFinder(registry), FlightFinder(registry)
        for batch in decode(*chunks).batches:
            finder.feed(batch)
            flights.feed(batch)
        return finder.health(flights.flights())

    return run


def test_figures_of_each_flight(health: Told) -> None:
    text = flight(4, 60, 20, lambda esc, t: {"current": 0.3 * (esc == 1 and t > 30)}, rests=[(30, 35)])
    rows = health(text)
    assert [(row.flight, row.ch) for row in rows] == [(number, ch) for number in (1, 2) for ch in (1, 2, 3, 4)]
    for row in rows:
        assert row.running_s == pytest.approx(29 if row.flight == 1 else 25, abs=0.3)
        assert row.reports == pytest.approx(20 * row.running_s, abs=3)
        assert row.speed_per_command == pytest.approx(1.05 * 48.3, rel=0.02)
        assert row.power_per_speed3 == pytest.approx(34 * (1.3 if (row.flight, row.ch) == (2, 2) else 1), rel=0.03)
        assert row.gap_p99_ms == pytest.approx(50, abs=1)
        assert row.lost == 0
        assert None not in {row.current_median, row.temperature_max, row.voltage_min, row.current_per_speed2}
    odd = rows[5]
    assert (odd.z_current or 0) > 5
    assert all(abs(row.z_current or 0) < 4 for row in rows if row is not odd)
    assert set(odd.plain()) >= {"flight", "node", "current_p95", "speed_per_command", "z_current"}


def test_any_cut_gives_the_same(health: Told) -> None:
    text = flight(3, 20, 30, lambda _, __: {"lost": 0.05}, rests=[(9, 12)])
    pieces = [text[k : k + 40_001] for k in range(0, len(text), 40_001)]
    whole = health(text)
    assert health(*pieces) == whole
    assert all(0 < row.lost < 40 for row in whole)


def test_what_is_not_measured_is_none(health: Told) -> None:
    (row, *_) = health(flight(3, 12, without=["temperature", "current"]))
    assert (row.temperature_median, row.temperature_max, row.current_p95, row.current_per_speed2) == (None,) * 4
    assert (row.z_current, row.z_temperature) == (None, None)
    assert row.speed_median
