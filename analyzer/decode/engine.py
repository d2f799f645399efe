"""The pipeline: candump text or rows of frames in, one batch of every table out. Files and live buses both run this."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import dissectors
from analyzer import _native
from analyzer.decode.messages import Messages
from analyzer.tables import EVENT_ROWS, FRAMES, SETTLED, TRANSFERS, VERDICTS, wrap

if TYPE_CHECKING:
    from collections.abc import Collection, Generator, Iterable, Iterator, Mapping

    import pyarrow as pa

    from analyzer._native import FrameBatch
    from analyzer.decode.messages import ReadMessages
    from analyzer.decode.readings import Statement
    from dissectors.registry import Registry

BATCH_ROWS = 1 << 17
HELD_ROWS = 1 << 17  # frames that wait at most for what decides how they are read
# The lines of a capture and the terms of their sum.
LINES = (
    "lines", "frames", "error_frames", "drops", "comments", "blank", "unreadable", "other", "repeated"
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Batch:
    """A slice of every table, as one step of the pipeline gives it. Row numbers run through the whole capture.

    `messages` holds a table for each message type and packet that occurred, by name; it is made when it is asked for.
    `settled` lists verdicts of
    frames of earlier batches that were found out only now, `readings` how doubtful fields of nodes are read so far.
    """

    frames: pa.RecordBatch
    transfers: pa.RecordBatch
    events: pa.RecordBatch
    messages: Mapping[str, pa.RecordBatch]
    settled: pa.RecordBatch
    first_frame: int
    first_transfer: int
    buses: tuple[str, ...]
    readings: tuple[Statement, ...] = ()

    def make_tables(self) -> Batch:
        """Return it with all message tables made: in a thread that works ahead of who looks at them."""
        for _ in self.messages.values():
            pass
        return self


@dataclass(slots=True)
class Totals:
    """The law of conservation in numbers, capture-wide.

    `lines` = the sum of the other terms of `LINES`; `verdicts` sum up to the frames, if these were decoded.
    """

    lines: dict[str, int] = field(default_factory=dict)
    verdicts: dict[str, int] = field(default_factory=dict)

    @property
    def balanced(self) -> bool:
        """True when every line and every frame is accounted for."""
        sums = sum(self.lines[part] for part in LINES[1:]) == self.lines["lines"]
        return sums and (not self.verdicts or sum(self.verdicts.values()) == self.lines["frames"])


class Engine:
    """The pipeline with its state: open transfers, and how many rows have gone by.

    Args:
        registry: the types to decode; the built-in ones if not given.
        forced: readings of doubtful fields by node ID, against the node's own data.
        ahead: batches wait until it is decided how their nodes are read, `HELD_ROWS` frames at most; without it rows
            before that follow their own values, and say so.
    """

    def __init__(
        self, registry: Registry | None = None, forced: Mapping[int, Collection[str]] | None = None, *,
        ahead: bool = False,
    ) -> None:  # fmt: skip
        self.registry = registry if registry is not None else dissectors.load()
        self._messages = Messages(self.registry, forced, ahead=ahead)
        self._native = _native.Pipeline(self.registry.signatures)
        self._frames = self._transfers = 0
        self._ahead = ahead
        self._held: list[tuple[Batch, ReadMessages]] = []

    def feed(self, chunk: bytes | FrameBatch) -> Iterator[Batch]:
        """Take candump text, cut anywhere, or the rows of a reader; yield a batch for about every 131,072 rows.

        A capture is either text or rows.
        """
        at: int | None = 0
        while at is not None:
            at = self._native.feed(chunk, at)
            if self._native.waiting >= BATCH_ROWS:
                yield from self._step(waits=self._ahead)

    def flush(self) -> Batch:
        """Return everything that is known now; open transfers stay open. Not for batches that wait."""
        (batch,) = self.flushed()
        return batch

    def flushed(self) -> Iterator[Batch]:
        """Yield what waits, and everything that is known now; open transfers stay open."""
        yield from self._step(waits=False)

    def finish(self) -> Batch:
        """End the capture: close what is still open. Not for batches that wait."""
        (batch,) = self.end()
        return batch

    def end(self) -> Iterator[Batch]:
        """End the capture: yield what waits, and what is still open."""
        self._native.finish()
        yield from self._step(waits=False, last=True)

    def _step(self, *, waits: bool, last: bool = False) -> Iterator[Batch]:
        """Take what the core has; yield what does not have to wait, all of it unless `waits`."""
        (frames, transfers, events, settled), groups = self._native.take()
        read = self._messages.read(groups, self._transfers, last=last)
        batch = Batch(
            frames=wrap(FRAMES, frames),
            transfers=wrap(TRANSFERS, transfers),
            events=wrap(EVENT_ROWS, events),
            messages={},
            settled=wrap(SETTLED, settled),
            first_frame=self._frames,
            first_transfer=self._transfers,
            buses=tuple(self._native.buses),
        )
        self._frames += len(batch.frames)
        self._transfers += len(batch.transfers)
        self._held.append((batch, read))
        full = sum(len(one.frames) for one, _ in self._held) >= HELD_ROWS
        if full or not (waits and self._messages.waiting):
            held, self._held = self._held, []
            for one, its in held:
                yield replace(one, messages=self._messages.told(its), readings=self._messages.statements())

    def know(self, other: Engine) -> None:
        """Read nodes from the start as another engine, which has seen them before, has decided."""
        self._messages.know(other._messages)

    def run(self, chunks: Iterable[bytes | FrameBatch]) -> Generator[Batch]:
        """Yield the batches of every chunk, then that of the end."""
        for chunk in chunks:
            yield from self.feed(chunk)
        yield from self.end()

    @property
    def totals(self) -> Totals:
        """Counts of what became of every line and frame so far."""
        lines: dict[str, Any] = dict(self._native.lines)
        return Totals(lines, dict(zip(VERDICTS, self._native.verdicts, strict=True)))

    @property
    def stamps(self) -> int:
        """Kinds of time stamps seen, as bits of `tables.STAMPS`."""
        return self._native.stamps

    @property
    def buses(self) -> tuple[str, ...]:
        """Interface names by index."""
        return tuple(self._native.buses)
