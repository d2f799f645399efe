"""The recorder on the bus: frame numbers, lines, and the answers that point at them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MICROSECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.traffic import SimulatedFrame


# Frames of one answer that are listed, so that a day on a bus does not fill the memory.
MOST_LISTED = 1 << 17


class SimulatedRecorder:
    """A recorder that numbers frames as a reader does: error frames and broken lines take a line, but no number."""

    def __init__(self) -> None:
        self.frames = self.error_frames = self.unreadable = 0
        self.first: int | None = None
        self.last: int | None = None

    def record(self, frames: Iterable[SimulatedFrame]) -> Iterator[SimulatedFrame]:
        """Yield the frames that are recorded, numbered; what is lost on the way is left out."""
        for frame in frames:
            if frame.lost:
                continue
            if frame.garbled:
                self.unreadable += 1
            elif frame.error:
                self.error_frames += 1
            else:
                self.frames += 1
                frame.number = self.frames
            frame.t -= frame.shift
            frame.t -= frame.t % MICROSECOND  # what its line can say
            if self.first is None:
                self.first = frame.t
            self.last = frame.t
            if frame.answers or (frame.sending is not None and frame.sending.answers):
                self._answer(frame)
            yield frame

    def _answer(self, frame: SimulatedFrame) -> None:
        of_transfer = frame.sending.answers if frame.sending is not None else ()
        for answer in dict.fromkeys((*frame.answers, *of_transfer)):
            if not answer.frames and not answer.lines:
                answer.t = frame.t
            answer.t_end = frame.t
            numbered = not (frame.error or frame.garbled)
            listed = answer.frames if numbered else answer.lines
            if len(listed) < MOST_LISTED:
                line = self.frames + self.error_frames + self.unreadable
                listed.append(frame.number if numbered else line)
            else:
                answer.more += 1
