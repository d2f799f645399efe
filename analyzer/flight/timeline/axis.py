"""The axis of a time line: time that went by, with the holes of a recording and without the steps of its clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import Spot
    from analyzer.flight.log import FlightEvent
    from dissectors.kit import Array


class AxisBreak(NamedTuple):
    """A hole of the recording, or a step of its clock: from where to where on the axis, and what it was."""

    start: int
    end: int
    text: str


class TimelineAxis:
    """Lays recorded time on the axis, which is the capture's clock as it was at an anchor.

    Args:
        events: all of the capture; those about holes say which of them was a step of the clock.
        anchor: where axis and clock agree.
    """

    def __init__(self, events: Sequence[FlightEvent], anchor: Spot) -> None:
        holes = sorted((one for one in events if one.kind in {"gap", "clock"}), key=lambda one: one.first.frame)
        lost = [_length(one) if one.kind == "gap" else 0 for one in holes]
        self._places = np.array([one.first.ran for one in holes], np.int64)
        self._behind = np.concatenate(([0], np.cumsum(np.array(lost, np.int64))))
        self._shift = anchor.t - anchor.ran - self._lost(anchor.ran)
        ends = [self.at(one.first.ran) for one in holes]
        self.breaks = [
            AxisBreak(end - length, end, one.text) for one, length, end in zip(holes, lost, ends, strict=True)
        ]

    def at(self, ran: int) -> int:
        """Return where a recorded time lies."""
        return ran + self._shift + self._lost(ran)

    def of(self, ran: Array) -> Array:
        """Return where recorded times lie."""
        found: Array = ran + self._shift + self._behind[np.searchsorted(self._places, ran, "right")]
        return found

    def ran(self, at: int) -> int:
        """Return the recorded time at a place; inside a hole that of the hole."""
        ends = self._places + self._shift + self._behind[1:]
        k = int(np.searchsorted(ends, at, "right"))
        ran = at - self._shift - int(self._behind[k])
        return ran if k == len(ends) else min(ran, int(self._places[k]))

    def _lost(self, ran: int) -> int:
        return int(self._behind[np.searchsorted(self._places, ran, "right")])


def _length(one: FlightEvent) -> int:
    return 0 if one.before is None else one.first.t - one.before.t
