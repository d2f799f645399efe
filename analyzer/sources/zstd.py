"""Zstandard as a stream: what can be unpacked is delivered, and damage has a place.

The blocks of a frame are found here (RFC 8878, 3.1.1), so that each call into the library unpacks one of them: at most
128 KiB come of it, and whatever a damaged block may be, those before it have been delivered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import zstandard

from analyzer.sources.errors import UnpackError
from analyzer.sources.unpack import unpack

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# What the zstd program takes without being asked; a frame that needs more is refused.
_WINDOW = 1 << 27
# Blocks are joined up to this size.
_STEP = 1 << 20
_MAGIC = 0xFD2FB528
_SKIPPABLE = 0x184D2A50
_RAW, _RLE = 0, 1
# Bytes of the dictionary number and of the content size, by the two bits that tell.
_NUMBER = (0, 1, 2, 4)
_LENGTH = (0, 2, 4, 8)


def decompress(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Unpack zstd frames that stand one after another, in parts of about 1 MiB; skippable frames are skipped.

    An empty piece (nothing new yet) is passed on. Raises `UnpackError` behind everything that was sound.
    """
    return unpack(pieces, _Stream())


class _Stream:
    """Where in which frame the reading stands: `_next` is for the part that begins at `_place`, of `_want` bytes."""

    def __init__(self) -> None:
        self._library = zstandard.ZstdDecompressor(max_window_size=_WINDOW)
        self._frame = self._library.decompressobj()
        self._held = b""
        self._place = self._frames = 0
        self._checksum = self._last = False
        self._kind = _RLE
        self._skip = 0
        self._want = 4
        self._next: Callable[[bytes], bytes] = self._magic

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Unpacks all parts that are whole by now."""
        data = self._held + data if self._held else data
        at, ready, size = 0, list[bytes](), 0
        try:
            while self._skip or len(data) - at >= self._want:
                if self._skip:
                    step = min(self._skip, len(data) - at)
                    if not step:
                        break
                    self._skip -= step
                    out = b""
                else:
                    step = self._want
                    out = self._next(data[at : at + step])
                at += step
                self._place += step
                if out:
                    ready.append(out)
                    size += len(out)
                if size >= _STEP:
                    yield b"".join(ready)
                    ready, size = [], 0
        except zstandard.ZstdError as error:
            yield from filter(None, [b"".join(ready)])
            raise UnpackError(self._place, f"damaged zstd data ({_words(error)})") from None
        except UnpackError:
            yield from filter(None, [b"".join(ready)])
            raise
        self._held = data[at:]
        yield from filter(None, [b"".join(ready)])

    def end(self) -> Iterator[bytes]:
        """Raise an error for what is unfinished; of a block that was not compressed its first part is there."""
        if not (self._held or self._skip or self._next != self._magic):
            return
        if self._next == self._content and self._kind == _RAW and self._held:
            yield from filter(None, [self._frame.decompress(self._held)])
        raise UnpackError(self._place + len(self._held), "zstd data ends early")

    def _expect(self, want: int, step: Callable[[bytes], bytes]) -> bytes:
        self._want, self._next = want, step
        return b""

    def _magic(self, data: bytes) -> bytes:
        magic = int.from_bytes(data, "little")
        if magic & ~0xF == _SKIPPABLE:
            return self._expect(4, self._skippable)
        if magic != _MAGIC:
            raise UnpackError(
                self._place, "data behind the end of the zstd data" if self._frames else "damaged zstd data (no frame)"
            )
        self._frame = self._library.decompressobj()
        self._frame.decompress(data)
        return self._expect(1, self._descriptor)

    def _skippable(self, data: bytes) -> bytes:
        self._skip = int.from_bytes(data, "little")
        self._frames += 1
        return self._expect(4, self._magic)

    def _descriptor(self, data: bytes) -> bytes:
        flags = data[0]
        single = bool(flags & 0x20)
        self._checksum = bool(flags & 4)
        size = _NUMBER[flags & 3] + (_LENGTH[flags >> 6] or single) + (not single)
        self._frame.decompress(data)
        return self._expect(size, self._header)

    def _header(self, data: bytes) -> bytes:
        self._expect(3, self._block)
        return self._frame.decompress(data)

    def _block(self, data: bytes) -> bytes:
        word = int.from_bytes(data, "little")
        self._last, self._kind = bool(word & 1), word >> 1 & 3
        self._expect(1 if self._kind == _RLE else word >> 3, self._content)
        out = self._frame.decompress(data)
        return out if self._want else out + self._content(b"")

    def _content(self, data: bytes) -> bytes:
        if not self._last:
            self._expect(3, self._block)
        elif self._checksum:
            self._expect(4, self._end)
        else:
            self._frames += 1
            self._expect(4, self._magic)
        return self._frame.decompress(data) if data else b""

    def _end(self, data: bytes) -> bytes:
        self._frames += 1
        self._expect(4, self._magic)
        return self._frame.decompress(data)


def _words(error: zstandard.ZstdError) -> str:
    text = str(error).rpartition(": ")[2]
    return text[:1].lower() + text[1:]
