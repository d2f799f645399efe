"""Many error frames in a short time."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from analyzer.rules.events import error_frames
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View


@dataclass(slots=True)
class _Burst:
    """Error frames of an interface within a second: their times and kinds, and all of them once there are many."""

    times: list[tuple[int, str]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)


class ErrorBursts(Rule):
    """A burst goes on while error frames come within a second of its first ones."""

    rules = ("BUS-005",)

    def __init__(self) -> None:
        self._bursts: dict[int, _Burst] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield the bursts that have ended."""
        events = view.events
        for row, bus, kind in error_frames(view):
            if events.t[row] != NO_TIME:
                yield from self._follow(bus, int(events.t[row]), kind, int(view.number("BUS-005", "errors_per_s")))

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield the bursts that go on to the end."""
        for bus, burst in self._bursts.items():
            if burst.kinds:
                yield _occurrence(bus, burst)

    def _follow(self, bus: int, t: int, kind: str, most: int) -> Iterator[Occurrence]:
        burst = self._bursts.setdefault(bus, _Burst())
        if burst.kinds:
            if t <= burst.times[0][0] + SECOND:
                burst.kinds[kind] += 1
                return
            yield _occurrence(bus, burst)
            burst = self._bursts[bus] = _Burst()
        burst.times = [one for one in burst.times if one[0] >= t - SECOND]
        burst.times.append((t, kind))
        if len(burst.times) > most:
            burst.kinds.update(kind for _, kind in burst.times)


def _occurrence(bus: int, burst: _Burst) -> Occurrence:
    kind = max(burst.kinds, key=lambda one: (burst.kinds[one], one))
    values = {"errors": burst.kinds.total(), "kind": kind}
    return Occurrence("BUS-005", burst.times[0][0], bus, None, "", (), values)
