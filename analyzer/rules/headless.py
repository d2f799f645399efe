"""Transfers of which later frames came, but not the start: by their IDs they are missing, and yet they were sent."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.foreign import session_bits
from analyzer.tables import VERDICTS
from dissectors.conformance import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.conformance import View

_ASTRAY = tuple(VERDICTS.index(name) for name in ("orphan", "wrong transfer id"))
_TRANSFER_ID = 31
_MOST_SESSIONS = 1 << 12
_MOST_FRAMES = 256  # of a session, the latest: of two seconds and more


class _Frame(NamedTuple):
    number: int
    t: int
    transfer_id: int


class Headless:
    """Remembers the frames of sessions that belong to no transfer."""

    def __init__(self) -> None:
        self._frames: dict[int, deque[_Frame]] = {}

    def add(self, view: View) -> None:
        """Those of a batch, and of earlier ones whose sessions became certain."""
        for number, verdict, _ in view.settled:
            kept = view.frame(number) if verdict in _ASTRAY else None
            if kept is not None:
                self._note(kept.bus << 32 | int(session_bits(np.array([kept.id]))[0]), number, kept.t, kept.data)
        f = view.frames
        if not f.verdict.any():
            return
        rows = np.flatnonzero(np.isin(f.verdict, _ASTRAY))
        sessions = f.bus[rows].astype(np.int64) << 32 | session_bits(f.id[rows])
        for row, session in zip(rows.tolist(), sessions.tolist(), strict=True):
            self._note(session, f.first + row, int(f.t[row]), f.data(row))

    def hold(self, session: int, since: int, lead: int, missing: Iterable[int]) -> bool:
        """Whether of all missing transfer IDs frames came after a time and before a frame.

        `session` is the bus above 32 bits of `session_bits`.
        """
        frames = self._frames.get(session)
        if frames is None or since == NO_TIME:
            return False
        return {one.transfer_id for one in frames if one.t >= since and one.number < lead}.issuperset(missing)

    def _note(self, session: int, number: int, t: int, data: bytes) -> None:
        if session in self._frames or len(self._frames) < _MOST_SESSIONS:
            frames = self._frames.setdefault(session, deque(maxlen=_MOST_FRAMES))
            frames.append(_Frame(number, t, data[-1] & _TRANSFER_ID))
