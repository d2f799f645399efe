"""Time that runs while something is recorded: holes of a recording and steps of its clock are taken out of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import lasting, threshold
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit.cells import numbers, valid
from dissectors.kit.order import steps
from dissectors.records import dataclass, field
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

MOST_HOLES = 4096
ANEW = 255
_RESTARTED = 1 << TRANSFER_ANOMALIES.index("transfer id restarted")


@dataclass(slots=True)
class Hole:
    """A time without any frame, or a step of the clock: `t` is before it, `t_end` at the `frame` behind it.

    `steps` counts how the transfer IDs of senders go on behind it: in order, with a jump, from their start. `uptimes`
    is by how many nanoseconds nodes grew older in it, as far as they say.
    """

    frame: int
    t: int
    t_end: int
    steps: list[int] = field(default_factory=lambda: [0, 0, 0])
    uptimes: list[int] = field(default_factory=list)

    @property
    def length(self) -> int:
        """How far the clock went, negative for back."""
        return self.t_end - self.t


class RowPlaces:
    """When and where rows were: `t` by the capture's clock, `ran` while it was recorded, first and last `frame`.

    Times in nanoseconds, `NO_TIME` for none, frames from 0. `step` is how far the transfer ID went from the one before,
    `ANEW` where its sender began again. Columns of some rows are made when somebody asks for them, most never are.
    """

    __slots__ = ("_columns", "_ends", "_made", "_pace", "_rows")

    def __init__(
        self, t: Array, ran: Array, frame: Array, frame_end: Array, step: Array, rows: Array | None = None
    ) -> None:
        """Take the columns, and which of their rows it is about; None for all."""
        self._columns = t, ran, frame, frame_end, step
        self._rows = rows
        self._made: list[Array | None] = [None] * len(self._columns)
        self._ends: dict[int, Spot] = {}
        self._pace: tuple[int, int] | None = None

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._columns[0] if self._rows is None else self._rows)

    @property
    def t(self) -> Array:
        """Times by the capture's clock."""
        return self._column(0)

    @property
    def ran(self) -> Array:
        """Times while it was recorded."""
        return self._column(0 if self._columns[1] is self._columns[0] else 1)

    @property
    def frame(self) -> Array:
        """First frames."""
        return self._column(2)

    @property
    def frame_end(self) -> Array:
        """Last frames."""
        return self._column(3)

    @property
    def step(self) -> Array:
        """Steps of the transfer ID."""
        return self._column(4)

    @property
    def pace(self) -> tuple[int, int]:
        """The least and the most recorded time from one to the next, 0 of a single one."""
        if self._pace is None:
            apart = np.diff(self.ran)
            self._pace = (int(apart.min()), int(apart.max())) if len(apart) else (0, 0)
        return self._pace

    def take(self, rows: Array | slice) -> RowPlaces:
        """Return some of them: places, or a mask."""
        if self._rows is not None:
            return RowPlaces(*self._columns, self._rows[rows])
        if isinstance(rows, slice):
            t, ran, *others = self._columns
            some = t[rows]
            return RowPlaces(some, some if ran is t else ran[rows], *(one[rows] for one in others))
        return RowPlaces(*self._columns, np.flatnonzero(rows) if rows.dtype == np.bool_ else rows)

    def followed_by(self, others: RowPlaces) -> RowPlaces:
        """Return these, and others behind them."""
        names = ("t", "ran", "frame", "frame_end", "step")
        return RowPlaces(*(np.concatenate((getattr(self, name), getattr(others, name))) for name in names))

    def settled(self) -> RowPlaces:
        """Return the same, to be kept: nothing of what it was taken from is held any more."""
        t, ran, *others = self._columns
        if self._rows is None:
            own = t.copy()
            return RowPlaces(own, own if ran is t else ran.copy(), *(one.copy() for one in others))
        own = t[self._rows]
        return RowPlaces(own, own if ran is t else ran[self._rows], *(one[self._rows] for one in others))

    def at(self, row: int) -> Spot:
        """Return one of them; the first and the last one are asked for by everybody."""
        if -1 <= row <= 0:
            if (known := self._ends.get(row)) is None:
                known = self._ends[row] = self._spot(row)
            return known
        return self._spot(row)

    def spots(self, rows: Array) -> list[Spot]:
        """Return those at some places."""
        places = rows if self._rows is None else self._rows[rows]
        t, ran, *others = self._columns
        times = t[places].tolist()  # the same numbers twice, as long as nothing was left out of the recording
        columns = times, times if ran is t else ran[places].tolist(), *(one[places].tolist() for one in others)
        return list(map(Spot._make, zip(*columns, strict=True)))

    def _spot(self, row: int) -> Spot:
        place = row if self._rows is None else self._rows.item(row)
        t, ran, frame, frame_end, step = self._columns
        now, first, last = t.item(place), frame.item(place), frame_end.item(place)
        last = first if last == first else last
        return Spot(now, now if ran is t else ran.item(place), first, last, step.item(place))

    def _column(self, number: int) -> Array:
        if self._rows is None:
            return self._columns[number]
        made = self._made[number]
        if made is None:
            made = self._made[number] = self._columns[number][self._rows]
        return made


