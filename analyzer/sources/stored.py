"""The bytes of a capture as they are stored: a file, a pipe, a growing file or a file object."""

from __future__ import annotations

import hashlib
import time
from contextlib import closing, contextmanager
from dataclasses import InitVar, dataclass, field
from typing import TYPE_CHECKING

from analyzer.sources import origin
from analyzer.sources.errors import CaptureError, StopReading, UnavailableError

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from analyzer.sources.origin import FileObject, Opened, Origin

CHUNK = 1 << 20  # bytes read at once: batches are longer by up to as many, and three such wait to be parsed
FOLLOW_PAUSE = 0.1
# A pipe that gave this much at once has more to give.
_FULL_PIPE = 1 << 16
# Ends a line whose rest is lost with the log that it stood in: no format reads it as one that is whole.
_EMPTIED = b" <emptied>\n"


@dataclass(slots=True)
class Stored:
    """One capture, read once.

    Args:
        of: a path, `-` for standard input, or a binary file object with a name.
        follow: at the end of a file it waits for more, and an empty chunk says that nothing is left to read at the
            moment. A pipe is followed to its end, a file object cannot be followed.

    Setting `stopped` ends the reading; while `waits` is true, raising `StopReading` does the same. `live` is true when
    the bytes exist only once; `length` is the size of a regular file before it is read.
    """

    of: InitVar[Origin | FileObject]
    follow: bool = False
    size: int = 0
    length: int | None = None
    damage: CaptureError | None = None
    hashed: bool = False
    live: bool = False
    stopped: bool = False
    waits: bool = False
    origin: str | FileObject = field(init=False)
    name: str = field(init=False)
    _last: bytes = b""
    _sha: hashlib._Hash = field(default_factory=hashlib.sha256)

    def __post_init__(self, of: Origin | FileObject) -> None:
        """Take the path or the object as it is given."""
        self.origin = origin.given(of)
        self.name = self.origin if isinstance(self.origin, str) else self.origin.name

    @property
    def repeatable(self) -> bool:
        """True if another reading gives the same bytes."""
        return not self.follow and origin.repeatable(self.origin)

    @property
    def digest(self) -> str:
        """SHA-256 of the stored bytes read so far, in hexadecimal; only if `hashed` asked for it."""
        return self._sha.hexdigest()

    def opened(self) -> Opened:
        """Open the bytes for one more reading. Raises `CaptureError`."""
        return origin.opened(self.origin)

    def stored(self) -> Generator[bytes, None, None]:
        """Read the bytes, in chunks of any size. Raises `CaptureError` when not even the first byte can be had."""
        if self.follow and not isinstance(self.origin, str):
            raise CaptureError(self.name, "", "only a file or a pipe can be followed")
        try:
            with self._waiting():
                file = self.opened()
        except StopReading:
            self.stopped = True
            return
        with closing(file):
            self.live = self.follow or file.once
            if not self.live:
                self.length = self._length(file)
            yield from self._chunks(file)

    def _length(self, file: Opened) -> int:
        try:
            length = file.seek(0, 2)
            file.seek(0)
        except OSError as error:
            raise UnavailableError(self.name, "", error.strerror or str(error)) from None
        return length

    def _chunks(self, file: Opened) -> Iterator[bytes]:
        """Read the bytes as they are stored; with `follow`, wait at the end for more, as `tail -f` does.

        Once stopped, only what lies ready is read: a file that is followed up to its end, a pipe once.
        """
        pipe = file.once
        while self.live or not self.stopped:
            last = self.stopped
            if pipe and not self._ready(file, 0 if last else None):
                if last:
                    return
                continue
            try:
                data = self._next(file)
            except OSError as error:
                self.damage = UnavailableError(self.name, f"byte {self.size}", error.strerror or str(error))
                return
            size = len(data)
            if size:
                self._count(data)
                yield data
            del data  # else it would be there while the next one is read
            if (last and pipe) or (not size and (last or pipe or not self.follow)):
                return
            if self.follow and (pipe or not size):
                yield b""
                if size < _FULL_PIPE:
                    self._pause()
                if not pipe:
                    yield from self._restarted(file)

    def _ready(self, file: Opened, timeout: float | None) -> bool:
        """Wait for a pipe. All waiting is done here: no byte is taken and lost when `StopReading` comes."""
        try:
            with self._waiting():
                return file.ready(timeout)
        except StopReading:
            self.stopped = True
            return False

    def _next(self, file: Opened) -> bytes:
        while True:
            try:
                with self._waiting(file.blocks):
                    data = file.read(CHUNK)
            except StopReading:
                self.stopped = True
                return b""
            if data is not None:
                return data
            self._pause()  # nothing at the moment
            if self.stopped:
                return b""

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

    def _restarted(self, file: Opened) -> Iterator[bytes]:
        """Read a log that was emptied and is written anew from its start, as a new line."""
        if file.seek(0, 2) >= self.size:
            file.seek(self.size)
            return
        file.seek(0)
        if self._last not in (b"", b"\n"):
            yield _EMPTIED
        self.size, self._last, self._sha = 0, b"", hashlib.sha256()

    @contextmanager
    def _waiting(self, really: bool = True) -> Iterator[None]:
        """Around whatever may take as long as it likes."""
        self.waits = really
        try:
            yield
        finally:
            self.waits = False
