"""Where captures come from: files and pipes, unpacked on the way, each read by the reader of its format.

What a capture is, is read from its first bytes, then from its name (`formats`). A reader is one file: bytes in, candump
text or batches of rows out.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any

from analyzer.sources.errors import CaptureError as CaptureError
from analyzer.sources.errors import StopReading as StopReading
from analyzer.sources.errors import UnavailableError as UnavailableError
from analyzer.sources.errors import UnpackError
from analyzer.sources.formats import CANDUMP, LONGEST, UTF8_MARK, Format, detect
from analyzer.sources.stored import Stored
from analyzer.sources.text import text_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer._native import FrameBatch

    Read = Callable[["Source", Iterator[bytes]], Iterator[bytes | FrameBatch]]

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
    _unended: CaptureError | None = None

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
        """Nothing: only of merged captures things are asked for that may not be in them."""

    @property
    def unit(self) -> str:
        """The unit in which its rows are counted: line or record."""
        return self.format.unit

    def again(self) -> Source:
        """Return the same capture once more."""
        return Source(self.origin)

    def chunks(self) -> Iterator[bytes | FrameBatch]:
        """Candump text in chunks of any size, or batches of rows; an empty text says that nothing new has come yet.

        Raises `CaptureError` when nothing at all can be read.
        """
        with closing(self.stored()) as stored:
            yield from self._read(stored)

    def damaged(self, place: str, reason: str) -> None:
        """End the reading early, for this reason; the first one counts, and none if it was stopped on purpose."""
        if not self.stopped and self.damage is None:
            self.damage = CaptureError(self.name, place, reason)

    def take_last_line(self) -> None:
        """Take a last line for whole that has no line end: by its format nothing is missing."""
        if self.damage is self._unended:
            self.damage = None

    def _read(self, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
        head = data = b""
        for data in chunks:
            head += data
            if len(head) >= _HEAD:
                break
            if not data:
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
        self.format = detect(head.removeprefix(UTF8_MARK), self.name, stored=not self.live)
        if self.format.module is None:
            raise CaptureError(self.name, place, f"looks like {self.format.name}, which is not read")
        if self.format.unit == "line":
            chunks = text_of(self, chunks, self._cut)
        del head, data  # `chunks` has it, until it is taken
        yield from self.reader()(self, chunks)

    def _cut(self, size: int) -> None:
        place = f"byte {size}{' of the unpacked data' if self.packing else ''}"
        before = self.damage
        self.damaged(place, "the capture ends in the middle of a line")
        self._unended = self.damage if before is None else None

    def reader(self) -> Read:
        """Return the reading function of the format, imported only now: some need heavy packages."""
        module: Any = import_module(f"analyzer.sources.{self.format.module}")
        read: Read = module.read
        return read

    def _unpacked(self, chunks: Iterator[bytes]) -> Iterator[bytes]:
        from analyzer.sources import inflate, zstd  # noqa: PLC0415 - only what is needed

        unpack = inflate.inflate if self.packing == "gzip" else zstd.decompress
        try:
            yield from unpack(chunks)
        except UnpackError as error:
            self.damaged(f"byte {error.place}", error.reason)


def _is_zstd(head: bytes) -> bool:
    """Return whether it begins with a frame of zstd, or with one to skip, as parallel compressors write."""
    return head.startswith(ZSTD) or (head[1:4] == _SKIPPED and 0x50 <= head[0] <= 0x5F)
