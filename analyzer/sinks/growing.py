"""A file that can be read while it grows, whatever ends the writing: it is there up to the last `flush`."""

from __future__ import annotations

import os
import select
import stat
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from analyzer.sinks.atomic import TargetError

if TYPE_CHECKING:
    from collections.abc import Callable

_GZIP_LEVEL = 6


class GoneError(TargetError):
    """The reader of a pipe has had enough."""


class GrowingFile:
    """Gathers what is written; `flush` hands it to the system in one piece.

    With a packing (`gzip`, `zstd`) each piece is packed for itself, so that the file can be unpacked whole at any
    moment. What cannot be written is cut off again: the file then ends where the last piece ended, if it is a regular
    one. Devices, pipes and standard output (`-`) are written as they are.

    Args:
        path: stands under its name from the start. A regular file that exists is written over only by `force`.
        packing: `gzip`, `zstd` or nothing.

    Opening it and every method may raise `TargetError`, with one line that says what and why.
    """

    def __init__(self, path: str, packing: str = "", *, force: bool = False) -> None:
        self.path = "standard output" if path == "-" else path
        self.size = self.gathered = 0
        self._parts: list[bytes] = []
        self._pack = _packer(packing)
        self._syncing: Thread | None = None
        self._trouble: TargetError | None = None
        self._closed = False
        try:
            self._descriptor = os.dup(1) if path == "-" else _open(path, force)
        except FileExistsError:
            raise TargetError(path, "exists (--force writes over it)") from None
        except OSError as error:
            raise TargetError(path, error) from None
        except ValueError as error:  # a NUL byte in the name
            raise TargetError(path.replace("\0", "\\0"), str(error)) from None
        self._regular = stat.S_ISREG(os.fstat(self._descriptor).st_mode)

    def write(self, data: bytes) -> int:
        """Gather bytes; a reader can do nothing with them before those that come up to the next `flush`."""
        self._parts.append(data)
        self.gathered += len(data)
        return len(data)

    def flush(self) -> None:
        """Hand over what has been gathered; `size` is what the file holds then, in bytes."""
        if self._trouble is not None:
            raise self._trouble
        data = self._pack(b"".join(self._parts)) if self.gathered else b""
        self.discard()
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[write_some(self._descriptor, rest) :]
        except OSError as error:
            if self._regular:
                with suppress(OSError):
                    os.ftruncate(self._descriptor, self.size)
            if isinstance(error, BrokenPipeError):
                raise GoneError(self.path, "nobody reads it any more") from None
            raise TargetError(self.path, error) from None
        self.size += len(data)

    def sync_aside(self) -> None:
        """Begin to bring to the disk what was flushed; a disk takes its time. `flush` tells of an error."""
        if self._syncing is None or not self._syncing.is_alive():
            self._syncing = Thread(target=self._sync_aside, name="disk", daemon=True)
            self._syncing.start()

    def sync(self) -> None:
        """Wait until the disk has what was flushed, so that it outlives a loss of power."""
        if self._regular:
            self._try(os.fsync)

    @property
    def deleted(self) -> bool:
        """True if no name leads to it any more."""
        return self._regular and not os.fstat(self._descriptor).st_nlink

    def discard(self) -> None:
        """Forget what is gathered: it will not be written."""
        self._parts, self.gathered = [], 0

    def close(self) -> None:
        """Let go of it; what is gathered and not flushed is lost."""
        if self._syncing is not None:
            self._syncing.join()
        if not self._closed:
            self._closed = True
            self._try(os.close)

    def _sync_aside(self) -> None:
        try:
            self.sync()
        except TargetError as error:
            self._trouble = error

    def _try(self, call: Callable[[int], None]) -> None:
        try:
            call(self._descriptor)
        except OSError as error:
            raise TargetError(self.path, error) from None


def write_some(descriptor: int, data: memoryview) -> int:
    """Write at least one byte if there are any; return how many were. Raises `OSError`.

    It waits where a file does not by itself: whoever shares a terminal or a pipe may have told it not to.
    """
    while True:
        try:
            return os.write(descriptor, data)
        except BlockingIOError:
            select.select([], [descriptor], [])


def _open(path: str, force: bool) -> int:
    flags = os.O_WRONLY | os.O_CLOEXEC
    try:
        return os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError:
        if Path(path).is_file() and not force:
            raise
        return os.open(path, flags | os.O_CREAT | os.O_TRUNC, 0o666)


def _packer(packing: str) -> Callable[[bytes], bytes]:
    """Return what makes bytes a whole member of gzip, or frame of zstd."""
    if packing == "gzip":
        import gzip  # noqa: PLC0415 - only what is needed

        return lambda data: gzip.compress(data, _GZIP_LEVEL)
    if packing == "zstd":
        import zstandard  # noqa: PLC0415

        return zstandard.ZstdCompressor().compress
    return bytes
