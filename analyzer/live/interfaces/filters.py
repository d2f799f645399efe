"""Capture filters as candump writes them: which frames come in at all, and which error frames.

`123:7FF` takes a frame if identifier and mask agree, `123~7FF` if they do not; several are separated by commas, and one
of them is enough, or with `j` all are needed. `#FF` is the mask of the error frames. An identifier of 8 digits has 29
bits; without them the length is not asked for, unless the mask has its bit: 80000000 (40000000 for remote frames).
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    import socket
    from collections.abc import Iterable

    import can

# linux/can.h, linux/can/raw.h
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29
_STANDARD = _EXTENDED | _REMOTE | 0x7FF
_INVERTED = _ERROR
_ALL_ERRORS = _ERROR - 1
_SOL_CAN_RAW, _FILTER, _ERROR_FILTER, _JOIN = 101, 1, 2, 6
# As many as the kernel takes.
MOST = 512

_FRAMES = re.compile(r"(?:0x)?([0-9a-f]{1,8})([:~])(?:0x)?([0-9a-f]{1,8})", re.IGNORECASE)
_ERRORS = re.compile(r"#(?:0x)?([0-9a-f]{1,8})", re.IGNORECASE)
_EXAMPLE = "ID:MASK in hex as in 123:7FF, ID~MASK for all others, #MASK for error frames, j to need all of them"


@dataclass(frozen=True, slots=True)
class FrameFilter:
    """One comparison of the kernel's identifier word: `number` and `mask` with its flag bits."""

    number: int
    mask: int
    inverted: bool = False

    def takes(self, word: int) -> bool:
        """Return True if it lets this word through."""
        return ((word ^ self.number) & self.mask == 0) != self.inverted


@dataclass(frozen=True, slots=True)
class Filters:
    """The filters of an interface: a frame passes if any of them takes it (with `join` all), or if there are none.

    `errors` is the mask of the classes of error frames; None takes all of them.
    """

    frames: tuple[FrameFilter, ...] = ()
    errors: int | None = None
    join: bool = False

    def __bool__(self) -> bool:
        """Return True if anything is held off."""
        return bool(self.frames) or self.errors is not None

    @staticmethod
    def hold(to: socket.socket) -> None:
        """Make the kernel keep everything from a SocketCAN socket, until `apply`. Raises `OSError`."""
        to.setsockopt(_SOL_CAN_RAW, _FILTER, b"")
        to.setsockopt(_SOL_CAN_RAW, _ERROR_FILTER, struct.pack("=I", 0))

    def apply(self, to: socket.socket) -> None:
        """Make the kernel filter what a SocketCAN socket gets from now on. Raises `OSError`."""
        if self.join:
            to.setsockopt(_SOL_CAN_RAW, _JOIN, 1)
        frames = self.frames or (FrameFilter(0, 0),)
        words = ((one.number | (_INVERTED if one.inverted else 0), one.mask) for one in frames)
        to.setsockopt(_SOL_CAN_RAW, _FILTER, b"".join(struct.pack("=II", *pair) for pair in words))
        errors = _ALL_ERRORS if self.errors is None else self.errors
        to.setsockopt(_SOL_CAN_RAW, _ERROR_FILTER, struct.pack("=I", errors))

    def take(self, message: can.Message, error_class: int) -> bool:
        """Decide about a message as the kernel would; `error_class` is that of an error frame."""
        if message.is_error_frame:
            return self.errors is None or bool(error_class & self.errors)
        word = message.arbitration_id | _EXTENDED * message.is_extended_id | _REMOTE * message.is_remote_frame
        return self.passes(word)

    def passes(self, word: int) -> bool:
        """Decide about a frame with this identifier and its flag bits as the kernel would."""
        return not self.frames or (all if self.join else any)(one.takes(word) for one in self.frames)


def split_filters(text: str) -> tuple[str, str]:
    """Split `IFACE[,FILTER...]`, as candump has it, into the interface and its filters."""
    name, _, rest = text.partition(",")
    return name, rest


def parse_filters(texts: Iterable[str]) -> Filters:
    """Read the filters that are meant. Raises `ValueError` with the reason and an example."""
    frames: list[FrameFilter] = []
    errors: int | None = None
    join = False
    for text in (part.strip() for whole in texts for part in whole.split(",")):
        if frame := _FRAMES.fullmatch(text):
            frames.append(_read(*frame.groups()))
        elif error := _ERRORS.fullmatch(text):
            errors = (errors or 0) | (int(error[1], 16) & _ALL_ERRORS)
        elif text in ("j", "J"):
            join = True
        elif text:
            raise ValueError(f"{text!r} is no filter: {_EXAMPLE}")
    if len(frames) > MOST:
        raise ValueError(f"{len(frames)} filters, {MOST} at most")
    if join and not frames:
        raise ValueError(f"j joins filters, and there are none: {_EXAMPLE}")
    return Filters(tuple(frames), errors, join)


def _read(number: str, sign: str, mask: str) -> FrameFilter:
    word = int(number, 16) | (_EXTENDED if len(number) == 8 else 0)
    bits = int(mask, 16) & ~_ERROR
    if bits & _EXTENDED and not word & _EXTENDED:
        bits &= _STANDARD  # what lies beyond 11 bits counts for nothing then
    return FrameFilter(word & bits, bits, inverted=sign == "~")
