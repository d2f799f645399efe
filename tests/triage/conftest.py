"""Flights and events of candump text, however that is cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from analyzer.flight.finder import EventFinder
from analyzer.flight.flights import FlightFinder
from analyzer.tables import raw_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

Tables = tuple[list[dict[str, Any]], list[dict[str, Any]]]


@pytest.fixture
def told(decode: Callable[..., Any], registry: Registry) -> Callable[..., Tables]:
    """Gives the rows of the flights and of the events of a text, or of its pieces."""

    def run(*chunks: Any) -> Tables:
        flights, events = FlightFinder(registry), EventFinder(registry)
        for batch in decode(*chunks).batches:
            flights.feed(batch)
            events.feed(batch)
        return raw_rows(flights.finish()), raw_rows(events.finish())

    return run
