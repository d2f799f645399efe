"""All kinds of trouble that can be the beginning: a new one is a function here, a page in `pages.toml`, and a test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.verdict.addresses import address_troubles
from analyzer.flight.verdict.escs import esc_troubles
from analyzer.flight.verdict.supplies import supply_troubles
from analyzer.flight.verdict.vehicle import bus_troubles, command_troubles, device_troubles, thrust_troubles

if TYPE_CHECKING:
    from analyzer.flight.verdict.case import FlightCase
    from analyzer.flight.verdict.trouble import Trouble

_ALL = (
    address_troubles, supply_troubles, esc_troubles, device_troubles, command_troubles, bus_troubles, thrust_troubles,
)  # fmt: skip


def troubles(case: FlightCase) -> list[Trouble]:
    """Return what can have begun it, the earliest first."""
    found = [one for look in _ALL for one in look(case)]
    return sorted(found, key=lambda one: (one.high, one.order))
