"""Trouble of buses and recorders: bursts of error frames, states of the controller, frames that were lost."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.error_frames import kind_of
from analyzer.facts.traffic import times
from analyzer.flight.log import FlightEvent
from analyzer.flight.thresholds import lasting
from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, Spot

_ERROR_FRAME, _DROP = EVENTS.index("error frame"), EVENTS.index("drop")
_STATES = ("bus-off", "restarted", "transmit passive", "receive passive", "error active again")
_MOST_WORDS = 64


@dataclass(slots=True)
class _Burst:
    """Error frames of a bus, or losses of the recorder, that lie close together."""

    first: Spot
    last: Spot
    count: int = 0
    words: Counter[str] = field(default_factory=Counter)


class TroubleEvents:
    """Adds up batches; bounded by the buses that there can be.

    Args:
        clock: of the capture, fed before.
        add: takes the events.
    """

    def __init__(self, clock: RecordedClock, add: Callable[[FlightEvent], None]) -> None:
        self._clock, self._add = clock, add
        self._bursts: dict[tuple[int, int], _Burst] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        events = batch.events
        kind = numbers(events.column("kind"))
        t, timed = times(events)
        rows = np.flatnonzero(timed & np.isin(kind, (_ERROR_FRAME, _DROP)))
        if not len(rows):
            return
        lines = numbers(batch.frames.column("line"))
        frame = batch.first_frame + np.searchsorted(lines, numbers(events.column("line"))[rows])
        at = self._clock.shifted(t[rows], frame)
        bus, what = numbers(events.column("bus"))[rows], numbers(events.column("class"))[rows]
        data = events.column("data").take(rows).to_pylist()
        for k, kind_ in enumerate(kind[rows].tolist()):
            spot = at.at(k)
            if kind_ == _DROP:
                self._note(int(bus[k]), _DROP, spot, int(what[k]), "")
                continue
            word = kind_of(int(what[k]), data[k] or b"")
            self._note(int(bus[k]), _ERROR_FRAME, spot, 1, word)
            for state in _STATES:
                if state in word:
                    self._add(FlightEvent("bus state", f"the controller is {state}", spot, spot, bus=int(bus[k])))

    def finish(self) -> None:
        """Tell the last ones."""
        for (bus, kind), burst in self._bursts.items():
            self._tell(bus, kind, burst)

    def _note(self, bus: int, kind: int, spot: Spot, count: int, word: str) -> None:
        burst = self._bursts.get((bus, kind))
        if burst is not None and spot.ran - burst.last.ran > lasting("burst"):
            self._tell(bus, kind, burst)
            burst = None
        if burst is None:
            burst = self._bursts[bus, kind] = _Burst(spot, spot)
        burst.last = spot
        burst.count += count
        if word in burst.words or len(burst.words) < _MOST_WORDS:
            burst.words[word] += 1

    def _tell(self, bus: int, kind: int, burst: _Burst) -> None:
        after = burst.last if burst.last.ran > burst.first.ran else None
        if kind == _DROP:
            name, text = "loss", f"the recorder says that it lost {burst.count} frames"
        else:
            words = ", ".join(word for word, _ in burst.words.most_common(3))
            name, text = "errors", f"{burst.count} error frame{'s' * (burst.count > 1)}: {words}"
        self._add(FlightEvent(name, text, burst.first, burst.first, after, bus, values={"count": burst.count}))
