"""The sources of a run: captures, or the rows of a live session."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Protocol

from analyzer.facts.summary import StoredCapture

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer._native import FrameBatch
    from analyzer.sources import CaptureError
    from analyzer.sources.origin import FileObject


class SourcePart(StoredCapture, Protocol):
    """One of the captures that a source is made of."""

    hashed: bool
    damage: CaptureError | None

    @property
    def origin(self) -> str | FileObject:
        """The path or the object that it is read from."""


class RunSource(Protocol):
    """Where a run has its rows from: captures, or a bus."""

    stopped: bool

    @property
    def size(self) -> int:
        """Bytes read so far."""

    @property
    def length(self) -> int | None:
        """Bytes there are to read, if that is known."""

    @property
    def name(self) -> str:
        """All names."""

    @property
    def parts(self) -> Sequence[SourcePart]:
        """The captures that it is made of."""

    @property
    def live(self) -> bool:
        """True if some of the rows exist only once."""

    @property
    def waits(self) -> bool:
        """True while it would not notice `stopped`."""

    @property
    def damage(self) -> CaptureError | None:
        """The error that ended the reading early."""

    @property
    def problem(self) -> str | None:
        """After the reading: what was asked for and is not there."""

    def chunks(self) -> Iterator[bytes | FrameBatch]:
        """Yield candump text or rows; an empty text says that nothing new has come yet."""

    def again(self) -> RunSource:
        """Return the same once more, to be read anew; unless it is `live`."""


def are_files(source: RunSource) -> bool:
    """Return whether all of it stands in files, which can be read again."""
    # Path.is_file raises an error for a name that is too long.
    return all(isinstance(part.origin, str) and os.path.isfile(part.origin) for part in source.parts)  # noqa: PTH113
