"""When somebody was there, in words: `all`, or from when, to when, or both."""

from __future__ import annotations

from typing import NamedTuple

from analyzer.views.times import TimeFormat
from dissectors.times import SECOND

_NEAR = 2 * SECOND  # as long as a first or last time counts as "start" or "end", in a long capture
_DAY = 86_400 * SECOND


class StayFormat(NamedTuple):
    """Writes times inside a capture; `absolute` ones have a date. Without `timed` there is nothing to say."""

    start: int | None
    end: int | None
    absolute: bool
    timed: bool

    def stay(self, first: int | None, last: int | None) -> str:
        """Write from when to when somebody was there."""
        began, ended = self.moment(first), self.moment(last)
        if (began, ended) == ("start", "end"):
            return "all"
        if began == ended:
            return began
        return f"to {ended}" if began == "start" else f"from {began}" if ended == "end" else f"{began} to {ended}"

    def moment(self, t: int | None) -> str:
        """Write one time: `start`, `end`, or when between them."""
        if t is None or self.start is None or self.end is None or not self.timed:
            return "-"
        near = min(_NEAR, (self.end - self.start) // 10)
        if t - self.start <= near:
            return "start"
        if self.end - t <= near:
            return "end"
        if not self.absolute:
            return f"{(t - self.start) / SECOND:.1f} s"
        if self.end - self.start < _DAY:
            return TimeFormat("a", digits=6).text(t)[:8]
        return TimeFormat("ad", digits=6).text(t)[5:16]
