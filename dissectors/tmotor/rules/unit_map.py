"""Which node speaks for which power unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import sound
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT, LAST_UNIT

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Exercise, View


class UnitMap:
    """The node of each unit by its status packets 0xA1 to 0xA9; a unit that two nodes claim is left out."""

    def __init__(self) -> None:
        self._nodes: dict[int, set[int]] = {}

    def feed(self, view: View) -> None:
        """Add the next batch."""
        packets = view.table("PUSHCAN.MotorStatus")
        if packets is None:
            return
        pairs = (packets.src.astype(np.int64) << 8 | packets["unit_id"])[sound(packets)]
        for pair in np.flatnonzero(np.bincount(pairs)).tolist():
            if FIRST_UNIT <= pair & 0xFF <= LAST_UNIT:
                self._nodes.setdefault(pair & 0xFF, set()).add(pair >> 8)

    def words(self) -> Iterable[str]:
        """Return no words."""
        return ()

    def facts(self) -> dict[str, float]:
        """Return node IDs by `unit N`."""
        return {f"unit {unit}": min(nodes) for unit, nodes in self._nodes.items() if len(nodes) == 1}


EXERCISES: tuple[type[Exercise], ...] = (UnitMap,)
