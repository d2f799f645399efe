"""Check that captures are still as they were when they were read."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_Stamp = tuple[int, int, int]  # inode, size, time of the last change in nanoseconds


class FileStamps:
    """Remembers what the system says of files; pipes and the like never change."""

    def __init__(self, paths: Sequence[str]) -> None:
        self._stamps = {path: stamp for path in paths if (stamp := _stamp(path)) is not None}

    def changed(self) -> str:
        """Return what has become of a file since, once; empty if nothing has."""
        for path, before in self._stamps.items():
            now = _stamp(path)
            if now == before:
                continue
            self._stamps = {}
            if now is None:
                return f"{path} is gone: what was read of it stays here until the end"
            grown = now[0] == before[0] and now[1] > before[1]
            return f"{path} has {'grown' if grown else 'changed'} since it was read: ctrl+r reads it anew"
        return ""


def _stamp(path: str) -> _Stamp | None:
    try:
        found = os.stat(path)  # noqa: PTH116 - often
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns
