"""The part of a capture that is exported: its first and last frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.cells import numbers
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.window.part import BatchPart
    from dissectors.kit import Array


@dataclass(slots=True)
class Extent:
    """First and last frame of what is exported: their numbers, from 1, and times in ns; None before there are any."""

    frames: tuple[int, int] | None = None
    times: tuple[int, int] | None = None

    def feed(self, part: BatchPart) -> None:
        """Take the next frames."""
        self.frames = _wider(self.frames, part.frame_rows.astype(np.int64) + 1)
        column = part.frames.column("t")
        self.times = _wider(self.times, numbers(column)[~np.asarray(column.is_null())])

    def has_frames(self, *ends: int) -> bool:
        """Return True if a frame between these numbers is exported."""
        return _overlap(self.frames, *ends)

    def has_times(self, *ends: int) -> bool:
        """Return True if a time (ns) between these is exported."""
        return _overlap(self.times, *ends)


def _wider(known: tuple[int, int] | None, more: Array) -> tuple[int, int] | None:
    ends = [*(known or ()), *((int(more.min()), int(more.max())) if len(more) else ())]
    return (min(ends), max(ends)) if ends else None


def _overlap(span: tuple[int, int] | None, *ends: int) -> bool:
    return span is not None and min(ends) <= span[1] and max(ends) >= span[0]
