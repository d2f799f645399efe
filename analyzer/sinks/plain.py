"""Formats without a trailer, candump text and pcapng: the native writer's bytes, as they come."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from analyzer._native import Writer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer._native import FrameBatch


class PlainSink:
    """Writes `candump` or `pcapng` to a file that is open; `recording` is that of the native writer."""

    def __init__(self, form: str, file: BinaryIO, *, recording: bool = False) -> None:
        self._writer, self._file = Writer(form, recording), file
        file.write(self._writer.start())

    @property
    def frames(self) -> int:
        """Frames written so far."""
        return self._writer.frames

    @property
    def held(self) -> int:
        """Nothing is held back."""
        return 0

    @property
    def lost(self) -> dict[str, int]:
        """The rows that the format could not hold so far, in words, and how often."""
        return self._writer.lost

    def write(self, batch: FrameBatch, comments: Mapping[int, str] | None = None) -> None:
        """Write the rows of a batch, with comments on its frames by row."""
        self._file.write(self._writer.write(batch, comments))

    def flush(self) -> None:
        """Hand everything to the system."""
        self._file.flush()

    def close(self) -> None:
        """Do nothing: there is nothing to add."""
