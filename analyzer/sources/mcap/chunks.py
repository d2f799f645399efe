"""Chunks: their fields, their checksum, and their records unpacked within what they declare."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import lz4.frame
import zstandard

from analyzer._native import crc32
from analyzer.sources.mcap.records import LIMIT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_FIELDS = struct.Struct("<QQQII")
# Unpacking what may be damaged goes in steps, to have what stands before the damage.
_STEP_IN, _STEP_OUT = 1 << 12, 1 << 17
_ERRORS = (zstandard.ZstdError, RuntimeError, MemoryError, EOFError)


@dataclass(frozen=True, slots=True)
class Chunk:
    """The fields of a chunk that matter; `start` is where its records begin in the body."""

    size: int
    crc: int
    compression: str
    start: int

    @classmethod
    def read(cls, data: bytes, at: int) -> Chunk:
        """Reads the body at `at`, whose lengths are known to fit."""
        *_, size, crc, name = _FIELDS.unpack_from(data, at)
        start = at + _FIELDS.size + name
        return cls(size, crc, data[start - name : start].decode(errors="backslashreplace"), start + 8)

    def refused(self) -> str:
        """Why the chunk is not unpacked at all, in words; empty if it is."""
        if self.compression not in _UNPACK:
            return f"compression {self.compression[:20]!a} not known"
        if self.size > LIMIT:
            return f"would unpack to {self.size} bytes"
        return ""

    def records(self, stored: bytes) -> tuple[bytes, str]:
        """The records, never more than declared, and what is wrong with them in words."""
        unpack, steps = _UNPACK[self.compression]
        try:
            data = unpack(stored, self.size)
        except _ERRORS:
            return b"".join(steps(stored, self.size)), "cannot be unpacked"
        if self.compression and len(data) != self.size:
            return data, "unpacks to a size that it does not declare"
        if self.crc and crc32(data) != self.crc:
            return data, "checksum wrong"
        return data, ""

    def beginning(self, stored: bytes) -> tuple[bytes, str]:
        """The same for a chunk whose end is missing: the checksum counts if nothing of the records is."""
        data = b"".join(_UNPACK[self.compression][1](stored, self.size))
        whole = len(data) == self.size
        return data, "checksum wrong" if whole and self.crc and crc32(data) != self.crc else ""


def _zstd(stored: bytes, size: int) -> bytes:
    """Single frames that state their size at once, all others (or none) step by step."""
    stated = zstandard.frame_content_size(stored) if stored else -1
    if 0 <= stated == size:
        return zstandard.ZstdDecompressor().decompress(stored)
    with zstandard.ZstdDecompressor().stream_reader(stored, read_across_frames=True) as reader:
        data = bytearray()
        while part := reader.read(min(_STEP_OUT, size + 1 - len(data))):
            data += part
        return bytes(data)


def _lz4(stored: bytes, size: int) -> bytes:
    out = [b""]
    left = size + 1
    while stored and left:
        frame = lz4.frame.LZ4FrameDecompressor()
        out.append(frame.decompress(stored, max_length=left))
        left -= len(out[-1])
        stored = frame.unused_data or b"" if frame.eof else b""
    return out[-1] if len(out) == 2 else b"".join(out)


def _zstd_steps(stored: bytes, size: int) -> Iterator[bytes]:
    reader = zstandard.ZstdDecompressor().stream_reader(stored, read_across_frames=True)
    try:
        while size and (part := reader.read(min(_STEP_OUT, size))):
            size -= len(part)
            yield part
    except _ERRORS:
        return


def _lz4_steps(stored: bytes, size: int) -> Iterator[bytes]:
    frame = lz4.frame.LZ4FrameDecompressor()
    try:
        for at in range(0, len(stored), _STEP_IN):
            piece = stored[at : at + _STEP_IN]
            while size and not frame.eof:
                part = frame.decompress(piece, max_length=min(_STEP_OUT, size))
                size -= len(part)
                yield part
                if frame.needs_input or not part:
                    break
                piece = b""
    except _ERRORS:
        return


def _plain_steps(stored: bytes, size: int) -> Iterator[bytes]:
    yield stored[:size]


# At once, and in steps that come through if the data is damaged behind them.
_UNPACK: dict[str, tuple[Callable[[bytes, int], bytes], Callable[[bytes, int], Iterator[bytes]]]] = {
    "": (lambda stored, _: stored, _plain_steps),
    "zstd": (_zstd, _zstd_steps),
    "lz4": (_lz4, _lz4_steps),
}