class Spot(NamedTuple):
    """One place, as `RowPlaces` has them."""

    t: int
    ran: int
    frame: int
    frame_end: int
    step: int


class RecordedClock:
    """Follows the frames of a capture. Bound: `MOST_HOLES`, of which the first are kept as they were."""

    def __init__(self) -> None:
        self.holes: list[Hole] = []
        self.last: int | None = None  # time of the last frame
        self._borders: Array = np.array([np.iinfo(np.int64).min])  # frames from which on each shift holds
        self._shifts: Array = np.zeros(1, np.int64)
        self._first: int | None = None
        self._count = 0
        self._hole_frames = self._hole_lengths = np.zeros(0, np.int64)
        self._hole, self._slow = lasting("hole"), lasting("slow_hole")
        self._fewest, self._factor = threshold("hole_frames"), threshold("hole_factor")
        self.release()
        self._base = 0

    def feed(self, batch: Batch) -> None:
        """Take the frames of the next batch, then the places of its transfers."""
        column = batch.frames.column("t")
        t, rows = numbers(column), None
        if column.null_count:
            rows = np.flatnonzero(valid(column))
            t = t[rows]
        if len(t):
            self._note(t, rows, batch.first_frame)
        self._base = batch.first_transfer
        column = batch.transfers.column("frame")
        frames, ends = numbers(column.values).view(np.int64), np.asarray(column.offsets).astype(np.intp)
        places = (ends[:-1], ends[1:] - 1) if len(column) else (slice(0), slice(0))
        first, last = (frames[place] for place in places)
        began = batch.transfers.column("t")
        start = np.where(valid(began), numbers(began), NO_TIME) if began.null_count else numbers(began)
        step = numbers(batch.transfers.column("step")).astype(np.int64)
        anew = numbers(batch.transfers.column("anomaly")) & _RESTARTED != 0
        if anew.any():
            step[anew] = ANEW
        self._transfers = self._placed(start, first, last, step)

    def _note(self, t: Array, rows: Array | None, base: int) -> None:
        """Take times, and the rows that have them, None for all."""
        before = int(t[0]) if self.last is None else self.last
        if self._first is None:
            self._first = before
        apart = steps(t, before)
        far, back = self._hole, -lasting("clock_back")
        if apart.max() > far or apart.min() < back:
            odd = np.flatnonzero((apart > far) | (apart < back))
            self._note_steps(odd, base + (odd if rows is None else rows[odd]), t[odd], apart[odd])
        self._count += len(t)
        self.last = int(t[-1])
        self._trim()

    def _note_steps(self, rows: Array, frames: Array, times: Array, steps_: Array) -> None:
        """Take rows of a batch before which much time passed, or some went back: their frames, times and steps."""
        since, before = times - steps_, self._shifts[-1]
        count, ran = self._count + rows, since - (self._first or 0) + before
        # How long nothing may come depends on what was a hole before. What agrees with itself is what is found one by
        # one: with each round, at least one more row from the first on does.
        holes, known = np.ones(len(rows), bool), np.zeros(len(rows), bool)
        while not np.array_equal(holes, known):
            known = holes
            lost = np.where(known, steps_, 0)
            holes = (steps_ < 0) | (steps_ > self._usual(count, ran - (np.cumsum(lost) - lost)))
        room = max(0, MOST_HOLES - len(self.holes))
        kept = np.flatnonzero(holes)
        columns = (column[kept[:room]].tolist() for column in (frames, since, times))
        self.holes += map(Hole, *columns)
        self._borders = np.concatenate((self._borders, frames[kept]))
        self._shifts = np.concatenate((self._shifts, before - np.cumsum(steps_[kept])))

    def _usual(self, count: Array, ran: Array) -> Array:
        """Return how long nothing may come after so many frames in so much time."""
        slow = self._slow
        far = self._factor * (ran / np.maximum(count, 1))
        usual = np.where(far < slow, np.maximum(self._hole, far), np.maximum(slow, far / 10))
        found: Array = np.where(count < self._fewest, slow, usual)
        return found

    def _trim(self) -> None:
        """Forget where shifts began that no transfer can ask for any more."""
        if len(self._borders) > 2 * MOST_HOLES:
            self._borders, self._shifts = (
                np.concatenate((one[:1], one[-MOST_HOLES:])) for one in (self._borders, self._shifts)
            )

    def _placed(self, t: Array, frame: Array, frame_end: Array, step: Array) -> RowPlaces:
        if len(self._borders) == 1:
            return RowPlaces(t, t, frame, frame_end, step)
        shifts = self._shifts[np.searchsorted(self._borders, frame, "right") - 1]
        return RowPlaces(t, np.where(t == NO_TIME, NO_TIME, t + shifts), frame, frame_end, step)

    def release(self) -> None:
        """Let the transfers of the batch go."""
        self._transfers = RowPlaces(*(np.zeros(0, np.int64),) * 5)

    @property
    def transfers(self) -> RowPlaces:
        """The transfers of the batch; `t` is `NO_TIME` for those without a time."""
        return self._transfers

    @property
    def ran(self) -> int | None:
        """The end of the recording so far; None without times."""
        return None if self.last is None else self.last + int(self._shifts[-1])

    @property
    def start(self) -> int | None:
        """The start of the recording, at which `ran` begins; None without times."""
        return self._first

    def of(self, table: pa.RecordBatch) -> RowPlaces:
        """Return the places of the rows of a message table of the batch."""
        return self._transfers.take(numbers(table.column("transfer")).view(np.int64) - self._base)

    def shifted(self, t: Array, frame: Array) -> RowPlaces:
        """Return the places of what else has a time, and the frame that it is at."""
        return self._placed(t, frame, frame, np.zeros(len(t), np.int64))

    def places_of_holes(self) -> list[int]:
        """Return the recorded times at which the kept holes are."""
        columns = [hole.t_end for hole in self.holes], [hole.frame for hole in self.holes]
        found: list[int] = self.shifted(*(np.array(column, np.int64) for column in columns)).ran.tolist()
        return found

    def holes_before(self, frame: Array) -> Array:
        """Return how many of the kept holes end at or before each frame."""
        if len(self._hole_frames) < len(self.holes):
            self._hole_frames = np.array([hole.frame for hole in self.holes], np.int64)
            self._hole_lengths = np.array([hole.length for hole in self.holes], np.int64)
        found: Array = np.searchsorted(self._hole_frames, frame, "right")
        return found

    def lengths_before(self, behind: Array) -> Array:
        """Return the length of the last one of so many holes, at least one, as `holes_before` has counted them."""
        found: Array = self._hole_lengths[behind - 1]
        return found
