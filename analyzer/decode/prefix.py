"""Which rows carry a length in front of their tail array although they came on classic CAN.

The document prints C structures with a length byte and maximum lengths that include one (5.3, 4.3.1), so some senders
write it. DSDL on classic CAN leaves it out. A row is read with a length only when that reading fits exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.sent import cells

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import Group
    from dissectors.kit import Array
    from dissectors.schema import Message

    Try = Callable[[Array, int], tuple[Array, Array, Array]]

TAIL, PREFIX, BYTE_PREFIX = 0, 1, 2


def with_length(message: Message, group: Group, left: Array, attempt: Try) -> Array:
    """Return the layout code of every row.

    Args:
        message: the type, with `prefix` set.
        group: the rows.
        left: bits that the usual reading left over, each row.
        attempt: unpacks the rows it is given with one layout code; gives bits left, flags, and whether the values
            are inside the limits of the profile.
    """
    codes = np.zeros(len(group), np.uint8)
    if message.packets is not None:
        # The byte before a known packet header counts the bytes behind it.
        codes[cells(group.counted(message.min_bytes, message.packets.header), bool)] = PREFIX
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
