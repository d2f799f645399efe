"""The recorder of a live session: a thread of its own writes, so that no disk holds up the bus."""

from __future__ import annotations

import time
from collections import deque
from contextlib import AbstractContextManager
from threading import Condition, Thread
from typing import TYPE_CHECKING

from analyzer.live.frame_batches import FrameLosses, count_frames, count_rows, pick_comments
from analyzer.live.recording.files import Files
from analyzer.sinks.atomic import TargetError
from analyzer.sinks.growing import GoneError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from types import TracebackType

    from analyzer._native import FrameBatch
    from analyzer.live.recording.plan import RecordingPlan
    from analyzer.report.newest import Change

# Rows that may wait for the disk, 34 s of a full bus of 1 Mbit/s: at most 30 MB.
MOST = 1 << 18
# Seconds that a row waits at most until the system has it, and until the disk has it, which may take its time.
FLUSHED, SYNCED = 0.25, 5.0
# Seconds that the end of a session waits for a disk that does not answer.
PATIENCE = 10.0


class FileRecorder(AbstractContextManager["FileRecorder"]):
    """Records the batches that it is given, in the form of `AsRecorded`.

    It opens the file at once, which raises `TargetError`. `put` and the properties are for one thread, the session's.

    What came more than `FLUSHED` seconds ago is in the file, which can be read up to there: candump and pcapng end with
    a whole record, MCAP with a whole chunk (only its summary is missing then), packed files with a whole member. When
    the disk is too slow, up to `most` rows wait; frames beyond are lost, counted, and told by drop counts in front of
    the next row. When it is full, or cannot be written, recording ends and `problem` says so: what had been flushed
    before stays, and every frame since then is counted as lost.
    """

    def __init__(
        self,
        plan: RecordingPlan,
        *,
        most: int = MOST,
        flushed: float = FLUSHED,
        synced: float = SYNCED,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.problem: str | None = None
        self.gone = False  # the problem is that whoever read a pipe has had enough
        self._files = Files(plan)
        self._most, self._flushed, self._synced, self._clock = most, flushed, synced, clock
        self._changed = Condition()
        self._queue: deque[FrameBatch] = deque()
        self._waiting = self._lost = self._taken = 0
        self._losses = FrameLosses()
        self._ended = self._anew = False
        self._notes: list[str] = []
        self._behind = False
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Finish the file."""
        self.close()

    def put(self, batch: FrameBatch) -> None:
        """Take the next rows. Never waits for the disk."""
        size = count_rows(batch)
        if not size:
            return
        with self._changed:
            if self.problem is not None or self._ended:
                self._lost += count_frames(batch)
            elif self._waiting and self._waiting + size > self._most:
                self._refuse(batch)
            else:
                self._tell()
                self._add(batch, size)
                self._behind = False
                self._changed.notify()

    def take_findings(self, changes: Iterable[Change]) -> None:
        """Take findings, which make no difference here."""

    def record_now(self, why: str) -> None:
        """Ignore that somebody wants what is there now to be recorded: it is."""

    def begin_anew(self) -> None:
        """Begin a new file under the same name, if somebody has taken the one that is written away; or the next one."""
        with self._changed:
            self._anew = True
            self._changed.notify()

    def notes(self) -> list[str]:
        """Return what has happened since the last call, a line each."""
        with self._changed:
            notes, self._notes = self._notes, []
        return [*self._files.notes(), *notes]

    @property
    def frames(self) -> int:
        """Frames that can be read in the files, or could before a file was deleted."""
        return self._files.frames

    @property
    def error_frames(self) -> int:
        """Error frames that can be read there."""
        return self._files.error_frames

    @property
    def begun_anew(self) -> bool:
        """True if the names that it was given do not hold all of it any more."""
        return self._files.begun_anew

    @property
    def lost(self) -> int:
        """Frames and error frames that were put and will not be read."""
        with self._changed:
            return self._lost

    @property
    def bytes(self) -> int:
        """The bytes that were written, in all files together."""
        return self._files.bytes

    @property
    def full(self) -> int:
        """Files of a ring that have had enough."""
        return self._files.full

    @property
    def files(self) -> list[str]:
        """The files that are there, the one that is written last."""
        return list(self._files.names)

    def close(self) -> None:
        """Write what waits, however long it takes, and finish the file.

        A disk that has taken nothing within `PATIENCE` is given up.
        """
        with self._changed:
            if not self._ended:
                self._tell()
            self._ended = True
            self._changed.notify()
        before = None
        while self._thread.is_alive() and before != (now := (self._waiting, self._files.bytes)):
            before = now
            self._thread.join(PATIENCE)
        if self._thread.is_alive():
            self._fail(f"{self._files.current}: takes no more data; what follows is not recorded")

    def _refuse(self, batch: FrameBatch) -> None:
        """Count a batch as lost, as too many rows wait. Comments are few, and always have room."""
        comments = pick_comments(batch)
        if comments is not None:
            self._tell()
            self._add(comments, count_rows(comments))
        self._losses.feed(batch)
        lost = count_frames(batch)
        self._lost += lost
        if lost and not self._behind:
            self._notes.append("the disk is too slow: frames are missing in the recording")
            self._behind = True

    def _tell(self) -> None:
        """Add drop counts for frames that were lost because too many rows waited."""
        drops = self._losses.take()
        if drops is not None:
            self._add(drops, count_rows(drops))

    def _add(self, batch: FrameBatch, size: int) -> None:
        self._queue.append(batch)
        self._waiting += size

    def _fail(self, problem: str) -> None:
        with self._changed:
            if self.problem is None:
                self.problem = problem
                self._notes.append(problem)
                put = self._taken + sum(map(count_frames, self._queue))
                self._lost += put - self._files.frames - self._files.error_frames
                self._queue.clear()
                self._waiting = 0

    def _run(self) -> None:
        try:
            self._record()
        except TargetError as error:
            self.gone = isinstance(error, GoneError)
            self._fail(f"{error}; recording ends with {self._files.frames} frames")
            self._files.abandon()
        except Exception as error:  # noqa: BLE001 - the session goes on without a recording, and must know
            self._fail(f"{self._files.current}: {type(error).__name__}: {error}; recording has ended")
            self._files.abandon()

    def _record(self) -> None:
        files = self._files
        flush = sync = self._clock()
        while True:
            dirty = files.dirty
            ends = [flush + self._flushed] * dirty + [sync + self._synced] * files.unsynced
            with self._changed:
                wait = max(min(ends) - self._clock(), 0.0) if ends else None
                self._changed.wait_for(lambda: self._queue or self._ended or self._anew, wait)
                batches, self._queue = self._queue, deque()
                ended, anew, self._anew = self._ended, self._anew, False
                self._taken += sum(map(count_frames, batches))
            if batches and not dirty:
                flush = self._clock()  # counts from the first row that waits
            for batch in batches:
                files.write(batch)
                with self._changed:
                    self._waiting -= count_rows(batch)
            if anew:
                files.begin_anew()
            if ended and not batches:
                files.close()
                return
            if self._clock() >= flush + self._flushed:
                files.flush()
                flush = self._clock()
            if files.unsynced and self._clock() >= sync + self._synced:
                files.look()
                files.sync()
                sync = self._clock()
