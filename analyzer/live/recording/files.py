"""The files of a recording, one after the other: written, flushed, finished, and deleted when there are too many."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

from analyzer.live import remarks
from analyzer.live.frame_batches import OrderedRows
from analyzer.live.recording.ring import Ring
from analyzer.sinks import open_sink
from analyzer.sinks.atomic import TargetError
from analyzer.sinks.growing import GrowingFile

if TYPE_CHECKING:
    from analyzer._native import FrameBatch
    from analyzer.live.recording.plan import RecordingPlan
    from analyzer.sinks import Sink

# Rows between two looks at the size of a file: it may be longer than asked for by so many.
STEP = 256
# Bytes that are gathered at most before they are handed over.
_GATHERED = 1 << 20


class Files:
    """Writes batches to one file, or to those of a ring. Everything may raise `TargetError`; then `abandon` it.

    A file is opened before the last one is finished, and the oldest one deleted after that. Each of them can be read
    alone: it has all that the format puts in front. Together they hold what one file would hold.
    """

    def __init__(self, plan: RecordingPlan) -> None:
        if plan.ring is not None and plan.path == "-":
            raise TargetError("-b", "files of a ring need names: -w FILE")
        self._plan = plan
        self._ring = None if plan.ring is None else Ring(plan.ring, plan.path)
        self._notes: list[str] = []
        # Of the files that are finished.
        self._frames = self._bytes = 0
        self._errors = self.error_frames = 0
        self.frames = self.full = 0
        self.begun_anew = False
        self.names: list[str] = []
        self.unsynced = self._used = False
        self._file, self._sink = self._open()

    @property
    def current(self) -> str:
        """The file that is written."""
        return self._file.path

    @property
    def bytes(self) -> int:
        """The bytes that all files had together, flushed."""
        return self._bytes + self._file.size

    @property
    def dirty(self) -> bool:
        """True if anything waits for `flush`."""
        return bool(self._file.gathered or self._sink.held)

    def notes(self) -> list[str]:
        """Return what has happened since the last call, a line each."""
        notes, self._notes = self._notes, []
        return notes

    def write(self, batch: FrameBatch) -> None:
        """Write the rows of a batch, some of them into new files if it is time."""
        if self._ring is None:
            self._write(batch)
            return
        if self._over():
            self._next()
        if self._ring.plan.size is None and self._ring.plan.frames is None:
            self._write(batch)
            return
        ordered = OrderedRows(batch)
        at = 0
        while at < len(ordered):
            if self._over():
                self._next()
            end = at + STEP
            left = self._left()
            if left is not None:
                end = min(end, ordered.behind_frame(int(ordered.frame[:at].sum()) + left))
            self._write(ordered.take(slice(at, end)))
            at = end

    def flush(self) -> None:
        """Bring everything so far into the file, so that it can be read."""
        self._sink.flush()
        self._file.flush()
        self.frames = self._frames + self._sink.frames
        self.error_frames = self._errors
        self.unsynced = True

    def sync(self) -> None:
        """Begin to bring it to the disk."""
        self._file.sync_aside()
        self.unsynced = False

    def begin_anew(self) -> None:
        """Begin the next file of a ring, else one under the same name, if that is free."""
        if self._ring is not None:
            self._next()
        elif Path(self._plan.path).exists():
            self._notes.append(f"{self.current}: is there, and goes on: move it away, then a new one begins")
        else:
            self._begin_anew("")

    def look(self) -> None:
        """Begin anew if somebody has deleted the file: what goes into it nobody will read."""
        if self._file.deleted:
            self._begin_anew(f"has been deleted, with {self._sink.frames:,} frames; ")

    def close(self) -> None:
        """Finish the file."""
        if self._file.deleted:
            raise TargetError(self.current, "has been deleted")
        self._sink.close()
        self.flush()
        self._file.sync()
        self._file.close()

    def abandon(self) -> None:
        """Let go of a file that cannot be written."""
        with suppress(TargetError):
            self._file.close()

    def _write(self, batch: FrameBatch) -> None:
        self._sink.write(batch)
        self._errors += batch.lines["error_frames"]
        self._used = True
        if self._file.gathered >= _GATHERED:
            self.flush()

    def _left(self) -> int | None:
        """Count the frames that the file still takes; None if they are not counted, or no other file follows."""
        more = self._plan.files is None or self.full + 1 < self._plan.files
        return self._ring.left(self._sink.frames) if self._ring is not None and more else None

    def _over(self) -> bool:
        """Return True if the file has had enough; one without rows never has, nor one that takes the rest."""
        file, sink, ring = self._file, self._sink, self._ring
        if ring is None or not self._used or self.full == self._plan.files:
            return False
        size, most = file.size + file.gathered + sink.held, ring.plan.size
        if most is not None and size >= most and (self._plan.packing or sink.held):
            self.flush()  # packed it may be smaller
            size = file.size
        return ring.over(size) or ring.left(sink.frames) == 0

    def _begin_anew(self, why: str) -> None:
        del self.names[-1]
        self._notes.append(f"{self.current}: {why}a new file begins")
        self.begun_anew = True
        self._change()

    def _next(self) -> None:
        self.full += 1
        if self.full == self._plan.files:
            return
        self._change()
        self._delete()

    def _change(self) -> None:
        """Open a file, then finish the one before."""
        old, sink = self._file, self._sink
        try:
            self._file, self._sink = self._open()
        except TargetError:
            with suppress(TargetError):
                self.close()
            raise
        sink.close()
        old.flush()
        old.sync()
        self._frames += sink.frames
        self._bytes += old.size
        old.close()

    def _open(self) -> tuple[GrowingFile, Sink]:
        plan, path = self._plan, self._plan.path
        if self._ring is not None:
            path = self._ring.next_name()
            while Path(path).exists():  # of a session that began in the same second
                path = self._ring.next_name()
        file = GrowingFile(path, plan.packing, force=plan.force)
        sink = open_sink(plan.form, cast("BinaryIO", file), compression=plan.compression, recording=True)
        if plan.header:
            sink.write(remarks.make_comment(time.time_ns(), plan.header))
            sink.flush()
        file.flush()
        self._used = False
        self.names.append(file.path)
        return file, sink

    def _delete(self) -> None:
        """Delete the oldest files, if there are too many."""
        most = self._ring.plan.files if self._ring is not None else None
        while most is not None and len(self.names) > most:
            name = self.names.pop(0)
            try:
                Path(name).unlink(missing_ok=True)
            except OSError as error:
                self._notes.append(f"{name}: cannot be deleted: {error.strerror or error}")
