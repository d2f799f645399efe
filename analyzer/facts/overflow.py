"""Error frames by which a driver says that it lost frames."""

from __future__ import annotations

CONTROLLER = 0x04  # error class (linux/can/error.h); byte 1 of the data says more
_OVERFLOW = 0x01  # of the receive buffer


def overflowed(error_class: int, data: bytes) -> bool:
    """Whether an error frame says that the receive buffer was too small."""
    return bool(error_class & CONTROLLER and len(data) > 1 and data[1] & _OVERFLOW)
