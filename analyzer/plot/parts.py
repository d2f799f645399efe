"""Batches as parts of what is shown: all of them, or what is inside a window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.window.part import BatchPart

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch


def whole(batch: Batch) -> BatchPart:
    """Return all of a batch."""
    return BatchPart(
        frames=batch.frames,
        frame_rows=_numbers(batch.first_frame, len(batch.frames)),
        transfers=batch.transfers,
        transfer_rows=_numbers(batch.first_transfer, len(batch.transfers)),
        events=batch.events,
        messages=batch.messages,
        settled=batch.settled,
        buses=batch.buses,
        settled_before=batch.settled_before,
    )


def _numbers(first: int, count: int) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    return np.arange(first, first + count, dtype=np.uint64)
