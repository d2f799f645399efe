"""Which rows carry a length in front of their tail array although they came on classic CAN.

The document prints C structures with a length byte and maximum lengths that include one (5.3, 4.3.1), so some senders
write it. DSDL on classic CAN leaves it out. A row is read with a length only when that reading fits exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.kit import Array
    from dissectors.schema import Message

    Try = Callable[[Array, int], tuple[Array, Array, Array]]

TAIL, PREFIX, BYTE_PREFIX = 0, 1, 2


def with_length(message: Message, starts: Array, lengths: Array, left: Array, payload: Array, attempt: Try) -> Array:
    """Return the layout code of every row.

    Args:
        message: the type, with `prefix` set.
        starts: first byte of each row in `payload`.
        lengths: bytes of each row.
        left: bits that the usual reading left over, each row.
        payload: all bytes.
        attempt: unpacks the rows it is given with one layout code; gives bits left, flags, and whether the values
            are inside the limits of the profile.
    """
    codes = np.zeros(len(starts), np.uint8)
    if message.packets is not None:
        codes[_leads_a_packet(message, starts, lengths, payload)] = PREFIX
        return codes
    rows = np.flatnonzero(left >= 8)
    best = np.zeros(len(rows), np.uint8)
    for code in (BYTE_PREFIX, PREFIX):
        if not rows.size:
            break
        bits, flags, plausible = attempt(rows, code)
        fits = (bits >= 0) & (bits < 8) & (flags == 0)
        best[fits & (plausible | (best == TAIL))] = code
    codes[rows] = best
    return codes


def _leads_a_packet(message: Message, starts: Array, lengths: Array, payload: Array) -> Array:
    """Return rows whose byte before a known packet header counts the bytes behind it."""
    family = message.packets
    at = message.min_bytes
    found = np.zeros(len(starts), bool)
    if family is None or not len(payload):
        return found
    size = len(family.header)
    rows = np.flatnonzero(lengths > at + size)
    first = starts[rows] + at
    good = payload[first] == (lengths[rows] - at - 1)
    for k, byte in enumerate(family.header):
        good &= payload[first + 1 + k] == byte
    found[rows[good]] = True
    return found
