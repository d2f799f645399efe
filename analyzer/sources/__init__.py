"""Where captures come from: bytes of a file, a pipe or a growing file, decompressed on the way.

What a capture is, is read from its first bytes, never from its name alone.
"""

from __future__ import annotations

import hashlib
import sys
import time
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

CHUNK = 1 << 20
FOLLOW_PAUSE = 0.1


_GZIP = b"\x1f\x8b"
_OTHERS = {
    b"\x89MCAP0\r\n": "MCAP",
    b"\n\r\r\n": "pcapng",
    b"\xd4\xc3\xb2\xa1": "pcap",
    b"\xa1\xb2\xc3\xd4": "pcap",
    b"\x4d\x3c\xb2\xa1": "pcap",
    b"\xa1\xb2\x3c\x4d": "pcap",
    b"LOGG": "Vector BLF",
    b"MDF     ": "MDF 4",
    b"\x28\xb5\x2f\xfd": "zstd",
}


class CaptureError(Exception):
    """A capture that cannot be read, or not to its end; says which, where and why."""

    def __init__(self, name: str, place: str, reason: str) -> None:
        super().__init__(f"{name}: {place}: {reason}" if place else f"{name}: {reason}")


@dataclass(slots=True)
class Source:
    """One capture, read once.

    After the last chunk, `size` and `digest` are those of the bytes as stored, and `damage` is the error that ended the
    reading early, if one did: what stood before it has been delivered.
    """

    name: str
    follow: bool = False
    size: int = 0
    compressed: bool = False
    damage: CaptureError | None = None
    hashed: bool = False
    _sha: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """SHA-256 of the stored bytes read so far, in hexadecimal; only if `hashed` asked for it."""
        return self._sha.hexdigest()

    def chunks(self) -> Iterator[bytes]:
        """The text, in pieces of any size. Raises `CaptureError` when not even the first byte can be had."""
        with self._open() as file:
            stored = self._stored(file)
            first = next(stored, b"")
            while first and len(first) < 8 and (more := next(stored, b"")):
                first += more
            for magic, what in _OTHERS.items():
                if first.startswith(magic):
                    raise CaptureError(self.name, "byte 0", f"looks like {what}, expected candump text")
            if first.startswith(_GZIP):
                self.compressed = True
                yield from self._inflate(first, stored)
            elif first:
                yield first
                yield from stored

    def _open(self) -> BinaryIO:
        if self.name == "-":
            return open(sys.stdin.fileno(), "rb", buffering=0, closefd=False)  # noqa: PTH123 - a descriptor, not a path
        try:
            if Path(self.name).is_dir():
                raise CaptureError(self.name, "", "is a directory")
            return Path(self.name).open("rb", buffering=0)
        except OSError as error:
            raise CaptureError(self.name, "", error.strerror or str(error)) from None
        except ValueError as error:  # a NUL byte in the name
            raise CaptureError(self.name.replace("\0", "\\0"), "", str(error)) from None

    def _stored(self, file: BinaryIO) -> Iterator[bytes]:
        """The bytes as they are stored; with `follow` it waits at the end for more, as `tail -f` does."""
        while True:
            try:
                data = file.read(CHUNK)
            except OSError as error:
                self.damage = CaptureError(self.name, f"byte {self.size}", error.strerror or str(error))
                return
            if data:
                self.size += len(data)
                if self.hashed:
                    self._sha.update(data)
                yield data
            elif not self.follow:
                return
            else:
                yield b""
                time.sleep(FOLLOW_PAUSE)
                self._reopen_if_shrunk(file)

    def _reopen_if_shrunk(self, file: BinaryIO) -> None:
        """A log that was emptied and is written anew is read from its start."""
        if file.seekable() and file.seek(0, 2) < self.size:
            file.seek(0)
            self.size = 0
        elif file.seekable():
            file.seek(self.size)

    def _inflate(self, first: bytes, stored: Iterator[bytes]) -> Iterator[bytes]:
        """Gzip members one after another; never more than a chunk in memory, however much it unpacks to."""
        inflater = zlib.decompressobj(wbits=31)
        waiting = first
        while True:
            try:
                out = inflater.decompress(waiting, CHUNK)
            except zlib.error as error:
                self.damage = CaptureError(self.name, f"before byte {self.size}", f"damaged gzip data ({error})")
                return
            yield out
            if inflater.eof:
                waiting = inflater.unused_data.lstrip(b"\0") or next(stored, b"")
                if not waiting:
                    return
                inflater = zlib.decompressobj(wbits=31)
            else:
                waiting = inflater.unconsumed_tail or next(stored, b"")
                if not waiting and not out:
                    self.damage = CaptureError(self.name, f"byte {self.size}", "gzip data ends early")
                    return
