"""First frames with a wrong transfer ID: by the CRC the frames behind them belong to them, and say which was meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer._native import misnumbered
from analyzer.decode.sent import cells

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_NEAR = 512  # frames before another one and behind it that the core looks through


def meant(view: View, lead: Array, code: Array, own: Array, before: Array) -> tuple[Array, Array]:
    """Return which transfer IDs first frames should have, and those before them in their sessions; -1: what they have.

    Args:
        view: the batch of the frames, and those before it.
        lead: the frames.
        code: their types.
        own: of which the ID is asked for.
        before: of which that of the one before is.
    """
    found = np.full(len(lead), -1), np.full(len(lead), -1)
    rows = np.flatnonzero(own | before)
    if len(rows):
        codes, which = np.unique(code[rows], return_inverse=True)
        types = [view.types.starts(each) for each in codes.tolist()]
        some = lead[rows]
        indexes = [*view.indexes(int(some.min()) - _NEAR, int(some.max()) + 1 + _NEAR)]
        asked = some.astype(np.uint64), which.astype(np.uint32), own[rows].view(np.uint8), before[rows].view(np.uint8)
        for column, ids in zip(found, misnumbered(indexes, types, asked), strict=True):
            column[rows] = cells(ids, np.int8)
    return found
