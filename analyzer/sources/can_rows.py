"""A message of python-can becomes a row, whether it comes out of a file or from a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import SECOND

if TYPE_CHECKING:
    from can import Message

    from analyzer._native import Rows

# Bits of `frames.flags`, as `analyzer/native/src/frames.rs` has them.
EXTENDED, REMOTE, FD, BRS, ESI, TX, RX = 1, 2, 8, 16, 32, 64, 128
DLC_SHIFT = 8
# Kinds of time stamps, as `analyzer.tables.STAMPS` names them.
ABSOLUTE, DATE, FROM_START, DELTA, MICROSECONDS, NANOSECONDS = 1, 2, 4, 8, 32, 64
# "Bus error" of linux/can/error.h: all that is known of an error frame whose kind a format does not keep.
BUS_ERROR = 0x80
_RANGE = 1 << 63
_MANY_SECONDS = 10**7 * SECOND


class Unreadable(Exception):  # noqa: N818 - says what a record is
    """Why a record cannot be read."""


def add(rows: Rows, message: Message, t: int, bus: str, class_: int | None = None) -> None:
    """Add what one message of a bus or a log of python-can says, in whatever form it is.

    Args:
        rows: where to.
        message: a frame or an error frame.
        t: time in nanoseconds.
        bus: name of the bus.
        class_: class bits of an error frame; None if they are its identifier.

    Raises `Unreadable` as `store` does.
    """
    if message.is_error_frame:
        flags = RX if message.is_rx else TX
        known = message.arbitration_id if class_ is None else class_
        store_error(rows, t, bus, known or BUS_ERROR, bytes(message.data), flags)
        return
    size = message.dlc if message.is_fd else min(8, message.dlc)
    code = 0 if message.is_fd else message.dlc
    store(rows, message, t, bus, code=code, size=size, directed=True)


def store(
    rows: Rows, message: Message, t: int, bus: str, *, code: int, size: int, directed: bool, wide: bool = False
) -> None:
    """Add a data or remote frame.

    Args:
        rows: where to.
        message: what python-can understood.
        t: time in nanoseconds.
        bus: name of the bus.
        code: the length code (DLC), 0 to 15.
        size: bytes of data that the capture claims.
        directed: whether the format says who sent it.
        wide: whether 11-bit frames may have larger identifiers, which no bus carries, in what a format holds.

    Raises `Unreadable` if it is not a frame that a bus can carry, or of one bus too many.
    """
    if not 0 <= message.arbitration_id <= (0x1FFFFFFF if message.is_extended_id or wide else 0x7FF):
        raise Unreadable(f"identifier beyond {29 if message.is_extended_id else 11} bits")
    flags = EXTENDED if message.is_extended_id else 0
    if not 0 <= code <= 15:
        raise Unreadable("length code beyond 15")
    data = b"" if message.is_remote_frame else bytes(message.data)
    if message.is_remote_frame:
        flags |= REMOTE | code << DLC_SHIFT | _fd(message)
    elif len(data) != size:
        raise Unreadable(f"{len(data)} data bytes, {size} expected")
    elif len(data) > (64 if message.is_fd else 8):
        raise Unreadable("data longer than a frame can be")
    elif message.is_fd:
        flags |= _fd(message)
    elif code > 8:
        flags |= code << DLC_SHIFT
    if directed:
        flags |= RX if message.is_rx else TX
    try:
        rows.frame(t, bus, message.arbitration_id, flags, data)
    except ValueError as error:
        raise Unreadable(str(error)) from None


def _fd(message: Message) -> int:
    """Return the flags of CAN FD, also of a remote frame: no bus carries such, some formats hold them."""
    return (FD | BRS * message.bitrate_switch | ESI * message.error_state_indicator) if message.is_fd else 0


def store_error(rows: Rows, t: int, bus: str, class_: int = BUS_ERROR, data: bytes = b"", flags: int = 0) -> None:
    """Add an error frame; `flags` is TX or RX where the format says so. Raises `Unreadable` for one bus too many."""
    try:
        rows.error_frame(t, bus, class_, data, flags)
    except ValueError as error:
        raise Unreadable(str(error)) from None


def from_float(seconds: float) -> int:
    """Return the time that a float holds, in nanoseconds, without what is only rounding in it (`significant`).

    Raises `Unreadable` if it is none, or beyond 64 bits.
    """
    try:
        return significant(in_range(round(seconds * SECOND)))
    except (ValueError, OverflowError):
        raise Unreadable("time out of range") from None


def significant(t: int) -> int:
    """Round a time that was a float once: since 1970 the sixteen digits of a float end with the microseconds."""
    return rounded(t, 1000) if abs(t) >= _MANY_SECONDS else t


def in_range(t: int) -> int:
    """Return the time. Raises `Unreadable` if it does not fit 64 bits; the smallest number is kept for "no time"."""
    if not -_RANGE < t < _RANGE:
        raise Unreadable("time out of range")
    return t


def rounded(t: int, step: int) -> int:
    """Return the nearest multiple."""
    return (t + step // 2) // step * step
