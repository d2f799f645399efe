"""A bar on the terminal for work that takes a while, gone without a trace at its end."""

from __future__ import annotations

import os
import stat
import sys
import time
from contextlib import AbstractContextManager
from typing import IO, TYPE_CHECKING, Protocol, Self, TypeVar

from analyzer.app.process import streams

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# Seconds before the first drawing, and between two of them.
PATIENCE, PAUSE = 0.5, 0.1
_BAR = 30
_WIPE = "\r\x1b[K"
_Part = TypeVar("_Part")


class Measurable(Protocol):
    """Work on its way: `size` of `length` so far, in bytes unless `Progress` is told how to call their rate."""

    @property
    def size(self) -> int:
        """Bytes read."""

    @property
    def length(self) -> int | None:
        """All bytes there are; unknown of a pipe."""


class Progress(AbstractContextManager["Progress"]):
    """Shows how far `reading` has come, if standard error is a terminal and the work lasts; else does nothing.

    `active` says whether it may draw: whatever else goes to the terminal is then better held back until the block ends.
    `speed` puts the rate of `reading`, in a second, into words.
    """

    def __init__(
        self,
        reading: Measurable,
        *,
        wanted: bool = True,
        clock: Callable[[], float] = time.monotonic,
        speed: Callable[[float], str] | None = None,
    ) -> None:
        self.active = wanted and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._reading, self._clock, self._speed = reading, clock, speed or bytes_a_second
        self._drawn = False

    def __enter__(self) -> Self:
        """Time counts from here."""
        self._start = self._clock()
        self._next = self._start + PATIENCE
        return self

    def __exit__(self, *_: object) -> None:
        """Wipes the line."""
        if self._drawn:
            streams.tell(_WIPE)

    def over(self, parts: Iterable[_Part], label: str = "") -> Iterator[_Part]:
        """Yield the parts of the work, one step each; `label` says what is done if that is not reading any more."""
        for part in parts:
            self.step(label)
            yield part
            del part  # it may be large

    def step(self, label: str = "") -> None:
        """Take note that a part of the work is done; draw at most ten times a second."""
        if self.active and (now := self._clock()) >= self._next:
            self._next = now + PAUSE
            self._drawn = True
            seconds, width = now - self._start, _width()
            text = labelled(label, seconds, width) if label else line(self._reading, seconds, width, self._speed)
            streams.tell(_WIPE + text)


def into_a_file(out: IO[str]) -> bool:
    """Return whether what is written shows nowhere: what goes through a pipe is drawn by whoever is behind it."""
    try:
        return stat.S_ISREG(os.fstat(out.fileno()).st_mode)
    except (OSError, ValueError):  # nothing of the system
        return False


def bytes_a_second(rate: float) -> str:
    """Say how fast a capture is read."""
    return f"{_bytes(rate)}/s"


def real_time(rate: float) -> str:
    """Say how fast work goes whose size is nanoseconds of a bus."""
    return f"{rate / 1e9:.1f} x real time"


def line(reading: Measurable, seconds: float, width: int, speed: Callable[[float], str] = bytes_a_second) -> str:
    """Return the bar: share, rate and time left, or bytes and rate of what has no known length.

    It has less than `width` characters: parts for which there is no room are left out, the bar itself first.
    """
    rate = reading.size / max(seconds, 1e-9)
    fast = speed(rate)
    if not reading.length:
        read = _bytes(reading.size)
        return _longest(width, f"{read}  {fast}", read)
    done = min(reading.size / reading.length, 1.0)
    share = f"{done:4.0%}"
    bar = f"[{'#' * round(done * _BAR):.<{_BAR}}]"
    left = f"  {_clock((reading.length - reading.size) / rate)} left" if rate else ""
    return _longest(width, f"{share} {bar} {fast}{left}", f"{share} {fast}{left}", f"{share}{left}", share)


def labelled(label: str, seconds: float, width: int) -> str:
    """Return a line for work whose end is not known: what is done, and the time since the beginning."""
    return _longest(width, f"{label}  {_clock(seconds)}", label)


def _longest(width: int, *texts: str) -> str:
    """Return the first text that leaves a column free."""
    return next((text for text in texts if len(text) < width), "")


def _width() -> int:
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or 80
    except (OSError, ValueError):
        return 80


def _bytes(count: float) -> str:
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(round(seconds), 0), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
