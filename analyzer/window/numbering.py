"""Numbers of frames as people are shown them: those of the capture, or Wireshark's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.places import Places
    from dissectors.kit import Array

_ERROR_FRAME = EVENTS.index("error frame")


class Numbering:
    """Turns places of frames in a capture (from 0) into numbers (from 1).

    Args:
        wireshark: count error frames, too, as Wireshark does.
    """

    def __init__(self, *, wireshark: bool = False) -> None:
        self.wireshark = wireshark
        self.picked: Places | None = None  # where frames stand in the capture that they were picked from
        self._places = np.zeros(0, np.int64)  # of frames that error frames come directly before
        self._errors = np.zeros(1, np.int64)  # up to and with each of them

    def feed(self, first: int, frames: pa.RecordBatch, events: pa.RecordBatch) -> None:
        """Take the frames and events of the next batch; `first` is the place of its first frame."""
        if self.wireshark and len(events):
            places, counts = np.unique(_places(first, frames, events), return_counts=True)
            self._places = np.concatenate((self._places, places))
            self._errors = np.concatenate((self._errors, self._errors[-1] + np.cumsum(counts)))

    def of(self, place: int) -> int:
        """Return the number of a frame."""
        return int(self.of_all(np.array([place]))[0]) if self.wireshark else place + 1

    def of_all(self, places: Array) -> Array:
        """Return the numbers of frames."""
        if self.picked is not None:
            places = np.fromiter(map(self.picked.of, np.asarray(places).tolist()), np.int64)
        found: Array = np.asarray(places, np.int64) + 1
        if self.wireshark:
            found += self._errors[np.searchsorted(self._places, places, "right")]
        return found

    def of_errors(self, first: int, frames: pa.RecordBatch, events: pa.RecordBatch) -> Array:
        """Return the numbers of a batch's error frames, in order: none if they are not counted."""
        if not self.wireshark or not len(events):
            return np.zeros(0, np.int64)
        places = _places(first, frames, events)
        rank = np.arange(len(places)) - np.searchsorted(places, places)
        found: Array = places + self._errors[np.searchsorted(self._places, places)] + rank + 1
        return found


def _places(first: int, frames: pa.RecordBatch, events: pa.RecordBatch) -> Array:
    """Return the places of the frames that error frames come before."""
    lines = numbers(events.column("line"))[numbers(events.column("kind")) == _ERROR_FRAME]
    found: Array = first + np.searchsorted(numbers(frames.column("line")), lines)
    return found
