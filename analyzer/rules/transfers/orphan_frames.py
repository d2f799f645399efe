"""Transfers of which later frames came, but not the start: by their IDs they are missing, and yet they were sent."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.frames.foreign import session_bits, session_of
from analyzer.tables import TAIL_ID, VERDICTS
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import View

_ASTRAY = tuple(VERDICTS.index(name) for name in ("orphan", "wrong transfer id"))
_MOST_SESSIONS = 1 << 12
_MOST_FRAMES = 256  # of a session, the latest: of two seconds and more


class _Frame(NamedTuple):
    number: int
    t: int
    transfer_id: int


class OrphanFrames:
    """Remembers the frames of sessions that belong to no transfer."""

    def __init__(self) -> None:
        self._frames: dict[int, deque[_Frame]] = {}
        self._newest: dict[int, int] = {}  # the latest time of each session

    def feed(self, view: View) -> None:
        """Add those of a batch, and of earlier ones whose sessions became certain."""
        for number, verdict, _ in view.settled:
            kept = view.frame(number) if verdict in _ASTRAY else None
            if kept is not None:
                self._note(kept.bus << 32 | session_of(kept.id, verdict), number, kept.t, kept.data)
        f = view.frames
        if not f.verdict.any():
            return
        rows = np.flatnonzero(np.isin(f.verdict, _ASTRAY))
        sessions = f.bus[rows].astype(np.int64) << 32 | session_bits(f.id[rows], f.verdict[rows])
        for row, session in zip(rows.tolist(), sessions.tolist(), strict=True):
            self._note(session, f.first + row, int(f.t[row]), f.data(row))

    def hold(self, session: int, since: int, lead: int, missing: Iterable[int]) -> bool:
        """Return whether of all missing transfer IDs frames came after a time and before a frame.

        `session` is the bus above 32 bits of `session_bits`.
        """
        frames = self._frames.get(session)
        if frames is None or since == NO_TIME or self._newest[session] < since:
            return False
        return {one.transfer_id for one in frames if one.t >= since and one.number < lead}.issuperset(missing)

    def came(self, session: int, since: int, lead: int, *, behind: bool = False) -> bool:
        """Return whether any came after a time, and before a frame or `behind` it."""
        if since == NO_TIME or self._newest.get(session, NO_TIME) < since:
            return False
        return any(one.t >= since and (one.number > lead) == behind for one in reversed(self._frames[session]))

    def _note(self, session: int, number: int, t: int, data: bytes) -> None:
        if session in self._frames or len(self._frames) < _MOST_SESSIONS:
            frames = self._frames.setdefault(session, deque(maxlen=_MOST_FRAMES))
            frames.append(_Frame(number, t, data[-1] & TAIL_ID))
            self._newest[session] = max(self._newest.get(session, t), t)
