"""The frames of the recent past, so that a finding can show the bytes that it is about."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from analyzer.tables import EXTENDED, FD, REMOTE
from dissectors.kit import NO_TIME, SECOND, Kept

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dissectors.kit import FrameTable

KEPT = 1 << 18
MOST_LINES = 16
_LENGTH_CODE = 8  # bits 8 to 11 of the flags
_FD_FLAGS = 4  # BRS and ESI stand in the bits above FD


class Recent:
    """Batches of frames that together hold the last `KEPT` frames at least."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch; the oldest ones go when nobody can need them."""
        if not len(frames):
            return
        self._batches.append(frames)
        self._held += len(frames)
        while self._held - len(self._batches[0]) >= KEPT:
            self._held -= len(self._batches.popleft())

    def frame(self, number: int) -> Kept | None:
        """Return a frame by its number, None if it is gone."""
        low, high = 0, len(self._batches)
        while low < high:
            middle = (low + high) // 2
            if self._batches[middle].first <= number:
                low = middle + 1
            else:
                high = middle
        if not low:
            return None
        batch = self._batches[low - 1]
        row = number - batch.first
        if row >= len(batch):
            return None
        return Kept(
            int(batch.t[row]), int(batch.bus[row]), int(batch.id[row]), int(batch.flags[row]), batch.data(row),
            int(batch.verdict[row]),
        )  # fmt: skip

    def lines(self, wanted: Iterable[int], buses: Sequence[str]) -> tuple[str, ...]:
        """Return frames as `candump -l` writes them, without those that are gone, the first `MOST_LINES`."""
        found = []
        for number in wanted:
            kept = self.frame(number)
            if kept is not None:
                found.append(text(kept, buses[kept.bus]))
            if len(found) == MOST_LINES:
                break
        return tuple(found)


def text(frame: Kept, bus: str) -> str:
    """Return one frame in the form of candump's log files; without a time that part is left out."""
    wide = 8 if frame.flags & EXTENDED else 3
    if frame.flags & REMOTE:
        code = frame.flags >> _LENGTH_CODE & 0xF
        body = f"#R{code:X}" if code else "#R"
    elif frame.flags & FD:
        body = f"##{frame.flags >> _FD_FLAGS & 3:X}{frame.data.hex().upper()}"
    else:
        body = f"#{frame.data.hex().upper()}"
    when = "" if frame.t == NO_TIME else f"({frame.t // SECOND}.{frame.t % SECOND:09d}) "
    return f"{when}{bus} {frame.id:0{wide}X}{body}"
