"""Which part of a capture is wanted: `--from --to --last --around --frames`, resolved while batches go by."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from analyzer.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy.typing as npt

    from analyzer.engine import Batch

    Rows = npt.NDArray[Any]

SECOND = 1_000_000_000
AROUND = SECOND
_UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": SECOND, "min": 60 * SECOND, "h": 3600 * SECOND}
_NUMBER = re.compile(r"(\d+)(?:\.(\d{1,9}))?")
# A bare number below this counts seconds from the first frame, above it seconds since 1970.
_EPOCH_FROM = 100_000_000


def duration(text: str) -> int:
    """`10`, `10s`, `250ms`, `1.5min` as nanoseconds. Raises ValueError."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([a-z]*)", text.strip())
    unit = _UNITS.get((match[2] or "s") if match else "")
    if match is None or unit is None:
        raise ValueError(f"{text!r} is not a duration (10s, 250ms, 1.5min)")
    return _scaled(match[1], unit)


def _scaled(text: str, unit: int) -> int:
    whole, _, fraction = text.partition(".")
    return int(whole) * unit + int((fraction or "0")[:12]) * unit // 10 ** len((fraction or "0")[:12])


@dataclass(frozen=True, slots=True)
class Moment:
    """A time as a person writes it; nanoseconds once the first frame's time is known."""

    kind: Literal["since start", "absolute", "of day"]
    ns: int

    @classmethod
    def parse(cls, text: str) -> Moment:
        """Seconds from the first frame, seconds since 1970, `12:49:54.89` (local) or `2026-03-14T12:49:54Z`."""
        text = text.strip()
        if re.fullmatch(r"\d+(\.\d+)?(s|ms|us|min|h)?", text):
            ns = duration(text)
            return cls("absolute" if ns >= _EPOCH_FROM * SECOND else "since start", ns)
        clock, fraction = _NUMBER_TAIL.sub("", text), _NUMBER_TAIL.search(text)
        extra = _scaled("0" + fraction[0], SECOND) if fraction else 0
        try:
            if "-" not in text:
                day = time.fromisoformat(clock)
                return cls("of day", ((day.hour * 60 + day.minute) * 60 + day.second) * SECOND + extra)
            stamp = datetime.fromisoformat(clock).astimezone(UTC)
            return cls("absolute", int(stamp.timestamp()) * SECOND + extra)
        except (ValueError, OverflowError):
            raise ValueError(f"{text!r} is not a time (12.5, 12:49:54.890 or 2026-03-14T12:49:54)") from None

    def at(self, start: int) -> int:
        """Nanoseconds in a capture whose first frame has the time `start`."""
        if self.kind == "absolute":
            return self.ns
        if self.kind == "since start":
            return start + self.ns
        midnight = datetime.fromtimestamp(start // SECOND).astimezone()
        midnight = midnight.replace(hour=0, minute=0, second=0, microsecond=0)
        moment = int(midnight.timestamp()) * SECOND + self.ns
        # A flight past midnight: the hour that is over when the capture starts is the next day's.
        if moment < start - SECOND:
            moment = int((midnight + timedelta(days=1)).timestamp()) * SECOND + self.ns
        return moment


_NUMBER_TAIL = re.compile(r"\.\d+")


@dataclass(frozen=True, slots=True)
class Window:
    """The limits asked for; all that are given must hold.

    `frames` are frame numbers from 1, both included. `around` is a frame number or a moment, with the time to each side.
    """

    start: Moment | None = None
    stop: Moment | None = None
    last: int | None = None
    around: int | Moment | None = None
    margin: int = AROUND
    frames: tuple[int, int] | None = None

    def apply(self, batches: Iterable[Batch]) -> Iterator[tuple[Batch, Rows, int | None]]:
        """Every batch with the transfer rows inside the window, in order of their first frames.

        The third value is the zero of relative times: the first frame's time, or that of `around`. Batches before an
        anchor that is still to come wait, but no longer than the window is wide.
        """
        state = _Progress(self)
        for batch in batches:
            yield from state.take(batch)
        yield from state.end()


class _Progress:
    def __init__(self, window: Window) -> None:
        self.window = window
        self.first: int | None = None
        self.latest: int | None = None
        self.anchor: int | None = None
        self.waiting: deque[tuple[Batch, int | None]] = deque()

    def take(self, batch: Batch) -> Iterator[tuple[Batch, Rows, int | None]]:
        times = numbers(batch.frames.column("t"))
        valid = times != np.iinfo(np.int64).min
        newest = int(times[valid].max()) if valid.any() else None
        if self.first is None and newest is not None:
            self.first = int(times[valid][0])
        if newest is not None:
            self.latest = newest if self.latest is None else max(self.latest, newest)
        self._find_anchor(batch)
        if self.window.last is None and (self.window.around is None or self.anchor is not None):
            yield from self._release()
            yield self._pick(batch)
            return
        self.waiting.append((batch, newest))
        width = self.window.last if self.window.last is not None else self.window.margin
        while self.latest is not None and len(self.waiting) > 1:
            oldest = self.waiting[0][1]
            if oldest is None or oldest >= self.latest - width:
                break
            batch, _ = self.waiting.popleft()
            yield batch, np.zeros(0, np.int64), self.first

    def end(self) -> Iterator[tuple[Batch, Rows, int | None]]:
        yield from self._release()

    def _release(self) -> Iterator[tuple[Batch, Rows, int | None]]:
        while self.waiting:
            yield self._pick(self.waiting.popleft()[0])

    def _find_anchor(self, batch: Batch) -> None:
        around = self.window.around
        if around is None or self.anchor is not None or self.first is None:
            return
        if isinstance(around, Moment):
            moment = around.at(self.first)
            if self.latest is not None and self.latest >= moment:
                self.anchor = moment
        elif batch.first_frame <= around - 1 < batch.first_frame + len(batch.frames):
            self.anchor = batch.frames.column("t").cast("int64")[around - 1 - batch.first_frame].as_py()

    def _pick(self, batch: Batch) -> tuple[Batch, Rows, int | None]:
        window, transfers = self.window, batch.transfers
        offsets = np.frombuffer(transfers.column("frame").buffers()[1], np.int32)[: len(transfers) + 1]
        numbers_ = numbers(transfers.column("frame").values)
        keep = np.ones(len(transfers), bool)
        if not len(transfers):
            return batch, np.zeros(0, np.int64), self._zero()
        first, last = numbers_[offsets[:-1]], numbers_[offsets[1:] - 1]
        t, t_end = numbers(transfers.column("t")), numbers(transfers.column("t_end"))
        low, high = self._limits()
        if low is not None:
            keep &= t_end >= low
        if high is not None:
            keep &= (t <= high) & (t != np.iinfo(np.int64).min)
        if window.frames is not None:
            keep &= (last + 1 >= window.frames[0]) & (first + 1 <= window.frames[1])
        rows = np.flatnonzero(keep)
        return batch, rows[np.argsort(first[rows], kind="stable")], self._zero()

    def _zero(self) -> int | None:
        return self.first if self.anchor is None else self.anchor

    def _limits(self) -> tuple[int | None, int | None]:
        """Bounds in nanoseconds; a bound that can never be met when the anchor was not found."""
        window, lows, highs = self.window, list[int](), list[int]()
        if window.start is not None and self.first is not None:
            lows.append(window.start.at(self.first))
        if window.stop is not None and self.first is not None:
            highs.append(window.stop.at(self.first))
        if window.last is not None and self.latest is not None:
            lows.append(self.latest - window.last)
        if window.around is not None:
            if self.anchor is None:
                return np.iinfo(np.int64).max, np.iinfo(np.int64).min + 1
            lows.append(self.anchor - window.margin)
            highs.append(self.anchor + window.margin)
        return max(lows, default=None), min(highs, default=None)
