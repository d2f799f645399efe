"""The identifier of a frame: whose it is, and what it says it carries (4.1.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import EXTENDED, VERDICTS

if TYPE_CHECKING:
    from dissectors.kit import Array

NOBODY = -1  # in place of a node ID and of a type
_FOREIGN = VERDICTS.index("foreign")
# Verdicts that frames of anonymous senders never have: without a source, the sender has no node ID and names its type.
_IS_STRAY = np.array([name in {"orphan", "wrong toggle", "wrong transfer id", "duplicate"} for name in VERDICTS])


def who(identifier: Array, flags: Array, verdict: Array) -> tuple[Array, Array]:
    """Return source node and type code of frames as their identifiers have them; -1 for what is not DroneCAN's."""
    number = identifier.astype(np.int64)
    service = number >> 7 & 1 == 1
    without = ~service & (number & 0x7F == 0)
    nameless = without & (number & 0xFF_FC00 != 0) & _IS_STRAY[verdict]
    anonymous = without & ~nameless
    kind = np.where(service, np.where(number >> 15 & 1 == 1, 2, 3), np.where(anonymous, 1, 0))
    type_id = np.where(service, number >> 16 & 0xFF, np.where(anonymous, number >> 8 & 3, number >> 8 & 0xFFFF))
    ours = (flags & EXTENDED != 0) & (verdict != _FOREIGN)
    node = np.where(ours & (nameless | (number & 0x7F != 0)), number & 0x7F, NOBODY)
    return node, np.where(ours, kind << 16 | type_id, NOBODY)
