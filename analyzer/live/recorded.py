"""What a recording gives back of rows: the form in which a live session has to decode and judge them.

No format holds every row just as it came: buses are numbered as they appear, names are made to fit, texts are bounded.
So that the findings of a session are those of `check` on its recording, the engine gets rows in the form in which a
reader would find them. Candump text is that form: rows are written as such and read again, and what comes of it goes
through MCAP and pcapng unchanged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer._native import Reader, Writer

if TYPE_CHECKING:
    from analyzer._native import Piece


class AsRecorded:
    """One for each session: numbers of buses and lines go on from piece to piece.

    Frames, error frames, drop counts and comments keep their order and their times; a comment loses its bus, and its
    text starts with `#`. A time before 1970 is none, and what is unreadable is left out: `lost` counts it.
    """

    def __init__(self) -> None:
        self._writer, self._reader = Writer("candump", recording=True), Reader("candump")

    def of(self, piece: Piece) -> Piece:
        """The rows of the next piece; its buses are numbered as in the pieces before."""
        self._reader.feed(self._writer.write(piece))
        return self._reader.take()

    @property
    def lost(self) -> dict[str, int]:
        """What does not go through so far, in words, and how often."""
        return self._writer.lost
