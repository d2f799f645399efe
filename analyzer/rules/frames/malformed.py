"""Frames of DroneCAN traffic that can be part of no transfer: remote, empty, too long, anonymous in several frames.

These are the kinds; `transfers.unassigned` finds such frames, once it is certain that their session is DroneCAN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.frames.anonymous import discriminator
from analyzer.tables import FD, FRAME_ANOMALIES, VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.kit import Array, Severity, Values

_REMOTE, _NO_TAIL, IMPOSSIBLE = (
    1 << FRAME_ANOMALIES.index(name) for name in ("remote", "no tail", "impossible length")
)
_FOREIGN, _ANONYMOUS = VERDICTS.index("foreign"), VERDICTS.index("anonymous multi")
_LENGTH_CODE = 8  # bits 8 to 11 of the flags of a remote frame


class FrameForm(NamedTuple):
    """The outside of a frame: its identifier and flags, its last byte (0 if there is none), how many bytes it has."""

    id: int
    flags: int
    tail: int
    length: int


class Malformed(NamedTuple):
    """A rule, the frames that breach it by columns of verdicts, anomalies and flags, and the values of one."""

    rule: str
    picks: Callable[[Array, Array, Array], Array]
    values: Callable[[FrameForm], Values]
    severity: Severity | None = None


def has(bit: int) -> Callable[[Array, Array, Array], Array]:
    """Return what picks frames with an anomaly."""
    return lambda _verdict, anomaly, _flags: anomaly & bit != 0


def tail(form: FrameForm) -> Values:
    """Return the tail byte."""
    return {"tail": form.tail}


def _promises_more(form: FrameForm) -> Values:
    return {"what": f"tail byte {form.tail:02X}"}


def _anonymous(verdict: Array, _anomaly: Array, _flags: Array) -> Array:
    return np.equal(verdict, _ANONYMOUS)


def _too_long(verdict: Array, anomaly: Array, flags: Array) -> Array:
    """Pick CAN FD frames outside of transfers, and classic ones of more than 8 bytes."""
    fd = flags & FD != 0
    return np.where(fd, verdict > _FOREIGN, anomaly & IMPOSSIBLE != 0)


def _remote(form: FrameForm) -> Values:
    return {"can_id": form.id, "length": form.flags >> _LENGTH_CODE & 0xF}


def _form(form: FrameForm) -> Values:
    return {"can_id": form.id, "length": form.length}


def _sender(form: FrameForm) -> Values:
    return {"discriminator": discriminator(form.id), "type_id": form.id >> 8 & 3}


KINDS = (
    Malformed("CAN-002", has(_REMOTE), _remote),
    Malformed("CAN-003", _too_long, _form),
    Malformed("CAN-005", has(_NO_TAIL), _form),
    Malformed("CAN-008", _anonymous, _sender),
    Malformed("CAN-009", _anonymous, _promises_more),
)
