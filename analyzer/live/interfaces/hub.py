"""Several interfaces at once: a thread empties each of them, and what has come goes on as one stream, by time.

Bounds: up to `most` rows wait to be taken. What comes while they do is lost, counted, and told by one row in front of
the next rows of that interface that fit. Taken rows of several interfaces are held until the next call, so that what
another one delivers late finds its place: twice `most` rows in memory at the worst.
"""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from threading import Condition, Thread
from typing import TYPE_CHECKING, Self

from analyzer._native import Merger
from analyzer.live import remarks
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import TracebackType

    from analyzer._native import FrameBatch
    from analyzer.live.interfaces.receiver import Receiver

MOST = 1 << 20
# Seconds that a receiver waits before it looks whether it shall end, and that its thread is waited for at the end.
SLICE, PATIENCE = 0.1, 5.0
# Bytes of a name that rows keep.
_NAME = 64


@dataclass(frozen=True, slots=True)
class InterfaceCounts:
    """Frames and error frames of an interface; the sum is everything that reached its socket.

    `received` frames and `errors`, which the controller made, went on to the one who takes, or will; `dropped` were
    lost by the kernel, as far as it says; `lost` came while too many rows waited.
    """

    received: int = 0
    dropped: int = 0
    lost: int = 0
    errors: int = 0


class Hub(AbstractContextManager["Hub"]):
    """Receives from its `with` on until `close`, which lets go of the interfaces.

    Args:
        receivers: open interfaces with different names.
        most: rows that may wait.
        clock: nanoseconds since 1970.

    Raises `ValueError` if two of them have one name.
    """

    def __init__(
        self, receivers: Sequence[Receiver], most: int = MOST, clock: Callable[[], int] = time.time_ns
    ) -> None:
        names = [receiver.name.encode()[:_NAME] for receiver in receivers]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"{twice.pop().decode(errors='replace')} is given twice")
        self._receivers, self._most, self._clock = tuple(receivers), most, clock
        self._changed = Condition()
        self._waiting: list[tuple[int, FrameBatch]] = []
        self._rows = 0
        self._marked = self._stopped = False
        self._running = 0
        self._counts = [InterfaceCounts() for _ in receivers]
        # By interface: losses that no row has told yet.
        self._untold = [0] * len(self._receivers)
        self._notes: list[str] = []
        self._threads = [
            Thread(target=self._run, args=(index,), name=receiver.name, daemon=True)
            for index, receiver in enumerate(self._receivers)
        ]
        # The last input is for marks. No input is waited for: a bus may be silent.
        self._merger = Merger([(0, []) for _ in range(len(self._receivers) + 1)], same_bus=False)
        for index in range(len(self._receivers) + 1):
            self._merger.finish(index)
        # Names in the order of the receivers, whoever is the first to deliver something.
        for index, receiver in enumerate(self._receivers):
            self._merger.push(index, remarks.make_empty(receiver.name), "")

    def __enter__(self) -> Self:
        """Begin to receive."""
        self._running = len(self._threads)
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """End receiving."""
        self.close()

    def take(self, seconds: float) -> FrameBatch | None:
        """Return the rows that have come, by time, after gathering for so many seconds; None if there are none.

        It returns early when half of the room is taken and once all interfaces have failed. After `close` it gives the
        rest at once. The rows of one interface stay in their order, and its index is the same in all batches.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._rows >= self._most // 2 or self.ended, seconds)
            waiting, self._waiting, self._rows = self._waiting, [], 0
            later = not self.ended and (len(self._receivers) > 1 or self._marked)
            self._marked = False
        for index, batch in waiting:
            self._merger.push(index, batch, "")
        batch = self._merger.take_later() if later else self._merger.take()
        return batch if batch.lines["lines"] else None

    def add_comment(self, text: str) -> None:
        """Place a comment in the stream, with the time of now."""
        with self._changed:
            self._waiting.append((len(self._receivers), remarks.make_comment(self._clock(), text)))
            self._marked = True

    @property
    def counts(self) -> dict[str, InterfaceCounts]:
        """The frames so far by what became of them, by interface."""
        with self._changed:
            return {receiver.name: count for receiver, count in zip(self._receivers, self._counts, strict=True)}

    @property
    def ended(self) -> bool:
        """True if nothing more will come: all interfaces have failed, or it is closed."""
        return self._running <= 0

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        with self._changed:
            notes, self._notes = self._notes, []
        return [*notes, *(note for receiver in self._receivers for note in receiver.notes())]

    def close(self) -> None:
        """End the threads and let go of the interfaces; what they had is there to be taken.

        A driver that does not come back within `PATIENCE` is left alone, with its device, and there is a note of it.
        """
        if self._stopped:
            return
        self._stopped = True
        for receiver in self._receivers:
            receiver.wake()
        end = time.monotonic() + PATIENCE
        for receiver, thread in zip(self._receivers, self._threads, strict=True):
            if thread.ident is not None:
                thread.join(max(0.0, end - time.monotonic()))
            if thread.is_alive():
                self._note(f"{receiver.name}: its driver does not answer, it is left open")
            else:
                receiver.close()
        with self._changed:
            self._running = 0
            for index in range(len(self._receivers)):
                self._tell(index, None)

    def _run(self, index: int) -> None:
        receiver = self._receivers[index]
        for part in (self._receive, self._finish):
            try:
                part(index)
            except Exception as error:  # noqa: BLE001 - of a driver: the other interfaces go on, and it is told
                receiver.failed = f"{type(error).__name__}: {error}"
                self._note(f"{receiver.name}: {receiver.failed}; nothing more is received")
        with self._changed:
            self._running -= 1
            self._changed.notify_all()

    def _receive(self, index: int) -> None:
        receiver = self._receivers[index]
        while not self._stopped and receiver.failed is None:
            batch = receiver.receive(SLICE)
            if batch is not None:
                self._add(index, batch)

    def _finish(self, index: int) -> None:
        for batch in self._receivers[index].finish():
            self._add(index, batch)

    def _note(self, text: str) -> None:
        with self._changed:
            self._notes.append(text)

    def _add(self, index: int, batch: FrameBatch) -> None:
        lines = batch.lines
        frames = lines["lines"] - lines["comments"] - lines["drops"]
        with self._changed:
            count = self._counts[index]
            dropped = count.dropped + lines["dropped_frames"]
            # Comments are few, and always have room.
            if lines["lines"] > lines["comments"] and self._rows + lines["lines"] > self._most:
                self._untold[index] += frames + lines["dropped_frames"]
                self._counts[index] = replace(count, dropped=dropped, lost=count.lost + frames)
                return
            if frames and self._untold[index]:
                self._tell(index, remarks.first_time(batch))
            errors = lines["error_frames"]
            received = count.received + frames - errors
            self._counts[index] = replace(count, received=received, errors=count.errors + errors, dropped=dropped)
            self._waiting.append((index, batch))
            self._rows += lines["lines"]
            if self._rows >= self._most // 2:
                self._changed.notify_all()

    def _tell(self, index: int, t: int | None) -> None:
        """Add a row for the losses that have none yet."""
        if lost := self._untold[index]:
            self._untold[index] = 0
            row = remarks.make_drop(self._clock() if t is None else t, lost, self._receivers[index].name)
            self._waiting.append((index, row))
