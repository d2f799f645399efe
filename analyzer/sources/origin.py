"""Where the bytes of a capture come from: a path, a pipe, or a binary file object with a name."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path
from select import select
from typing import TYPE_CHECKING, Protocol, TypeAlias

from analyzer.sources.errors import CaptureError, UnavailableError
from analyzer.sources.storage import is_address, open_stream

if TYPE_CHECKING:
    from typing import BinaryIO

STANDARD_INPUT = "-"
_ONCE = "was read before and cannot be read again: save the capture to a file first"


class NamedBinary(Protocol):
    """A binary file object with a name, as `open(path, "rb")` and fsspec give it; whoever opened it closes it.

    It is read from where it stands. One that can seek (`seekable`, `seek`, `tell`) can be read more than once.
    """

    @property
    def name(self) -> str:
        """The name of the capture; how it ends may tell the format."""

    def read(self, size: int, /) -> bytes | None:
        """Return up to `size` bytes, none at the end."""


Origin: TypeAlias = str | PathLike[str] | NamedBinary


class FileObject:
    """A file object of somebody else, with the place where the capture begins in it."""

    def __init__(self, file: NamedBinary) -> None:
        self.file, self.name = file, str(file.name)
        self.start = _place(file)
        self.read_before = False


class Opened(Protocol):
    """The bytes of a capture, opened for one reading; places count from where it begins."""

    # The bytes exist only once, and reading waits for them by itself.
    once: bool
    blocks: bool

    def ready(self, seconds: float | None) -> bool:
        """Wait until a pipe has something to read, or has ended; return False when the time is over before."""

    def read(self, size: int) -> bytes | None:
        """Return up to `size` bytes, none at the end; None if there are none at the moment. Raises `OSError`."""

    def seek(self, to: int, whence: int = 0) -> int:
        """Go to a place; only if the bytes exist more than once."""

    def close(self) -> None:
        """Close what was opened for this reading."""


class OpenedFile:
    """A file or a pipe of the system."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.once, self.blocks = not file.seekable(), False

    def read(self, size: int) -> bytes | None:
        """Return up to `size` bytes, none at the end."""
        return self._file.read(size)

    def ready(self, seconds: float | None) -> bool:
        """Wait until a pipe has something to read, or has ended; return False when the time is over before."""
        try:
            return bool(select([self._file], [], [], seconds)[0])
        except OSError:  # reading will say what is wrong
            return True

    def seek(self, to: int, whence: int = 0) -> int:
        """Go to a place."""
        return self._file.seek(to, whence)

    def close(self) -> None:
        """Close it."""
        self._file.close()


class OpenedObject:
    """One reading of a file object; it keeps its own place, so that several may read at a time."""

    def __init__(self, of: FileObject) -> None:
        self.once = self.blocks = of.start is None
        self._file: BinaryIO = of.file  # type: ignore[assignment]  # it has what it says that it has
        self._start = self._at = of.start or 0
        # What has arrived, rather than waiting for as much as was asked for.
        self._read = getattr(of.file, "read1", of.file.read)

    def ready(self, seconds: float | None) -> bool:
        """Return whether there is time to wait: nobody can ask an object what it has."""
        return seconds is None

    def read(self, size: int) -> bytes | None:
        """Return up to `size` bytes, none at the end. Raises `OSError`, whatever the object raises."""
        try:
            if not self.once and self._file.tell() != self._at:
                self._file.seek(self._at)
            data = self._read(size)
        except OSError:
            raise
        except Exception as error:
            raise OSError(f"{type(error).__name__}: {error}") from error
        if isinstance(data, str):
            raise OSError("it gives text, not bytes: open it in binary mode")
        self._at += len(data or b"")
        return None if data is None else bytes(data)

    def seek(self, to: int, whence: int = 0) -> int:
        """Go to a place."""
        self._at = self._file.seek(to if whence else self._start + to, whence)
        return self._at - self._start

    def close(self) -> None:
        """Leave it open: it belongs to somebody else."""


class OpenedAddress(OpenedObject):
    """One reading of what lies at an address."""

    def close(self) -> None:
        """Close what was opened for this reading."""
        self._file.close()


def given(origin: Origin | FileObject) -> str | FileObject:
    """Return the path, or the object with its place. Raises `TypeError` for what is neither."""
    if isinstance(origin, FileObject):
        return origin
    if isinstance(origin, str | PathLike):
        return os.fspath(origin)
    if not hasattr(origin, "read") or not hasattr(origin, "name"):
        raise TypeError(f"{origin!r} is neither a path nor a binary file object with a name")
    return FileObject(origin)


def opened(origin: str | FileObject) -> Opened:
    """Open it for one reading. Raises `CaptureError` if that is impossible."""
    if isinstance(origin, str):
        if is_address(origin) and not os.path.lexists(origin):
            return OpenedAddress(FileObject(open_stream(origin)))
        return OpenedFile(_file(origin))
    if origin.read_before and origin.start is None:
        raise UnavailableError(origin.name, "", _ONCE)
    origin.read_before = True
    return OpenedObject(origin)


def repeatable(origin: str | FileObject) -> bool:
    """Return whether another reading gives the same bytes."""
    return origin != STANDARD_INPUT if isinstance(origin, str) else origin.start is not None


def _place(file: NamedBinary) -> int | None:
    """Return where it stands, None if it cannot seek."""
    try:
        place: int | None = file.tell() if file.seekable() else None  # type: ignore[attr-defined]
    except (AttributeError, OSError, ValueError):
        return None
    return place


def _file(name: str) -> BinaryIO:
    try:
        if name == STANDARD_INPUT:
            return open(0, "rb", buffering=0, closefd=False)
        if Path(name).is_dir():
            raise CaptureError(name, "", "is a directory")
        return Path(name).open("rb", buffering=0)
    except OSError as error:
        raise UnavailableError(name, "", error.strerror or str(error)) from None
    except ValueError as error:  # a NUL byte in the name
        raise CaptureError(name.replace("\0", "\\0"), "", str(error)) from None
