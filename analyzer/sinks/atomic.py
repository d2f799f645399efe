"""Output that is there whole or not at all: written beside its name, moved to it once everything is on the disk."""

from __future__ import annotations

import io
import os
import shutil
import stat
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Self, cast

if TYPE_CHECKING:
    from types import TracebackType

_BUFFER = 1 << 18
# Characters of a name that stand in the name of its unfinished file: file systems allow 255 bytes.
_NAME = 48


class TargetError(Exception):
    """Output that cannot be written; says what and why, in one line."""

    def __init__(self, name: str, reason: str | OSError) -> None:
        self.name, self.reason = name, reason if isinstance(reason, str) else reason.strerror or str(reason)
        super().__init__(f"{name}: {self.reason}")

    def __reduce__(self) -> tuple[type[TargetError], tuple[str, str]]:
        """Pickle it with its two parts, not with its text."""
        return type(self), (self.name, self.reason)


class Target(AbstractContextManager["Target"]):
    """One file. Until the block ends without an exception its name keeps the content it had, or stays free.

    `file` takes the bytes; what cannot be written raises `TargetError`, but a pipe that nobody reads any more remains
    a `BrokenPipeError`. Standard output (`-`), devices and pipes have no name to protect and are written directly.
    """

    file: BinaryIO

    def __init__(self, path: str) -> None:
        self.name = "standard output" if path == "-" else path
        self._path = path
        self._final = self._part = ""

    def __enter__(self) -> Self:
        """Open it. Raises `TargetError`."""
        try:
            self._open()
        except OSError as error:
            raise TargetError(self.name, error) from None
        except ValueError as error:  # a NUL byte in the name
            raise TargetError(self.name.replace("\0", "\\0"), str(error)) from None
        return self

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        """Put the file in its place, or remove it. Raises `TargetError`."""
        try:
            if kind is None:
                self.settle()
                if self._part:
                    self._finish()
        finally:
            _discard(self.file)
            if self._part:
                Path(self._part).unlink(missing_ok=True)

    def settle(self) -> None:
        """Bring everything to the disk, so that little is left that can fail at the end. Raises `TargetError`."""
        self.file.flush()
        if self._part:
            try:
                os.fsync(self.file.fileno())  # some file systems notice only now that they are full
            except OSError as error:
                raise TargetError(self.name, error) from None

    def _open(self) -> None:
        if self._path == "-":
            self.file = _writer(1, self.name, closefd=False)
            return
        self._final = os.path.realpath(self._path)
        found = _stat(self._final)
        if found is not None and stat.S_ISDIR(found.st_mode):
            raise TargetError(self.name, "is a directory")
        if found is not None and not stat.S_ISREG(found.st_mode):
            self.file = _writer(os.open(self._path, os.O_WRONLY), self.name)
            return
        if found is not None:  # moving a file over it would ask for less
            os.close(os.open(self._final, os.O_WRONLY))
        folder = Path(self._final).parent
        if not folder.is_dir():
            raise TargetError(self.name, f"there is no folder {Path(self._path).parent}")
        part = _beside(self._final)
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._part = part
        self.file = _writer(descriptor, self.name)
        if found is not None:
            with suppress(OSError):  # somebody else's file, which we may write
                os.fchmod(descriptor, stat.S_IMODE(found.st_mode))

    def _finish(self) -> None:
        try:
            self.file.close()
            Path(self._part).replace(self._final)
        except OSError as error:
            raise TargetError(self.name, error) from None
        self._part = ""


class TargetFolder(AbstractContextManager["TargetFolder"]):
    """A folder of several files, which take their places together when the block ends without an exception.

    A folder that exists keeps whatever else it holds; a file of the same name is replaced.
    """

    def __init__(self, path: str) -> None:
        self.name = path
        self._files: dict[str, BinaryIO] = {}
        self._exists = False
        self._part = ""

    def __enter__(self) -> Self:
        """Make room for the files. Raises `TargetError`."""
        try:
            self._final = os.path.realpath(self.name)
            found = _stat(self._final)
            if found is not None and not stat.S_ISDIR(found.st_mode):
                raise TargetError(self.name, "is not a folder")
            self._exists = found is not None
            if not Path(self._final).parent.is_dir():
                raise TargetError(self.name, f"there is no folder {Path(self.name).parent}")
            part = _beside(self._final, inside=self._exists)
            Path(part).mkdir()
        except OSError as error:
            raise TargetError(self.name, error) from None
        except ValueError as error:  # a NUL byte in the name
            raise TargetError(self.name.replace("\0", "\\0"), str(error)) from None
        self._part = part
        return self

    def open(self, name: str) -> BinaryIO:
        """Open a new file of the folder. Closing it early is allowed. Raises `TargetError`, as writing to it may."""
        label = str(Path(self.name, name))
        if self._exists and Path(self._final, name).is_dir():
            raise TargetError(label, "is a directory")
        try:
            descriptor = os.open(Path(self._part, name), os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        except OSError as error:
            raise TargetError(label, error) from None
        self._files[name] = _writer(descriptor, label)
        return self._files[name]

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        """Put all files in their places, or remove them. Raises `TargetError`."""
        try:
            if kind is None:
                self._finish()
        finally:
            for file in self._files.values():
                _discard(file)
            if self._part:
                shutil.rmtree(self._part, ignore_errors=True)

    def _finish(self) -> None:
        try:
            for name, file in self._files.items():
                file.close()  # flushes
                _sync(Path(self._part, name))
            if self._exists:
                for name in self._files:
                    Path(self._part, name).replace(Path(self._final, name))
            else:
                Path(self._part).rename(self._final)
                self._part = ""
        except OSError as error:
            raise TargetError(self.name, error) from None


class _Raw(io.FileIO):
    """A descriptor whose failures name the file that the user asked for."""

    label = ""

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        """Write as inherited. Raises `TargetError`."""
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise TargetError(self.label, error) from None

    def close(self) -> None:
        """Close as inherited. Raises `TargetError`."""
        try:
            super().close()
        except OSError as error:
            raise TargetError(self.label, error) from None


def _writer(descriptor: int, label: str, *, closefd: bool = True) -> BinaryIO:
    raw = _Raw(descriptor, "wb", closefd=closefd)
    raw.label = label
    return cast("BinaryIO", io.BufferedWriter(raw, _BUFFER))


def _discard(file: BinaryIO) -> None:
    """Close it; what is still in its buffer no longer matters."""
    if file.closed:
        return
    raw: io.FileIO = cast("io.BufferedWriter", file).raw  # type: ignore[assignment]
    with suppress(TargetError, OSError):
        raw.close()
    with suppress(TargetError, OSError, ValueError):
        file.close()


def _stat(path: str) -> os.stat_result | None:
    try:
        return os.stat(path)  # noqa: PTH116 - the same, without an object
    except FileNotFoundError:
        return None


def _beside(path: str, *, inside: bool = False) -> str:
    """Return a free name on the same file system, which says what it is should a crash leave it behind."""
    import secrets  # noqa: PLC0415 - and much beside it

    final = Path(path)
    name = f"{final.name[:_NAME]}.{secrets.token_hex(4)}.part"
    return str((final if inside else final.parent) / name)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
