"""A live list whose filter asks for findings: its rows wait until rules may have named their frames."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING, Any

from analyzer.app.live.list import TransferList

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.decode.engine import Batch
    from analyzer.report.model import Finding
    from analyzer.rules.checking import Measured
    from analyzer.rules.named_frames import RecentNames

# Seconds that a row waits for findings that come later than itself, and frames that wait at most.
PATIENCE = 5.0
MOST_FRAMES = 1 << 18


class WaitingList(TransferList):
    """Lists each row once it has waited for `PATIENCE`, by what has been found until then.

    Args:
        names: knows the frames that rules name.
        now: seconds of a monotonic clock.
        more: what a `TransferList` takes, the matcher with these names.
    """

    def __init__(self, *given: Any, names: RecentNames, now: Callable[[], float] = time.monotonic, **more: Any) -> None:
        super().__init__(*given, **more)
        self._names, self._now = names, now
        self._waiting: deque[tuple[float, Batch]] = deque()
        self._frames = 0
        self._buses: Sequence[str] = ()

    def batch(self, measured: Measured) -> None:
        """Have its rows wait."""
        batch = measured.batch
        self._waiting.append((self._now(), batch))
        self._frames += len(batch.frames)
        self._buses = batch.buses

    def look(self, session: LiveSession) -> None:
        """List what has waited for long enough."""
        if self._due():
            self._know(session.newest.all)
        while self._due():
            self._release()
        super().look(session)

    def end(self, findings: Sequence[Finding]) -> None:
        """List what still waits."""
        self._know(findings)
        while self._waiting:
            self._release()
        super().end(findings)

    def _due(self) -> bool:
        if not self._waiting:
            return False
        return self._frames > MOST_FRAMES or self._now() - self._waiting[0][0] >= PATIENCE

    def _know(self, findings: Iterable[Finding]) -> None:
        place = {name: bus for bus, name in enumerate(self._buses)}
        self._names.keep((one.rule, place.get(one.bus, -1), -1 if one.node is None else one.node) for one in findings)

    def _release(self) -> None:
        _, batch = self._waiting.popleft()
        self._frames -= len(batch.frames)
        self._list(batch)
        self._names.forget(batch.first_frame - MOST_FRAMES)  # a transfer that is cut off is told long after its frames
