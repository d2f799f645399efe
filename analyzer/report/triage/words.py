"""Times and names in the texts of triage, the same in all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.views.times import TimeFormat
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.odd.judge import OddEsc
    from analyzer.flight.verdict.model import Triage, Verdict

_YEAR_2000 = 946_684_800 * SECOND
_BY_TEXT = frozenset({"fault", "message", "parameter", "save"})  # kinds that are the same only in the same words


class TriageWords:
    """Writes times of day to the millisecond, or seconds from the start where the capture has no date."""

    def __init__(self, found: Triage, *, utc: bool = True) -> None:
        start = found.start or 0
        self._start, self._dated = start, start >= _YEAR_2000
        self._zone = "UTC" if utc else "local"
        self._clock = TimeFormat("u" if utc else "a", digits=6)
        self._day = TimeFormat("ud" if utc else "ad", digits=6)

    def time(self, t: int | None) -> str:
        """Return a time."""
        if t is None:
            return "-"
        return self._clock.text(t)[:-3] if self._dated else f"{(t - self._start) / SECOND:.3f} s"

    def span(self, found: Triage) -> str:
        """Return from when to when a capture goes."""
        if found.start is None or found.end is None:
            return "no times" if found.frames else "no frames"
        if not self._dated:
            return f"{(found.end - found.start) / SECOND:.1f} s, without a date"
        return f"{self._day.text(found.start)[:-7]}-{self._clock.text(found.end)[:-7]} {self._zone}"

    def when(self, verdict: Verdict) -> str:
        """Return the interval of a verdict: last good report, first bad one."""
        if verdict.t_end is None:
            return ""
        if verdict.t is None or verdict.t == verdict.t_end:
            return self.time(verdict.t_end)
        if verdict.t_end - verdict.t < MILLISECOND:
            return self.time(verdict.t_end)
        return f"{self.time(verdict.t)} to {self.time(verdict.t_end)}  (last good report, first bad one)"


def who(event: FlightEvent) -> str:
    """Return of whom an event is."""
    if event.ch is not None:
        return f"ch{event.ch}"
    return "" if event.node is None else f"node {event.node}"


def together(events: Sequence[FlightEvent]) -> Iterator[tuple[FlightEvent, str]]:
    """Yield events, and of whom they are: what befalls several within half a second is one."""
    open_: list[tuple[FlightEvent, list[str]]] = []
    for one in events:
        for first, whose in open_:
            same = (first.kind, _gist(first)) == (one.kind, _gist(one))
            if same and one.first.ran - first.first.ran < SECOND // 2:
                if who(one) not in whose:
                    whose.append(who(one))
                break
        else:
            open_.append((one, [who(one)]))
    yield from ((one, " ".join(sorted(filter(None, whose)))) for one, whose in open_)


def _gist(one: FlightEvent) -> tuple[str, str]:
    """Return what has to be alike in events that are told as one."""
    return one.type, one.text if one.kind in _BY_TEXT else one.sign


def odd_who(odd: OddEsc) -> str:
    """Return which ESC is odd."""
    return f"ch{odd.ch}" if odd.ch is not None else f"node {odd.node}"
