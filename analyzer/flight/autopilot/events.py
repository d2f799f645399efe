"""An autopilot's words as events of the flight, on the time axis of the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.flight.autopilot.alignment import Alignment, align, given
from analyzer.flight.autopilot.side import side_of
from analyzer.flight.autopilot.track import CommandTrack
from analyzer.flight.autopilot.words import words
from analyzer.flight.clock import Spot
from analyzer.flight.log import FlightEvent
from analyzer.flight.thresholds import lasting
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.autopilot.side import AutopilotSide
    from analyzer.flight.autopilot.words import Word
    from analyzer.flight.reports import EventOrder
    from analyzer.sources.dataflash import AutopilotLog

AUTOPILOT = "autopilot"
_NO_FRAME = -(1 << 62)  # with the number of the record behind it: words of one time stay in the order of the log


class AutopilotEvents:
    """Follows the commands of a bus, and adds what the autopilot's log says, if that can be aligned with them.

    After `finish`, `alignment` says how it lies, `side` what it measured, and `notes` what people should know.
    """

    def __init__(self, log: AutopilotLog, order: EventOrder) -> None:
        self.alignment: Alignment | None = None
        self.side: AutopilotSide | None = None
        self.notes: list[str] = []
        self._log, self._clock, self._add = log, order.clock, order.add
        self._track = CommandTrack(order)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if self._log.given is None:
            self._track.feed(batch)

    def finish(self) -> None:
        """Align the log, and tell what it says around the capture."""
        start, end = self._clock.start, self._clock.last
        if start is None or end is None:
            self.alignment = Alignment((), "outputs", "the capture has no times: nothing to align it with")
        elif self._log.given is not None:
            holes = [(one.t, one.t_end) for one in self._clock.holes if one.length >= 0]
            self.alignment = given(self._log.given, start, end, holes)
        else:
            self.alignment = align(self._log, self._track.pieces(), start)
        if not self.alignment.parts:
            return
        self.side = side_of(self._log, self.alignment)
        self.notes.append(f"{self._log.name}: {self.alignment.text}")
        far = sum(not self._told(word, self.alignment) for word in words(self._log))
        if far:
            away = f"more than {lasting('words_around') / SECOND:.0f} s before or behind the capture"
            self.notes.append(f"not told of it, from {away}: {far}")

    def plain(self) -> dict[str, Any] | None:
        """Return the alignment as plain data, after `finish`."""
        return None if self.alignment is None else self.alignment.plain(self._log.name)

    def _told(self, word: Word, alignment: Alignment) -> bool:
        """Tell a word; return whether it is near enough to the capture."""
        part = alignment.part(word.micros)
        t, error = part.time(word.micros)
        if not part.start - lasting("words_around") <= t <= part.end + lasting("words_around"):
            return False

        def spot(at: int) -> Spot:
            ran = int(part.recorded(np.array([at]))[0])
            return Spot(at, ran, _NO_FRAME + word.number, _NO_FRAME + word.number, 0)

        after = None if word.until is None else spot(part.time(word.until)[0])
        self._add(FlightEvent(
            word.kind, word.text, spot(t - error), spot(t + error), after, type=word.type, values=word.values,
            source=AUTOPILOT,
        ))  # fmt: skip
        return True
