"""Text on its way to a pipe or a terminal that may be slow, stopped, or gone. Whoever prints never waits."""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Self

from analyzer.sinks.growing import write_some

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

MOST = 64 << 20  # bytes that may wait
PATIENCE = 2.0  # seconds without progress at the end
_PIECE = 1 << 16


class Printer(AbstractContextManager["Printer"]):
    """Writes to a file descriptor from a thread of its own.

    `lost` counts texts that did not fit into what may wait; `gone` says that nobody reads any more, `problem` why
    nothing more can be written.

    Args:
        file: descriptor; it stays open.
        most: bytes that may wait.
        clock: seconds of a monotonic clock.
    """

    def __init__(self, file: int = 1, most: int = MOST, clock: Callable[[], float] = time.monotonic) -> None:
        self.lost = 0
        self.gone = False
        self.problem: str | None = None
        self._file, self._most, self._clock = file, most, clock
        self._queue: deque[tuple[float, bytes]] = deque()
        self._waiting = self._written = 0
        self._ended = False
        self._changed = threading.Condition()
        self._worker = threading.Thread(target=self._work, name="printer", daemon=True)

    def __enter__(self) -> Self:
        """Start writing."""
        self._worker.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        """Wait for what is left as long as that makes progress; the rest is lost."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        before = -1
        while kind is None and self._worker.is_alive() and before != self._written:
            before = self._written
            self._worker.join(PATIENCE)
        with self._changed:
            self.lost += len(self._queue)
            self._queue.clear()

    def put(self, text: str) -> None:
        """Take the next text, to be written in UTF-8."""
        data = text.encode("utf-8", "backslashreplace")
        with self._changed:
            if self.gone or self.problem is not None:
                return
            if self._waiting and self._waiting + len(data) > self._most:
                self.lost += 1
                return
            self._queue.append((self._clock(), data))
            self._waiting += len(data)
            self._changed.notify_all()

    @property
    def behind(self) -> float:
        """Seconds since the oldest text came that waits."""
        with self._changed:
            return self._clock() - self._queue[0][0] if self._queue else 0.0

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._queue and not self._ended:
                    self._changed.wait()
                if not self._queue:
                    return
                _, data = self._queue[0]
            try:
                self._write(data)
            except OSError as error:
                self._fail(error)
                return
            with self._changed:
                if self._queue:
                    self._queue.popleft()
                self._waiting -= len(data)

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            count = write_some(self._file, view[:_PIECE])
            self._written += count
            view = view[count:]

    def _fail(self, error: OSError) -> None:
        with self._changed:
            if isinstance(error, BrokenPipeError):
                self.gone = True
            else:
                self.problem = error.strerror or str(error)
            self._queue.clear()
