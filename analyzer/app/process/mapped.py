"""Pages of program files that a start has read, and nobody else: a session without end gives them back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from analyzer.app.process import start

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_DONT_NEED = 4  # madvise(2): drop these pages; who touches one reads it anew
_LEAST = 64  # kB in memory: of less there is not enough to gain
_MAPS = Path("/proc/self/smaps")
_HEAD = re.compile(r"([0-9a-f]+)-([0-9a-f]+) (\S+) \S+ \S+ \d+\s*(.*)")
_LIBRARY = re.compile(r"/[^/]+\.so[.0-9]*$")  # what a running program unmaps last


class Mapping(NamedTuple):
    """Addresses from `start` to before `end`; kB in memory, and of these `own` ones that no file has."""

    start: int
    end: int
    rights: str
    file: str
    resident: int
    own: int

    @property
    def can_go(self) -> bool:
        """True if all its pages are those of a library, as they stand there."""
        return bool(_LIBRARY.search(self.file)) and "w" not in self.rights and not self.own and self.resident >= _LEAST


def mappings(lines: Iterable[str]) -> Iterator[Mapping]:
    """Yield what Linux says of the mappings of a process (proc(5), smaps)."""
    found = None
    for line in lines:
        head = _HEAD.match(line)
        if head is not None:
            if found is not None:
                yield found
            found = Mapping(int(head[1], 16), int(head[2], 16), head[3], head[4], 0, 0)
        elif found is not None and line.startswith("Rss:"):
            found = found._replace(resident=int(line.split()[1]))
        elif found is not None and line.startswith("Anonymous:"):
            found = found._replace(own=int(line.split()[1]))
    if found is not None:
        yield found


def return_files() -> None:
    """Give back the pages of libraries, where nobody else uses the process; those that are needed come back one by one.

    The loader reads through the tables of each library, and imports through code that never runs again: more than half
    of what a session holds of files, which on a small machine leaves no room for others.
    """
    if not start.is_alone() or not _MAPS.exists():
        return
    import ctypes  # noqa: PLC0415 - numpy imports it anyway

    advise = getattr(ctypes.CDLL(None), "madvise", None)
    if advise is None:
        return
    for one in list(mappings(_MAPS.read_text(errors="replace").splitlines())):
        if one.can_go:
            advise(ctypes.c_void_p(one.start), ctypes.c_size_t(one.end - one.start), _DONT_NEED)
