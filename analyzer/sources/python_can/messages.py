"""The formats of python-can in their own ways: numbers of channels, times in decimal, reasons in words."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

from analyzer.sources.can_rows import Unreadable, in_range
from dissectors.times import SECOND

if TYPE_CHECKING:
    from can import Message

_EXCERPT = 80


def bus_name(number: int) -> str:
    """Return the bus of a channel that is numbered from 1: the first is can0, as everywhere else; 0 stays apart."""
    return f"can{number - 1}" if number > 0 else "ch0"


def channel(message: Message, default: int) -> int:
    """Return the number of the channel as python-can has it. Raises `Unreadable` for one that is not a number."""
    if message.channel is None:
        return default
    if not isinstance(message.channel, int):
        raise Unreadable("channel is not a number")
    return message.channel


def nanoseconds(text: str, scale: int = SECOND, start: int = 0) -> int:
    """Return the time that a decimal number says, exactly, in nanoseconds; `scale` is that of its unit.

    Raises `Unreadable` for anything else and for times beyond 64 bits.
    """
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise Unreadable("time is not a number") from None
    if not value.is_finite() or value.adjusted() > 18:
        raise Unreadable("time out of range")
    return in_range(start + int((value * scale).to_integral_value()))


def quoted(text: str, limit: int = _EXCERPT) -> str:
    """Printable ASCII of at most `limit` characters."""
    text = "".join(c if " " <= c <= "~" else f"\\x{ord(c):02x}" for c in text[: limit + 1])
    return text if len(text) <= limit else f"{text[: limit - 3]}..."


def words(error: Exception) -> str:
    """Return what an exception of a library says, in one short printable line."""
    if isinstance(error, Unreadable):
        return str(error)
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return quoted(lines[0])
