"""Where captures come from: bytes of a file, a pipe or a growing file, decompressed on the way.

What a capture is, is read from its first bytes, never from its name alone.
"""

from __future__ import annotations

import hashlib
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from select import select
from typing import TYPE_CHECKING, BinaryIO

from analyzer.sources.inflate import MAGIC as GZIP
from analyzer.sources.inflate import GzipError, inflate

if TYPE_CHECKING:
    from collections.abc import Iterator

CHUNK = 1 << 20
FOLLOW_PAUSE = 0.1
# A pipe that gave this much at once has more to give.
_FULL_PIPE = 1 << 16

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
    b"\xfd7zXZ\0": "xz",
    b"BZh": "bzip2",
    b"PK\x03\x04": "zip",
    b"\xff\xfe": "UTF-16 text",
    b"\xfe\xff": "UTF-16 text",
}
_LONGEST = max(map(len, _OTHERS))
_UTF8_MARK = b"\xef\xbb\xbf"


class CaptureError(Exception):
    """A capture that cannot be read, or not to its end; says which, where and why."""

    def __init__(self, name: str, place: str, reason: str) -> None:
        super().__init__(f"{name}: {place}: {reason}" if place else f"{name}: {reason}")


class StopReading(BaseException):
    """Raised into a source that waits, by a signal handler: the capture ends with what has come so far."""


@dataclass(slots=True)
class Source:
    """One capture, read once.

    Args:
        name: a path, `-` is standard input.
        follow: at the end of a file it waits for more, and an empty chunk says that nothing is left to read at the
            moment. A pipe is followed to its end.

    After the last chunk, `size` and `digest` are those of the bytes as stored, and `damage` is the error that ended the
    reading early, if one did: what stood before it has been delivered. Setting `stopped` ends the reading; while
    `waits` is true, raising `StopReading` does the same. `live` is true when the bytes exist only once.
    """

    name: str
    follow: bool = False
    size: int = 0
    compressed: bool = False
    damage: CaptureError | None = None
    hashed: bool = False
    live: bool = False
    stopped: bool = False
    waits: bool = False
    _last: bytes = b""
    _sha: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """SHA-256 of the stored bytes read so far, in hexadecimal; only if `hashed` asked for it."""
        return self._sha.hexdigest()

    def chunks(self) -> Iterator[bytes]:
        """The text, in pieces of any size. Raises `CaptureError` when not even the first byte can be had."""
        try:
            with self._waiting():
                file = self._open()
        except StopReading:
            self.stopped = True
            return
        with file:
            self.live = self.follow or not file.seekable()
            yield from self._text(self._stored(file))

    def _open(self) -> BinaryIO:
        try:
            if self.name == "-":
                return open(0, "rb", buffering=0, closefd=False)
            if Path(self.name).is_dir():
                raise CaptureError(self.name, "", "is a directory")
            return Path(self.name).open("rb", buffering=0)
        except OSError as error:
            raise CaptureError(self.name, "", error.strerror or str(error)) from None
        except ValueError as error:  # a NUL byte in the name
            raise CaptureError(self.name.replace("\0", "\\0"), "", str(error)) from None

    def _text(self, pieces: Iterator[bytes], *, unpacked: bool = False) -> Iterator[bytes]:
        """Looks at the first bytes: gzip is unpacked (once), what is surely no text is refused."""
        head = b""
        for piece in pieces:
            head += piece
            if len(head) >= _LONGEST:
                break
            if not piece:
                yield b""
        what = next((name for magic, name in _OTHERS.items() if head.startswith(magic)), None)
        if what is None and unpacked and head.startswith(GZIP):
            what = "gzip once more"
        if what is not None:
            place = "byte 0 of the unpacked data" if unpacked else "byte 0"
            raise CaptureError(self.name, place, f"looks like {what}, expected candump text")
        if head.startswith(GZIP):
            self.compressed = True
            yield from self._text(self._inflated(chain([head], pieces)), unpacked=True)
            return
        if text := head.removeprefix(_UTF8_MARK):
            yield text
        yield from pieces

    def _inflated(self, pieces: Iterator[bytes]) -> Iterator[bytes]:
        try:
            yield from inflate(pieces)
        except GzipError as error:
            # What ends early because the reading was stopped is not damaged; a read error has been noted already.
            if not self.stopped and self.damage is None:
                self.damage = CaptureError(self.name, f"byte {error.place}", error.reason)

    def _stored(self, file: BinaryIO) -> Iterator[bytes]:
        """The bytes as they are stored; with `follow` it waits at the end for more, as `tail -f` does.

        Once stopped, only what lies ready is read: a file that is followed up to its end, a pipe once.
        """
        pipe = not file.seekable()
        while self.live or not self.stopped:
            last = self.stopped
            if pipe and not self._ready(file, 0 if last else None):
                if last:
                    return
                continue
            try:
                data = file.read(CHUNK)
            except OSError as error:
                self.damage = CaptureError(self.name, f"byte {self.size}", error.strerror or str(error))
                return
            if data:
                self._count(data)
                yield data
            if (last and pipe) or (not data and (last or pipe or not self.follow)):
                return
            if self.follow and (pipe or not data):
                yield b""
                if len(data) < _FULL_PIPE:
                    self._pause()
                if not pipe:
                    yield from self._restarted(file)

    def _ready(self, file: BinaryIO, timeout: float | None) -> bool:
        """Whether a pipe can be read. All waiting is done here: no byte is taken and lost when `StopReading` comes."""
        try:
            with self._waiting():
                return bool(select([file], [], [], timeout)[0])
        except StopReading:
            self.stopped = True
            return False
        except OSError:  # reading will say what is wrong
            return True

    def _count(self, data: bytes) -> None:
        self.size += len(data)
        self._last = data[-1:]
        if self.hashed:
            self._sha.update(data)

    def _pause(self) -> None:
        try:
            with self._waiting(not self.stopped):
                time.sleep(0 if self.stopped else FOLLOW_PAUSE)
        except StopReading:
            self.stopped = True

    def _restarted(self, file: BinaryIO) -> Iterator[bytes]:
        """A log that was emptied and is written anew is read from its start, as a new line."""
        if file.seek(0, 2) >= self.size:
            file.seek(self.size)
            return
        file.seek(0)
        if self._last not in (b"", b"\n"):
            yield b"\n"
        self.size, self._last, self._sha = 0, b"", hashlib.sha256()

    @contextmanager
    def _waiting(self, really: bool = True) -> Iterator[None]:
        """Around whatever may take as long as it likes."""
        self.waits = really
        try:
            yield
        finally:
            self.waits = False
