"""A recording in several files, as dumpcap makes them with `-b`: when the next one begins, and what it is called."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer.live import conditions
from analyzer.sinks import split_name
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

_NAMES = ("duration", "interval", "filesize", "packets", "frames", "files")


@dataclass(frozen=True, slots=True)
class RingPlan:
    """The conditions on which a new file begins, whichever comes first, and how many are kept; None: never, and all.

    Args:
        duration: nanoseconds that a file lasts.
        interval: a file ends when the clock (since 1970) comes to a multiple of so many nanoseconds.
        size: bytes that a file may have before the next row goes into a new one.
        frames: frames of a file.
        files: files that are kept, the one that is written among them.
    """

    duration: int | None = None
    interval: int | None = None
    size: int | None = None
    frames: int | None = None
    files: int | None = None


def parse_ring(texts: Iterable[str]) -> RingPlan | None:
    """Return the conditions of all `-b`, the last one of a name; None if there are none. Raises `ValueError`.

    They are `duration:60`, `interval:1h`, `filesize:100` (kB of 1000 bytes) or `filesize:20MB`, `packets:N` or
    `frames:N`, and `files:N`.
    """
    found: dict[str, int] = {}
    for text in texts:
        name, value = conditions.split_condition("-b", text, _NAMES)
        if name in {"duration", "interval"}:
            found[name] = conditions.parse_seconds("-b", name, value)
        elif name == "filesize":
            found["size"] = conditions.parse_size("-b", name, value)
        else:
            found["files" if name == "files" else "frames"] = conditions.parse_number("-b", name, value)
    if found.keys() == {"files"}:
        raise ValueError("-b files: says how many are kept; add duration:, interval:, filesize: or packets:")
    return RingPlan(**found) if found else None


class Ring:
    """Says when the file that is written has had enough.

    Time passes unnoticed on a silent bus: the next file begins with the next row, so that no file is empty, and what
    was heard last is not deleted in favour of silence.

    Args:
        plan: the conditions.
        path: `-w`; a file is `name_00001_20261121190000.log`, with the local time of its start.
        clock: monotonic nanoseconds.
        wall: seconds since 1970.
    """

    def __init__(
        self,
        plan: RingPlan,
        path: str,
        clock: Callable[[], int] = time.monotonic_ns,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.plan = plan
        self._stem, self._suffix = split_name(path)
        self._clock, self._wall = clock, wall
        self._number = 0
        self._end: int | None = None
        self._boundary: int | None = None

    def next_name(self) -> str:
        """Begin the next file; return its name."""
        now, plan = self._wall(), self.plan
        self._number += 1
        self._end = None if plan.duration is None else self._clock() + plan.duration
        ns = int(now * SECOND)
        self._boundary = None if plan.interval is None else ns - ns % plan.interval + plan.interval
        stamp = time.strftime("%Y%m%d%H%M%S", time.localtime(now))
        return f"{self._stem}_{self._number:05}_{stamp}{self._suffix}"

    def left(self, frames: int) -> int | None:
        """Count the frames that go into a file that has so many already; None if they are not counted."""
        return None if self.plan.frames is None else max(self.plan.frames - frames, 0)

    def over(self, size: int) -> bool:
        """Return True if the next row goes into a new file, the one that is written having so many bytes."""
        return (
            (self.plan.size is not None and size >= self.plan.size)
            or (self._end is not None and self._clock() >= self._end)
            or (self._boundary is not None and int(self._wall() * SECOND) >= self._boundary)
        )
