"""Breaks in reports at a steady pace: the core finds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from dissectors.kit import Break
from dissectors.kit.paces import ALIKE, SLOWEST

if TYPE_CHECKING:
    from dissectors.kit import Array


class Paces:
    """The reports of many senders, as `dissectors.kit.PacedReports` has them.

    Args:
        least: shorter times than this in ns are no breaks.
        periods: nor are shorter ones than so many periods.
        fewest: reports that show a period.
        span: how long in ns they have to go on, so that they are more than a few in a row.
    """

    def __init__(self, least: int, periods: float, fewest: int, span: int) -> None:
        self._native = _native.Paces(least, periods, fewest, span, (ALIKE, SLOWEST))
        self._open: dict[int, Break] = {}  # by sender: not known yet whether the pace changed

    @property
    def last(self) -> Array:
        """The time of the last report of each, in ns."""
        return cells(self._native.last(), np.int64)

    def feed(self, senders: Array, size: Array, t: Array, lost: Array) -> list[tuple[int, Break]]:
        """Add reports of some senders, all with a time; return the breaks between them."""
        settled, told = self._native.feed(senders, size, t, lost)
        for sender, lowered in settled:
            self._open.pop(sender).lowered = lowered
        found = [(k, Break(*one)) for k, one in told]
        self._open |= {senders.item(k): one for k, one in found if one.lowered is None}
        return found

    def silences(self, until: Array) -> list[tuple[int, Break]]:
        """Return the breaks that last until now, each with its sender; `until` is that time for each of all."""
        return [(sender, Break(*one)) for sender, one in self._native.silences(until)]
