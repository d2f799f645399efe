"""The head of statistics: which capture, which part of it, and how much of that was chosen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.views.info import duration
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

_YEAR_2000 = 946_684_800 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class StatHead:
    """A reading. `frames` and `transfers` are pairs: those chosen, and all. `repeated` frames are not among them.

    `start` and `end` are None without times, `timed` says that times can be compared with each other.
    """

    captures: Sequence[str]
    buses: Sequence[str]
    start: int | None
    end: int | None
    timed: bool
    filter: str | None
    window: Sequence[str]
    frames: tuple[int, int]
    transfers: tuple[int, int]
    repeated: int = 0

    def plain(self) -> Mapping[str, Any]:
        """Return it for JSON; times are nanoseconds."""
        return {
            "captures": list(self.captures),
            "buses": list(self.buses),
            "start_ns": self.start,
            "end_ns": self.end,
            "comparable": self.timed,
            "filter": self.filter,
            "window": list(self.window),
            "frames": self.frames[0],
            "all_frames": self.frames[1],
            "transfers": self.transfers[0],
            "all_transfers": self.transfers[1],
            "repeated_frames": self.repeated,
        }

    def lines(self) -> Iterator[str]:
        """Yield it for people."""
        yield f"{', '.join(map(escape, self.captures))}  {', '.join(map(escape, self.buses)) or 'no frames'}"
        yield self._span()
        if self.window:
            yield f"window  {'  '.join(map(escape, self.window))}"
        if self.filter is not None:
            yield f"filter  {escape(self.filter)}"
        yield f"{_of(self.frames, 'frames')}, {_of(self.transfers, 'transfers')}"
        if self.repeated:
            yield f"and {self.repeated} repeated frames, which another capture has too: counted once"

    def _span(self) -> str:
        if self.start is None or self.end is None:
            return "no times"
        if not self.timed:
            return "times of several kinds, which cannot be compared"
        length = duration(self.end - self.start)
        if self.start < _YEAR_2000:
            return f"{length}, times without a date"
        first, last = (TimeFormat("ad", digits=6).text(t)[:-3] for t in (self.start, self.end))
        day, _, hour = last.partition(" ")
        return f"{first} to {hour if first.startswith(day) else last} (local), {length}"


def _of(counts: tuple[int, int], noun: str) -> str:
    chosen, whole = counts
    return f"{chosen} of {whole} {noun}" if chosen != whole else f"{whole} {noun}"
