"""Times of a report that is the same wherever it is made: UTC, or seconds where the capture has no calendar."""

from __future__ import annotations

from datetime import UTC, datetime

from dissectors.records import dataclass
from dissectors.times import SECOND

MISSING = "-"
_YEAR_2000, _YEAR_2262 = 946_684_800 * SECOND, 1 << 63  # times outside are no calendar, but counted from some start
_MINUTE, _HOUR, _DAY = 60 * SECOND, 3600 * SECOND, 86400 * SECOND
_STEPS = (
    *(digit * 10**power for power in range(10) for digit in (1, 2, 5)),
    *(n * SECOND for n in (10, 15, 30)),
    *(n * _MINUTE for n in (1, 2, 5, 10, 15, 30)),
    *(n * _HOUR for n in (1, 2, 3, 6, 12)),
    *(n * _DAY for n in (1, 2, 7, 30, 365, 3650, 36500)),
)
_TICKS = 6


def on_calendar(ns: int) -> bool:
    """Return True if a time counts from 1970, and not from the start of its recorder."""
    return _YEAR_2000 <= ns < _YEAR_2262


def moment(ns: int | None) -> str:
    """Write date and time of day to the microsecond, or seconds."""
    return _written(ns, "%Y-%m-%d %H:%M:%S", 6)


def clock(ns: int | None, digits: int = 3) -> str:
    """Write the time of day alone, or seconds, cut to `digits` decimals."""
    return _written(ns, "%H:%M:%S", digits)


def _written(ns: int | None, form: str, digits: int) -> str:
    if ns is None:
        return MISSING
    second, rest = divmod(abs(ns), SECOND)
    decimals = f".{rest:09d}"[: digits + 1] if digits else ""
    if on_calendar(ns):
        return f"{datetime.fromtimestamp(second, UTC):{form}}{decimals}"
    return f"{'-' if ns < 0 else ''}{second}{decimals} s"


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of time that a plot shows from its left to its right edge; at least a millisecond."""

    start: int
    end: int

    def share(self, ns: int) -> float:
        """Return where a time lies between 0 and 100; what lies outside is put on the edge."""
        length = max(self.end - self.start, SECOND // 1000)
        return 100 * min(max(ns - self.start, 0), length) / length

    def ticks(self) -> list[tuple[float, str]]:
        """Return round times inside, as share and label."""
        length = max(self.end - self.start, SECOND // 1000)
        step = next((step for step in _STEPS if length <= step * _TICKS), length)
        digits = 0 if step >= SECOND else 3 if step >= SECOND // 1000 else 9
        times = range(-(-self.start // step) * step, self.start + length + 1, step)
        return [(self.share(t), _day(t) if step >= _DAY and on_calendar(t) else clock(t, digits)) for t in times]


def _day(ns: int) -> str:
    return f"{datetime.fromtimestamp(ns // SECOND, UTC):%Y-%m-%d}"
