"""Comments on frames: those that a capture holds itself, and those that are kept beside it."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from analyzer.decode.engine import Batch

_COMMENT = EVENTS.index("frame comment")
_MOST = 100_000  # comments of the capture, the newest


class FrameComments:
    """Is fed with batches, and knows the comments on their frames and the ones before.

    Args:
        beside: comments by frame, from 0; they count more than those of the capture.

    Attributes:
        texts: by frame, from 0.
    """

    def __init__(self, beside: Mapping[int, str] | None = None) -> None:
        self.texts: dict[int, str] = dict(beside or {})
        self._inside: deque[int] = deque()
        self._waiting: dict[int, str] = {}  # by record, for a frame that comes later

    def feed(self, batch: Batch) -> None:
        """Take the comments of the next batch."""
        waiting = self._waiting | comments_by_line(batch.events)
        if not waiting or not len(batch.frames):
            self._waiting = waiting
            return
        lines = numbers(batch.frames.column("line"))
        wanted = np.array(sorted(waiting), np.int64)
        at = np.searchsorted(lines, wanted)
        for row, line in zip(at.tolist(), wanted.tolist(), strict=True):
            if row < len(lines) and lines[row] == line:
                self._keep(batch.first_frame + row, waiting[line])
        self._waiting = {line: text for line, text in waiting.items() if line > lines[-1]}

    def _keep(self, frame: int, text: str) -> None:
        if frame in self.texts:
            return
        self.texts[frame] = text
        self._inside.append(frame)
        while len(self._inside) > _MOST:
            del self.texts[self._inside.popleft()]


def comments_by_line(events: pa.RecordBatch) -> dict[int, str]:
    """Return the comments among events, by the record that they are on."""
    if not len(events):
        return {}
    rows = np.flatnonzero(numbers(events.column("kind")) == _COMMENT)
    lines = numbers(events.column("line"))[rows].tolist()
    texts = events.column("text").take(rows).to_pylist() if len(rows) else []
    return dict(zip(lines, texts, strict=True))
