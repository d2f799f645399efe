"""Transfers of which later frames came, but not the start: by their IDs they are missing, and yet they were sent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer._native import OrphanIndex
from analyzer.rules.frames.foreign import session_bits
from analyzer.tables import TAIL_ID, VERDICTS

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_ASTRAY = tuple(VERDICTS.index(name) for name in ("orphan", "wrong transfer id"))


class OrphanFrames:
    """Remembers the frames of sessions that belong to no transfer.

    A session is the bus above 32 bits of `session_bits`. The core looks in the `index`.
    """

    def __init__(self) -> None:
        self.index = OrphanIndex()

    def feed(self, view: View) -> None:
        """Add those of a batch, and of earlier ones whose sessions became certain."""
        self.index.forget()
        settled = view.settled
        if len(settled.number):
            late = settled.of((_is_astray(settled.verdict) & settled.known).nonzero()[0])
            self._add(late.bus << 32 | session_bits(late.id, late.verdict), late.number, late.t, late.tail)
        f = view.frames
        rows = _is_astray(f.verdict).nonzero()[0]
        if not len(rows):
            return
        bits = session_bits(f.id[rows], f.verdict[rows])
        self._add(f.bus[rows].astype(np.int64) << 32 | bits, f.first + rows, f.t[rows], f.tail[rows])

    def _add(self, session: Array, number: Array, t: Array, tail: Array) -> None:
        self.index.add(session, number, t, (tail & TAIL_ID).astype(np.uint8))


def _is_astray(verdict: Array) -> Array:
    found: Array = (verdict == _ASTRAY[0]) | (verdict == _ASTRAY[1])
    return found
