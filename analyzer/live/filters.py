"""Capture filters as candump writes them: which frames come in at all, and which error frames.

`123:7FF` takes a frame if identifier and mask agree, `123~7FF` if they do not; several are separated by commas, and one
of them is enough, or with `j` all are needed. `#FF` is the mask of the error frames. An identifier of 8 digits has 29
bits; without them the length is not asked for, unless the mask has its bit: 80000000 (40000000 for remote frames).
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

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

_RULE = re.compile(r"(?:0x)?([0-9a-f]{1,8})([:~])(?:0x)?([0-9a-f]{1,8})", re.IGNORECASE)
_ERRORS = re.compile(r"#(?:0x)?([0-9a-f]{1,8})", re.IGNORECASE)
_EXAMPLE = "ID:MASK in hex as in 123:7FF, ID~MASK for all others, #MASK for error frames, j to need all of them"


@dataclass(frozen=True, slots=True)
class Rule:
    """One comparison of the kernel's identifier word: `number` and `mask` with its flag bits."""

    number: int
    mask: int
    inverted: bool = False

    def takes(self, word: int) -> bool:
        """Whether it lets this word through."""
        return ((word ^ self.number) & self.mask == 0) != self.inverted


@dataclass(frozen=True, slots=True)
class Filters:
    """What is let through: a frame if any of the rules takes it (with `join` all of them), or if there are none.

    `errors` is the mask of the classes of error frames; None takes all of them.
    """

    rules: tuple[Rule, ...] = ()
    errors: int | None = None
    join: bool = False

    def __bool__(self) -> bool:
        """Whether anything is held off."""
        return bool(self.rules) or self.errors is not None

    @staticmethod
    def hold(to: socket.socket) -> None:
        """Makes the kernel keep everything from a SocketCAN socket, until `apply`. Raises `OSError`."""
        to.setsockopt(_SOL_CAN_RAW, _FILTER, b"")
        to.setsockopt(_SOL_CAN_RAW, _ERROR_FILTER, struct.pack("=I", 0))

    def apply(self, to: socket.socket) -> None:
        """Makes the kernel filter what a SocketCAN socket gets from now on. Raises `OSError`."""
        if self.join:
            to.setsockopt(_SOL_CAN_RAW, _JOIN, 1)
        rules = self.rules or (Rule(0, 0),)
        words = ((rule.number | (_INVERTED if rule.inverted else 0), rule.mask) for rule in rules)
        to.setsockopt(_SOL_CAN_RAW, _FILTER, b"".join(struct.pack("=II", *pair) for pair in words))
        errors = _ALL_ERRORS if self.errors is None else self.errors
        to.setsockopt(_SOL_CAN_RAW, _ERROR_FILTER, struct.pack("=I", errors))

    def take(self, message: can.Message, error_class: int) -> bool:
        """What the kernel would say of a message; `error_class` is that of an error frame."""
        if message.is_error_frame:
            return self.errors is None or bool(error_class & self.errors)
        word = message.arbitration_id | _EXTENDED * message.is_extended_id | _REMOTE * message.is_remote_frame
        return self.passes(word)

    def passes(self, word: int) -> bool:
        """What the kernel would say of a frame with this identifier and its flag bits."""
        return not self.rules or (all if self.join else any)(rule.takes(word) for rule in self.rules)


def split(text: str) -> tuple[str, str]:
    """`IFACE[,FILTER...]` as candump has it: the interface, and its filters."""
    name, _, rest = text.partition(",")
    return name, rest


def parse(texts: Iterable[str]) -> Filters:
    """The filters that are meant. Raises `ValueError` with the reason and an example."""
    rules: list[Rule] = []
    errors: int | None = None
    join = False
    for text in (part.strip() for whole in texts for part in whole.split(",")):
        if rule := _RULE.fullmatch(text):
            rules.append(_rule(*rule.groups()))
        elif error := _ERRORS.fullmatch(text):
            errors = (errors or 0) | (int(error[1], 16) & _ALL_ERRORS)
        elif text in ("j", "J"):
            join = True
        elif text:
            raise ValueError(f"{text!r} is no filter: {_EXAMPLE}")
    if len(rules) > MOST:
        raise ValueError(f"{len(rules)} filters, {MOST} at most")
    if join and not rules:
        raise ValueError(f"j joins filters, and there are none: {_EXAMPLE}")
    return Filters(tuple(rules), errors, join)


def _rule(number: str, sign: str, mask: str) -> Rule:
    word = int(number, 16) | (_EXTENDED if len(number) == 8 else 0)
    bits = int(mask, 16) & ~_ERROR
    if bits & _EXTENDED and not word & _EXTENDED:
        bits &= _STANDARD  # what lies beyond 11 bits counts for nothing then
    return Rule(word & bits, bits, inverted=sign == "~")
