"""The temporary folder of a browser: for its user alone, removed at the end; those of dead processes at the start."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import TracebackType

PREFIX = "tailbyte-view-"
_LOCK = "lock"  # held as long as the process lives, whatever ends it


class StoreFolder(AbstractContextManager["StoreFolder"]):
    """A folder with mode 0700 below the system's temporary one, or below `place`. Raises `OSError`."""

    def __init__(self, place: str | None = None) -> None:
        above = place or tempfile.gettempdir()
        remove_stale(above)
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX, dir=above))
        self._lock = _locked(self.path / _LOCK, create=True)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Remove it with all it holds."""
        self.close()

    def close(self) -> None:
        """Remove it with all it holds; what is mapped stays readable until it is let go."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
        shutil.rmtree(self.path, ignore_errors=True)


def remove_stale(above: str) -> None:
    """Remove the folders below one that this user's dead processes have left."""
    with suppress(OSError), os.scandir(above) as entries:
        for entry in entries:
            with suppress(OSError):  # its owner may remove it meanwhile
                if entry.name.startswith(PREFIX) and entry.is_dir(follow_symlinks=False):
                    _remove(entry)


def _remove(entry: os.DirEntry[str]) -> None:
    """Remove a folder, unless it is another user's or a living process's."""
    if hasattr(os, "getuid") and entry.stat(follow_symlinks=False).st_uid != os.getuid():
        return
    lock = _locked(Path(entry.path) / _LOCK, create=False)
    if lock is not None:
        shutil.rmtree(entry.path, ignore_errors=True)
        os.close(lock)


def _locked(path: Path, *, create: bool) -> int | None:
    """Return the descriptor of a lock file that is ours now, None if a living process has it or there is none."""
    try:
        import fcntl  # noqa: PLC0415 - not everywhere
    except ImportError:
        return None
    descriptor = None
    try:
        descriptor = os.open(path, os.O_RDWR | (os.O_CREAT if create else 0), 0o600)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        if descriptor is not None:
            os.close(descriptor)
        return None
    return descriptor
