"""Captures of packets made by hand, and what one rule says of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kit import encode
from kit.judged import judge
from kit.traffic import log

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kit.judged import Said

Sent = tuple[float, int, str, Any]  # time in ms, node, message, its fields or the packets of PUSHSCI and PUSHCAN


def said(rule: str, text: str | bytes, step: int | None = None) -> list[Said]:
    """What one rule says, in the order of places."""
    return judge(text, (rule,), step)


def capture(sent: Iterable[Sent]) -> str:
    """A capture with running transfer IDs and sequence numbers."""
    ids: dict[tuple[int, str], int] = {}
    transfers = []
    for at, node, name, what in sent:
        number = ids[node, name] = ids.get((node, name), -1) + 1
        fields = {"data_sequence": number, "data": list(what)} if isinstance(what, bytes) else what
        transfers.append((at, encode.transfer(name, fields, node, number)))
    return log(*transfers)


MOTOR = {"voltage": 4850, "speed": 3011, "current": 120, "temperature": 4100, "position": 1234, "pwm": 15_000}
STATUS = {
    "voltage": 48.5, "current": 1.2, "temperature": 41.0, "rpm": 3011, "esc_index": 0, "error_count": 4 << 12,
    "power_rating_pct": 40,
}  # fmt: skip


def motor(count: int, unit: int = 0xA1, **values: int) -> bytes:
    """A status packet."""
    return encode.packet("PUSHCAN.MotorStatus", count, unit, **(MOTOR | values))


def motors(*changed: dict[str, int], node: int = 10) -> str:
    """Status packets, one each 20 ms, with changed values."""
    return capture((20.0 * k, node, "PUSHCAN", motor(k, **values)) for k, values in enumerate(changed))


def summed(data: bytes) -> bytes:
    """The bytes with their sum behind them."""
    return data + bytes([sum(data) & 0xFF])
