"""Check that captures are still as they were when they were read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_Stamp = tuple[int, int, int]  # inode, size, time of the last change in nanoseconds


class FileStamps:
    """Remembers what the system says of files; pipes and the like never change."""

    def __init__(self, paths: Sequence[str]) -> None:
        self._stamps = {path: stamp for path in paths if (stamp := _stamp(path)) is not None}
        self._there = tuple(self._stamps)

    def changed(self) -> str:
        """Return what has become of a file since, once; empty if nothing has."""
        for path, before in self._stamps.items():
            now = _stamp(path)
            if now == before:
                continue
            self._stamps = {}
            if now is None:
                return _gone(path)
            grown = now[0] == before[0] and now[1] > before[1]
            how = "grown" if grown else "changed"
            return f"{Path(path).name} has {how} since it was read: ctrl+r reads it anew"
        return ""

    def gone(self) -> str:
        """Return that a file is not there any more, empty if all are."""
        return next((_gone(path) for path in self._there if _stamp(path) is None), "")


def _gone(path: str) -> str:
    return f"{Path(path).name} is gone: what was read of it stays here until the end"


def _stamp(path: str) -> _Stamp | None:
    try:
        found = os.stat(path)  # noqa: PTH116 - often
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns
