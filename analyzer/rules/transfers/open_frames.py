"""Frames of remainders that may get more of them, each in a slot that it keeps as long as its remainder is open."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.transfers.loose_frames import LooseFrames

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_LEAST = 64  # slots


class OpenFrames:
    """Slots of frames: there are twice as many when they do not suffice."""

    def __init__(self) -> None:
        self._frames = LooseFrames.blank(_LEAST)

    def put(self, slots: Array, frames: LooseFrames) -> None:
        """Put frames into slots, the highest of which may be new."""
        most = int(slots.max(initial=-1))
        while most >= len(self._frames):
            self._frames = LooseFrames.behind_each_other((self._frames, LooseFrames.blank(len(self._frames))))
        self._frames.put(slots, frames)

    def take(self, slots: Array) -> LooseFrames:
        """Return the frames in some slots, which are free then."""
        found = self._frames.take(slots)
        self._frames.clear(slots)
        return found

    def keep_lines(self, view: View) -> None:
        """Keep the lines of all frames."""
        self._frames.keep_lines(view)
