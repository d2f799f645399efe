"""Chunks: their fields, their checksum, and their records unpacked within what they declare."""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import lz4.frame
import zstandard

from analyzer._native import crc32
from analyzer.sources.mcap.records import LIMIT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

_FIELDS = struct.Struct("<QQQII")
# Unpacking what may be damaged goes in steps, to have what stands before the damage; so does what takes long, to stop
# when that is asked for.
_STEP_IN, _STEP_OUT = 1 << 12, 1 << 17
_AT_ONCE = 1 << 24
_ERRORS = (zstandard.ZstdError, RuntimeError, MemoryError, EOFError)


@dataclass(frozen=True, slots=True)
class Chunk:
    """The fields of a chunk that matter; its records stand from `start` to `end`."""

    size: int
    crc: int
    compression: str
    start: int
    end: int

    @classmethod
    def read(cls, data: bytes, at: int) -> Chunk:
        """Read the body at `at`, whose lengths are known to fit."""
        *_, size, crc, name = _FIELDS.unpack_from(data, at)
        start = at + _FIELDS.size + name
        compression = data[start - name : start].decode(errors="backslashreplace")
        length = int.from_bytes(data[start : start + 8], "little")
        return cls(size, crc, compression, start + 8, start + 8 + length)

    def refused(self) -> str:
        """Why the chunk is not unpacked at all, in words; empty if it is."""
        if self.compression not in _UNPACK:
            return f"compression {self.compression[:20]!a} not known"
        if self.size > LIMIT:
            return f"would unpack to {self.size} bytes"
        return ""

    def records(self, stored: bytes, stopped: Callable[[], bool]) -> tuple[bytes, str]:
        """Return the records, never more than declared, and what is wrong with them; no matter what once stopped."""
        unpack, steps = _UNPACK[self.compression]
        data = None
        if self.size <= _AT_ONCE or not self.compression:
            with suppress(*_ERRORS):
                data = unpack(stored, self.size)
        if data is None:
            data, sound = _joined(steps(stored, self.size + 1), stopped)
            if not sound:
                return data, "cannot be unpacked"
        if self.compression and len(data) != self.size:
            return data, "unpacks to a size that it does not declare"
        if self.crc and crc32(data) != self.crc:
            return data, "checksum wrong"
        return data, ""

    def beginning(self, stored: bytes, stopped: Callable[[], bool]) -> tuple[bytes, str]:
        """Return them of a chunk whose end is missing: the checksum counts if nothing of the records is."""
        data, _ = _joined(_UNPACK[self.compression][1](stored, self.size), stopped)
        whole = len(data) == self.size
        return data, "checksum wrong" if whole and self.crc and crc32(data) != self.crc else ""


def _joined(parts: Iterable[bytes], stopped: Callable[[], bool]) -> tuple[bytes, bool]:
    """Return what the steps give, and whether all of them are sound; less once stopped."""
    out = BytesIO()
    try:
        for part in parts:
            out.write(part)
            if stopped():
                break
    except _ERRORS:
        return out.getvalue(), False
    return out.getvalue(), True


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
    while size and (part := reader.read(min(_STEP_OUT, size))):
        size -= len(part)
        yield part


def _lz4_steps(stored: bytes, size: int) -> Iterator[bytes]:
    frame = lz4.frame.LZ4FrameDecompressor()
    for at in range(0, len(stored), _STEP_IN):
        piece = stored[at : at + _STEP_IN]
        while size:
            part = frame.decompress(piece, max_length=min(_STEP_OUT, size))
            size -= len(part)
            yield part
            if frame.eof:
                piece = frame.unused_data or b""
                frame = lz4.frame.LZ4FrameDecompressor()
                if not piece:
                    break
            elif frame.needs_input or not part:
                break
            else:
                piece = b""


def _plain_steps(stored: bytes, size: int) -> Iterator[bytes]:
    yield stored[:size]


# At once, and in steps: those in front of damage are there before it raises.
_UNPACK: dict[str, tuple[Callable[[bytes, int], bytes], Callable[[bytes, int], Iterator[bytes]]]] = {
    "": (lambda stored, _: stored, _plain_steps),
    "zstd": (_zstd, _zstd_steps),
    "lz4": (_lz4, _lz4_steps),
}
