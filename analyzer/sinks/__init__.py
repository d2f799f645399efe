"""Targets of captures: batches of rows to the bytes of a format, one file a format.

A sink counts in words what its format cannot hold; nothing is left out in silence.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, BinaryIO, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer._native import FrameBatch

ALL = "all"  # among names of tables: every one but those that have to be asked for
FORMS = ("candump", "mcap", "pcapng")
COMPRESSIONS = ("none", "lz4", "zstd")
_SUFFIXES = {".candump": "candump", ".log": "candump", ".txt": "candump", ".mcap": "mcap", ".pcapng": "pcapng"}
_PACKINGS = {".gz": "gzip", ".zst": "zstd"}


class Sink(Protocol):
    """Takes a capture batch by batch."""

    @property
    def frames(self) -> int:
        """Frames written so far."""

    @property
    def held(self) -> int:
        """Bytes that are held back, more or less."""

    @property
    def lost(self) -> dict[str, int]:
        """The rows that the format could not hold so far, in words, and how often."""

    def write(self, batch: FrameBatch, comments: Mapping[int, str] | None = None) -> None:
        """Write the rows of a batch, with comments on its frames by row; it may hold some back."""

    def flush(self) -> None:
        """Write what is held back, so that a reader finds it even if nothing follows."""

    def close(self) -> None:
        """Write the end of the capture. The file stays open."""


def form_of(path: str) -> tuple[str, str]:
    """Return the format that a file name asks for, and the packing around it; empty where it asks for none."""
    name = PurePath(path.lower())
    packing = _PACKINGS.get(name.suffix, "")
    return _SUFFIXES.get(PurePath(name.stem).suffix if packing else name.suffix, ""), packing


def open_sink(form: str, file: BinaryIO, *, compression: str = "zstd", recording: bool = False) -> Sink:
    """Open a sink of one of `FORMS` that writes to `file`; `compression` (of `COMPRESSIONS`) is for MCAP chunks.

    In a `recording` of a live bus no line of candump text depends on those before it.
    """
    if form == "mcap":
        from analyzer.sinks.mcap import McapSink  # noqa: PLC0415 - the mcap package takes its time

        return McapSink(file, compression)
    from analyzer.sinks.plain import PlainSink  # noqa: PLC0415

    return PlainSink(form, file, recording=recording)


def split_name(path: str) -> tuple[str, str]:
    """Return a path in front of the suffix that names its format, with that of its packing; and those suffixes."""
    name = PurePath(path).name
    stem = name[: -len(PurePath(name).suffix) or None]
    if PurePath(name.lower()).suffix in _PACKINGS:
        stem = stem[: -len(PurePath(stem).suffix) or None]
    suffix = name[len(stem) :]
    return path[: len(path) - len(suffix)], suffix


def losses(lost: dict[str, int]) -> str:
    """Say what a format could not hold, in one line; empty if it held everything."""
    return "; ".join(f"{words} ({count})" for words, count in lost.items())
