"""The bytes of a capture as they are stored: a file, a pipe or a growing file."""

from __future__ import annotations

import hashlib
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from select import select
from typing import TYPE_CHECKING, BinaryIO

from analyzer.sources.errors import CaptureError, StopReading

if TYPE_CHECKING:
    from collections.abc import Iterator

CHUNK = 1 << 20
FOLLOW_PAUSE = 0.1
# A pipe that gave this much at once has more to give.
_FULL_PIPE = 1 << 16


@dataclass(slots=True)
class Stored:
    """One file, read once.

    Args:
        name: a path, `-` is standard input.
        follow: at the end of a file it waits for more, and an empty chunk says that nothing is left to read at the
            moment. A pipe is followed to its end.

    Setting `stopped` ends the reading; while `waits` is true, raising `StopReading` does the same. `live` is true when
    the bytes exist only once; `length` is the size of a regular file before it is read.
    """

    name: str
    follow: bool = False
    size: int = 0
    length: int | None = None
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

    def stored(self) -> Iterator[bytes]:
        """The bytes, in pieces of any size. Raises `CaptureError` when not even the first byte can be had."""
        try:
            with self._waiting():
                file = self._open()
        except StopReading:
            self.stopped = True
            return
        with file:
            self.live = self.follow or not file.seekable()
            if not self.live:
                self.length = file.seek(0, 2)
                file.seek(0)
            yield from self._pieces(file)

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

    def _pieces(self, file: BinaryIO) -> Iterator[bytes]:
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
