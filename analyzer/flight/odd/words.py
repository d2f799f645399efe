"""Words for the odd ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.odd.quantities import EscQuantity


def odd_words(quantity: EscQuantity, difference: float, ran: int | None, flights: Sequence[Flight]) -> tuple[str, str]:
    """Return by how much an ESC is odd, and against what: in short, and with what was equal.

    `ran` is the recorded time since when it is so, None for always.
    """
    against = "the others, always so" if ran is None else _before(ran, flights)
    what = _difference(quantity, difference)
    return f"{what} than {against}", f"{what}{_at(quantity)} than {against}"


def layer_words(quantity: EscQuantity, names: Sequence[str], gap: float) -> str:
    """Return that some ESCs differ together from the others."""
    who = ", ".join(names)
    if quantity.key == "voltage":
        return f"{who} share a supply: {gap:.1f} % more voltage than the others'"
    what = f"{_difference(quantity, gap)}{_at(quantity)}"
    return f"{who}: {what} than the others, always so: a fact of the vehicle, no cause"


def _difference(quantity: EscQuantity, difference: float) -> str:
    what = quantity.more if difference > 0 else quantity.less
    return f"{abs(difference):.{quantity.digits}f} {quantity.unit} {what}"


def _at(quantity: EscQuantity) -> str:
    return f" {quantity.at}" if quantity.at else ""


def _before(ran: int, flights: Sequence[Flight]) -> str:
    """Return what of its past an ESC is compared with."""
    number = next((k for k, one in enumerate(flights) if one.first.ran >= ran), None)
    if number is not None and number > 0 and ran == flights[number].first.ran:
        before = flights[:number]
        return f"its own flight {before[0].number}" if number == 1 else f"its own flights 1-{before[-1].number}"
    return "before"
