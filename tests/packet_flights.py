"""Flights with faults in packets, judged by the rules and by the witness."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import encode
from judged import judge
from witness.flights import SECOND, Flight, registry
from witness.proof import finder
from witness.reader import Log

from analyzer.simulate import Settings, Simulation
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line

if TYPE_CHECKING:
    from collections.abc import Iterable

    from judged import Said

STEP = 997  # lines, no divisor of anything


@lru_cache(maxsize=4)
def fly(*orders: str, seconds: float = 10, **settings: Any) -> tuple[str, Flight]:
    """A flight as text, and as the witness has it."""
    wanted = tuple(catalogue.order(order) for order in orders)
    run = Simulation(Settings(duration=round(seconds * SECOND), orders=wanted, **settings), registry())
    text = "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames())
    return text, Flight(Log(text), run.key(), run.unused)


def said(rule: str, text: str | bytes, step: int | None = None) -> list[Said]:
    """What one rule says, in the order of places."""
    return judge(text, (rule,), step)


def compare(rule: str, *orders: str, seconds: float = 10, **settings: Any) -> list[Said]:
    """The findings of a rule in a flight: in the transfers that the witness finds, all of them and no other."""
    text, flight = fly(*orders, seconds=seconds, **settings)
    found, witness = said(rule, text), [set(one) for one in finder(rule)(flight.log)]
    assert found == said(rule, text, STEP)
    assert flight.unused == ()
    shown = {frame for one in found for frame in one.frames}
    assert all(any(frame in one for one in witness) for frame in shown)
    transfers = {frozenset(one) for one in witness}
    if sum(one.count for one in found) <= 20:
        assert all(shown & one for one in transfers)
    assert sum(one.count for one in found) >= len(transfers) > 0
    return found


def places(rule: str, text: str | bytes, step: int | None = None) -> list[tuple[int, str]]:
    """Each example's frame with the text of its finding."""
    return [(frame, one.text) for one in said(rule, text, step) for frame in one.frames]


Sent = tuple[float, int, str, Any]  # time in ms, node, message, its fields or the packets of PUSHSCI and PUSHCAN


def capture(sent: Iterable[Sent]) -> str:
    """A capture with running transfer IDs and sequence numbers."""
    ids: dict[tuple[int, str], int] = {}
    text = ""
    for at, node, name, what in sent:
        number = ids[node, name] = ids.get((node, name), -1) + 1
        fields = {"data_sequence": number, "data": list(what)} if isinstance(what, bytes) else what
        frames = encode.transfer(name, fields, node, number).frames(SECOND + round(at * 1_000_000))
        text += "".join(encode.log_line(frame) + "\n" for frame in frames)
    return text


MOTOR = {"voltage": 4850, "speed": 3011, "current": 120, "temperature": 4100, "position": 1234, "pwm": 15_000}
STATUS = {
    "voltage": 48.5,
    "current": 1.2,
    "temperature": 41.0,
    "rpm": 3011,
    "esc_index": 0,
    "error_count": 4 << 12,
    "power_rating_pct": 40,
}


def motor(count: int, unit: int = 0xA1, **values: int) -> bytes:
    """A status packet."""
    return encode.packet("PUSHCAN.MotorStatus", count, unit, **(MOTOR | values))


def motors(*changed: dict[str, int], node: int = 10) -> str:
    """Status packets, one each 20 ms, with changed values."""
    return capture((20.0 * k, node, "PUSHCAN", motor(k, **values)) for k, values in enumerate(changed))


def summed(data: bytes) -> bytes:
    """The bytes with their sum behind them."""
    return data + bytes([sum(data) & 0xFF])
