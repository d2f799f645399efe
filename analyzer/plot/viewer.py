"""A recording on its way to a viewer that may be slow, hung, or gone.

What Rerun is given it takes until its own memory for it is full, and then waits for ever; so a thread of ours hands it
a little at a time, and looks whether that has arrived. Whoever sends waits for room, or goes on without what did not
fit, as it likes; neither waits for a viewer that is gone.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Self

import rerun as rr

from analyzer.plot.output import APPLICATION
from analyzer.sinks.atomic import TargetError
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

    from rerun.blueprint import Blueprint
    from rerun.chunk import Chunk

    from analyzer.plot.address import Address

_GREETING = 5.0  # seconds for the first answer
PATIENCE = 30.0  # seconds without any progress until a viewer counts as hung
_CLOSING = 2.0  # seconds for what waits at the end, when nobody waits
_STEP = 0.5
_LATE = "the viewer did not take the rest in time"
# Rows that may be under way, and as many of them inside of Rerun.
MOST_WAITING = 1_000_000
_PIECE = 200_000


class _GoneError(Exception):
    """Why nothing more goes to the viewer."""


@dataclass(frozen=True, slots=True)
class _Piece:
    chunks: Sequence[Chunk] = ()
    blueprint: Blueprint | None = None
    rows: int = 0


class ViewerOutput(AbstractContextManager["ViewerOutput"]):
    """A recording as it goes to a viewer.

    Args:
        address: of the viewer.
        name: of the recording, for people.
        waits: whether `send` waits for room and raises `TargetError` when the viewer is gone. If not, it never waits
            and never raises: `dropped` counts rows that the viewer did not get, `problem` says why it gets no more.
        patience: seconds without progress after which a viewer that is waited for counts as hung.
    """

    def __init__(self, address: Address, name: str, *, waits: bool = True, patience: float = PATIENCE) -> None:
        self.dropped = 0
        self.problem: str | None = None
        self._address, self._name, self._waits, self._patience = address, name, waits, patience
        self._queue: deque[_Piece] = deque()
        self._rows = 0  # queued, or inside of Rerun
        self._ended = self._abandoned = False
        self._changed = threading.Condition()
        self._worker = threading.Thread(target=self._work, name="viewer", daemon=True)

    def __enter__(self) -> Self:
        """Find out if the viewer is there. Raises `TargetError` if it is waited for and is not."""
        try:
            self._address.probe()
        except OSError as error:
            self._lose(f"no viewer is there ({error.strerror or error})")
        else:
            self._worker.start()
        self._raise()
        return self

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        """Wait until the viewer has everything, while that makes progress. Raises `TargetError` if it did not."""
        with self._changed:
            self._ended = True
            self._abandoned = kind is not None
            self._changed.notify_all()
        if self._worker.ident is None:
            return
        if self._waits and kind is None:
            with self._changed:
                while not self.problem and self._rows:
                    self._changed.wait(_STEP)
            self._worker.join(self._patience)  # what Rerun calls sent may still be its own
        else:
            self._worker.join(_CLOSING if kind is None else _STEP)
        self._abandoned = True
        self._worker.join(2 * _STEP)
        if self._worker.is_alive():  # Rerun does not give up; the program shall not wait for it at its end
            rr.unregister_shutdown()
            if self.problem is None:
                self._lose(_LATE)
        if kind is None:
            self._raise()

    def send(self, chunks: Sequence[Chunk]) -> None:
        """Send the next chunks."""
        rows = sum(chunk.num_rows for chunk in chunks)
        with self._changed:
            while self._waits and not self.problem and self._rows and self._rows + rows > MOST_WAITING:
                self._changed.wait(_STEP)
            self._raise()
            if self.problem or (self._rows and self._rows + rows > MOST_WAITING):
                looks = [] if self.problem else [chunk for chunk in chunks if chunk.is_static]
                self.dropped += rows - len(looks)
                chunks, rows = looks, len(looks)
            if chunks:
                self._put(_Piece(chunks=chunks, rows=rows))

    def layout(self, blueprint: Blueprint) -> None:
        """Say how a viewer is to show it."""
        with self._changed:
            self._raise()
            if not self.problem:
                self._put(_Piece(blueprint=blueprint, rows=1))

    def _put(self, piece: _Piece) -> None:
        self._queue.append(piece)
        self._rows += piece.rows
        self._changed.notify_all()

    def _raise(self) -> None:
        if self._waits and self.problem:
            raise TargetError(str(self._address), self.problem)

    def _lose(self, problem: str) -> None:
        with self._changed:
            self.problem = problem
            self.dropped += self._rows
            self._rows = 0
            self._queue.clear()
            self._changed.notify_all()

    def _work(self) -> None:
        recording = rr.RecordingStream(APPLICATION, send_properties=False)
        try:
            recording.connect_grpc(str(self._address))
            recording.send_recording_name(self._name)
            self._flush(recording, _GREETING, "what is there does not answer as a viewer does")
            self._deliver(recording)
        except _GoneError as gone:
            self._lose(str(gone))
        except Exception as error:  # noqa: BLE001 - it is told where it can be dealt with
            self._lose(str(error))
        recording.disconnect()  # waits for the viewer to take what is left, for ever if it is hung

    def _deliver(self, recording: rr.RecordingStream) -> None:
        inside = 0
        while True:
            with self._changed:
                while not (self._queue or self._ended or inside):
                    self._changed.wait()
                piece = self._queue.popleft() if self._queue else None
                if piece is None and not inside:
                    return
            if piece is not None:
                if piece.chunks:
                    rr.send_chunks(piece.chunks, recording=recording)
                if piece.blueprint is not None:
                    recording.send_blueprint(piece.blueprint, make_active=False, make_default=True)
                inside += piece.rows
            if piece is None or inside > _PIECE:
                self._flush(recording, self._patience, f"the viewer has taken nothing for {self._patience:g} s")
                with self._changed:
                    self._rows = max(self._rows - inside, 0)
                    self._changed.notify_all()
                inside = 0

    def _flush(self, recording: rr.RecordingStream, patience: float, hung: str) -> None:
        """Wait until what Rerun was given is gone. Raises `_GoneError`."""
        end = time.monotonic() + patience
        while True:
            try:
                recording.flush(timeout_sec=_STEP)
            except RuntimeError as error:
                if "timed out" not in str(error):
                    raise _GoneError("the viewer has closed the connection") from None
            else:
                return
            if self._abandoned:
                raise _GoneError(_LATE)
            if self._waits and time.monotonic() > end:
                raise _GoneError(hung)
