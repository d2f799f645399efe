"""Which part of a capture is wanted: `--from --to --last --around --frames`, resolved while batches go by."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

import numpy as np

from analyzer.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import numpy.typing as npt
    import pyarrow as pa

    from analyzer.engine import Batch

    Rows = npt.NDArray[Any]

SECOND = 1_000_000_000
AROUND = SECOND
_UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": SECOND, "min": 60 * SECOND, "h": 3600 * SECOND}
NEVER = np.iinfo(np.int64).min  # a time that is not there
_NOTHING = int(np.iinfo(np.int64).max), NEVER
# Frames that wait, in their batches, for a point that is still to come; each takes some 230 bytes.
MOST_WAITING = 1 << 20
# A time of day that was over longer than this when the capture starts is the next day's.
_ROUNDED = 3600 * SECOND
# A bare number below this counts seconds from the first frame, above it seconds since 1970.
_EPOCH_FROM = 100_000_000


def duration(text: str) -> int:
    """`10`, `10s`, `250ms`, `1.5min` as nanoseconds. Raises ValueError."""
    match = re.fullmatch(r"(\d{1,30}(?:\.\d+)?)\s*([a-z]*)", text.strip())
    unit = _UNITS.get(match[2] or "s") if match else None
    if match is None or unit is None:
        raise ValueError(f"{text!r} is not a duration (10s, 250ms, 1.5min)")
    return _scaled(match[1], unit)


def _scaled(text: str, unit: int) -> int:
    whole, _, fraction = text.partition(".")
    digits = (fraction or "0")[:12]
    return int(whole) * unit + int(digits) * unit // int("1" + "0" * len(digits))


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
                day = time.fromisoformat(_NO_ZONE.sub("?", clock))
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
        day = datetime.fromtimestamp(start // SECOND)  # noqa: DTZ006 - a person's time of day is local
        for date in (day.date(), day.date() + timedelta(days=1)):
            clock = datetime.combine(date, time()) + timedelta(seconds=self.ns // SECOND)
            moment = int(clock.timestamp()) * SECOND + self.ns % SECOND
            if moment >= start - _ROUNDED:
                break
        return moment

    def fits(self, start: int) -> bool:
        """Whether a capture whose first frame has the time `start` has such times: relative ones have no date."""
        return self.kind == "since start" or start >= _EPOCH_FROM * SECOND


_NUMBER_TAIL = re.compile(r"\.\d+")
_NO_ZONE = re.compile(r"[Zz+]")  # a time of day is local; of another zone it would need a date


@dataclass(frozen=True, slots=True)
class Window:
    """The limits asked for; all that are given must hold.

    `frames` are frame numbers from 1, both included. `around` is a frame number or a moment, `margin` the time to each
    side of it.
    """

    start: Moment | None = None
    stop: Moment | None = None
    last: int | None = None
    around: int | Moment | None = None
    margin: int = AROUND
    frames: tuple[int, int] | None = None

    def __bool__(self) -> bool:
        """Whether it leaves out anything at all."""
        return self != Window()

    @property
    def timed(self) -> bool:
        """Whether it asks for times, which not every capture has."""
        return any(isinstance(limit, Moment) for limit in (self.start, self.stop, self.around)) or self.last is not None


class Framed(Protocol):
    """Something with a slice of the frames table in it."""

    @property
    def frames(self) -> pa.RecordBatch:
        """The frames, with their times in column `t`."""

    @property
    def first_frame(self) -> int:
        """Number of the first one in the capture, from 0."""


F = TypeVar("F", bound=Framed)


class Windowed(ABC, Generic[F]):
    """Applies a window to slices of a capture while they go by.

    Args:
        window: what is wanted.
        again: gives the batches once more, or None where that is impossible. Needed when more is wanted from before a
            point that is found late (the end, a frame) than `MOST_WAITING` frames.

    `problem` says afterwards why the window does not fit the capture, None if it does.
    """

    def __init__(self, window: Window, again: Callable[[], Iterable[F] | None] = lambda: None) -> None:
        self.window = window
        self.problem: str | None = None
        self._again = again
        self._first: int | None = None
        self._latest: int | None = None
        self._anchor: int | None = None
        self._frames = 0
        self._waiting: deque[tuple[F, int]] = deque()
        self._held = 0
        self._dropped = NEVER

    def apply(self, batches: Iterable[F]) -> Iterator[tuple[F, Rows, int | None]]:
        """Batches with the rows inside the window.

        The third value is the zero of relative times: the first frame's time, or that of `around`. Batches that are
        surely too early for a window that is found late are left out.
        """
        for batch in batches:
            newest = self._look(batch)
            if self._known():
                yield from self._release()
                yield self._pick(batch)
            else:
                self._hold(batch, newest)
        self._conclude()
        if self._lost():
            self._waiting.clear()
            batches_ = self._again()
            if batches_ is not None:
                yield from map(self._pick, batches_)
                return
            self.problem = "the window is too wide for a pipe: save the capture to a file first"
        yield from self._release()

    def _look(self, batch: F) -> int:
        """Takes note of the times of a batch; returns the newest one of its frames and transfers."""
        newest = NEVER
        for column in self._times(batch):
            times = column[column != NEVER]
            if times.size:
                newest = max(newest, int(times.max()))
        if newest != NEVER:
            if self._first is None and times.size:
                self._first = int(times[0])
            self._latest = newest if self._latest is None else max(self._latest, newest)
        self._frames = batch.first_frame + len(batch.frames)
        self._find_anchor(batch)
        return newest

    @abstractmethod
    def _times(self, batch: F) -> tuple[Rows, ...]:
        """All times of a batch, those of its frames last."""

    @abstractmethod
    def _pick(self, batch: F) -> tuple[F, Rows, int | None]:
        """What `apply` gives for a batch."""

    def _known(self) -> bool:
        """Whether rows can be picked already. Once batches are lost only a second reading gets them in order."""
        return (
            self.window.last is None and (self.window.around is None or self._anchor is not None) and not self._lost()
        )

    def _find_anchor(self, batch: F) -> None:
        around = self.window.around
        if around is None or self._anchor is not None or self._first is None:
            return
        if isinstance(around, Moment):
            moment = around.at(self._first)
            if around.fits(self._first) and self._latest is not None and self._latest >= moment:
                self._anchor = moment
        elif batch.first_frame <= around - 1 < self._frames:
            self._anchor = batch.frames.column("t").cast("int64")[around - 1 - batch.first_frame].as_py()

    def _hold(self, batch: F, newest: int) -> None:
        """Keeps a batch until it is known whether it is wanted; one that is too old stays as the past of the next."""
        self._waiting.append((batch, newest))
        self._held += len(batch.frames)
        width = self.window.margin if self.window.last is None else self.window.last
        while len(self._waiting) > 2:
            recent = self._latest is not None and self._waiting[1][1] >= self._latest - width
            if recent and self._held <= MOST_WAITING:
                return
            old, time_ = self._waiting.popleft()
            self._held -= len(old.frames)
            if recent:
                self._dropped = max(self._dropped, time_)

    def _lost(self) -> bool:
        """Whether something was dropped that is inside the window after all."""
        low, _ = self._limits()
        return self._dropped != NEVER and (low is None or self._dropped >= low)

    def _release(self) -> Iterator[tuple[F, Rows, int | None]]:
        while self._waiting:
            yield self._pick(self._waiting.popleft()[0])

    def _conclude(self) -> None:
        """The end of the capture: what was not found until now is not there."""
        window = self.window
        if window.timed and self._frames and self._first is None:
            self.problem = "without times: only --frames and -c can choose a part of it"
        elif self._first is not None and any(
            isinstance(m, Moment) and not m.fits(self._first) for m in (window.start, window.stop, window.around)
        ):
            self.problem = "its times are relative: give seconds from the first frame"
        elif isinstance(window.around, Moment) and self._first is not None:
            self._anchor = window.around.at(self._first)
        elif window.around is not None and self._anchor is None:
            wanted = 1 if isinstance(window.around, Moment) else window.around
            self.problem = (
                f"frame {wanted} has no time: --around cannot tell what is near"
                if wanted <= self._frames
                else f"no frame {wanted}: the capture has {self._frames}"
            )

    def _zero(self) -> int | None:
        return self._first if self._anchor is None else self._anchor

    def _limits(self) -> tuple[int | None, int | None]:
        """Bounds in nanoseconds; bounds that nothing meets where the times needed are not there."""
        window, lows, highs = self.window, list[int](), list[int]()
        if window.timed and self._first is None:
            return _NOTHING
        for moment, bounds in ((window.start, lows), (window.stop, highs)):
            if moment is not None and self._first is not None:
                if not moment.fits(self._first):
                    return _NOTHING
                bounds.append(moment.at(self._first))
        if window.last is not None and self._latest is not None:
            lows.append(self._latest - window.last)
        if window.around is not None:
            if self._anchor is None:
                return _NOTHING
            lows.append(self._anchor - window.margin)
            highs.append(self._anchor + window.margin)
        return max(lows, default=None), min(highs, default=None)


class Selection(Windowed["Batch"]):
    """A window over decoded batches: rows are those of their transfers, in order of the first frames."""

    def _times(self, batch: Batch) -> tuple[Rows, ...]:
        return numbers(batch.transfers.column("t_end")), numbers(batch.frames.column("t"))

    def _pick(self, batch: Batch) -> tuple[Batch, Rows, int | None]:
        zero = self._zero()
        window, transfers = self.window, batch.transfers
        if not len(transfers):
            return batch, np.zeros(0, np.int64), zero
        offsets = np.frombuffer(transfers.column("frame").buffers()[1], np.int32)[: len(transfers) + 1]
        frames = numbers(transfers.column("frame").values)
        first, last = frames[offsets[:-1]], frames[offsets[1:] - 1]
        t, t_end = numbers(transfers.column("t")), numbers(transfers.column("t_end"))
        keep = np.ones(len(transfers), bool)
        low, high = self._limits()
        if low is not None:
            keep &= (t_end >= low) & (t_end != NEVER)
        if high is not None:
            keep &= (t <= high) & (t != NEVER)
        if window.frames is not None:
            keep &= (last + 1 >= window.frames[0]) & (first + 1 <= window.frames[1])
        rows = np.flatnonzero(keep)
        return batch, rows[np.argsort(first[rows], kind="stable")], zero
