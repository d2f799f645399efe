"""Where captures come from: files and pipes, unpacked on the way, each read by the reader of its format.

What a capture is, is read from its first bytes, then from its name (`formats`). A reader is one file: bytes in, candump
text or pieces of rows out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING

from analyzer.sources.errors import CaptureError as CaptureError
from analyzer.sources.errors import StopReading as StopReading
from analyzer.sources.errors import UnpackError
from analyzer.sources.formats import CANDUMP, LONGEST, UTF8_MARK, Format, detect
from analyzer.sources.stored import Stored

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import Piece

GZIP, ZSTD = b"\x1f\x8b", b"\x28\xb5\x2f\xfd"
_SKIPPED = b"\x2a\x4d\x18"
_HEAD = max(LONGEST, len(ZSTD))


@dataclass(slots=True)
class Source(Stored):
    """One capture, read once: `Stored`, and what its bytes mean.

    After the last chunk `damage` is the error that ended the reading early, if one did: what stood before it has been
    delivered. `packing` is the compression around the capture, `notes` says what its format does not hold.
    """

    format: Format = CANDUMP
    packing: str = ""
    notes: list[str] = field(default_factory=list)

    @property
    def parts(self) -> tuple[Source, ...]:
        """The captures that make up this one: itself."""
        return (self,)

    @property
    def form(self) -> str:
        """The format in words."""
        return self.format.name + (f", {self.packing}" if self.packing else "")

    @property
    def problem(self) -> None:
        """What was asked for and is not in it: nothing was."""

    @property
    def unit(self) -> str:
        """What its rows are counted in: line or record."""
        return self.format.unit

    def again(self) -> Source:
        """The same capture once more."""
        return Source(self.name)

    def chunks(self) -> Iterator[bytes | Piece]:
        """Candump text in pieces of any size, or pieces of rows; an empty text says that nothing new has come yet.

        Raises `CaptureError` when nothing at all can be read.
        """
        yield from self._read(self.stored())

    def damaged(self, place: str, reason: str) -> None:
        """The reading ends early, for this reason; the first one counts, and none if it was stopped on purpose."""
        if not self.stopped and self.damage is None:
            self.damage = CaptureError(self.name, place, reason)

    def _read(self, chunks: Iterator[bytes]) -> Iterator[bytes | Piece]:
        head = b""
        for piece in chunks:
            head += piece
            if len(head) >= _HEAD:
                break
            if not piece:
                yield b""
        chunks = chain([head], chunks)
        packing = "gzip" if head.startswith(GZIP) else "zstd" if _is_zstd(head) else ""
        place = f"byte 0{' of the unpacked data' if self.packing else ''}"
        if packing and self.packing:
            raise CaptureError(self.name, place, f"looks like {packing} once more")
        if packing:
            self.packing = packing
            yield from self._read(self._unpacked(chunks))
            return
        self.format = detect(head.removeprefix(UTF8_MARK), self.name)
        if self.format.module is None:
            raise CaptureError(self.name, place, f"looks like {self.format.name}, which is not read")
        yield from self.format.reader()(self, chunks)

    def _unpacked(self, chunks: Iterator[bytes]) -> Iterator[bytes]:
        from analyzer.sources import inflate, zstd  # noqa: PLC0415 - only what is needed

        unpack = inflate.inflate if self.packing == "gzip" else zstd.decompress
        try:
            yield from unpack(chunks)
        except UnpackError as error:
            self.damaged(f"byte {error.place}", error.reason)


def _is_zstd(head: bytes) -> bool:
    """Whether it begins with a frame of zstd, or with one to skip, as parallel compressors write."""
    return head.startswith(ZSTD) or (head[1:4] == _SKIPPED and 0x50 <= head[0] <= 0x5F)
