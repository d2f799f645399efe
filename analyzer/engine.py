"""The pipeline: candump text or rows of frames in, one batch of every table out. Files and live buses both run this."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import dissectors
from analyzer import _native
from analyzer.messages import Messages
from analyzer.tables import EVENT_ROWS, FRAMES, SETTLED, TRANSFERS, VERDICTS, wrap

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pyarrow as pa

    from analyzer._native import Piece
    from dissectors.registry import Registry

BATCH_ROWS = 1 << 17
_PIECE = 1 << 22
# The lines of a capture and the terms of their sum.
LINES = (
    "lines", "frames", "error_frames", "drops", "comments", "blank", "unreadable", "other", "repeated"
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Batch:
    """What one step of the pipeline produced: a slice of every table. Row numbers run through the whole capture.

    `messages` holds a table for each message type and packet that occurred, by name. `settled` lists verdicts of
    frames of earlier batches that were found out only now.
    """

    frames: pa.RecordBatch
    transfers: pa.RecordBatch
    events: pa.RecordBatch
    messages: dict[str, pa.RecordBatch]
    settled: pa.RecordBatch
    first_frame: int
    first_transfer: int
    buses: tuple[str, ...]


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
    """Holds the only state there is: open transfers, and how many rows have gone by.

    Args:
        registry: the types to decode; the built-in ones if not given.
    """

    def __init__(self, registry: Registry | None = None) -> None:
        self.registry = registry if registry is not None else dissectors.load()
        self._messages = Messages(self.registry)
        self._native = _native.Engine(self.registry.signatures)
        self._frames = self._transfers = 0

    def feed(self, chunk: bytes | Piece) -> Iterator[Batch]:
        """Takes candump text, cut anywhere, or the rows of a reader; gives a batch for about every 131,072 rows.

        A capture is either text or rows.
        """
        if not isinstance(chunk, bytes):
            self._native.feed_rows(chunk)
            if self._native.waiting >= BATCH_ROWS:
                yield self.flush()
            return
        view = memoryview(chunk)
        for start in range(0, len(view), _PIECE):
            self._native.feed_candump(bytes(view[start : start + _PIECE]) if len(view) > _PIECE else chunk)
            if self._native.waiting >= BATCH_ROWS:
                yield self.flush()

    def flush(self) -> Batch:
        """Everything that is known now; open transfers stay open."""
        frames, transfers, events, settled, groups = self._native.take()
        t = wrap(TRANSFERS, transfers)
        payload = (transfers["payload_offset"], transfers["payload"])
        messages = self._messages.decode(t, payload, groups, self._transfers)
        batch = Batch(
            frames=wrap(FRAMES, frames),
            transfers=t,
            events=wrap(EVENT_ROWS, events),
            messages=messages,
            settled=wrap(SETTLED, settled),
            first_frame=self._frames,
            first_transfer=self._transfers,
            buses=tuple(self._native.buses),
        )
        self._frames += len(batch.frames)
        self._transfers += len(t)
        return batch

    def finish(self) -> Batch:
        """End of capture: what is still open is closed."""
        self._native.finish()
        return self.flush()

    def run(self, chunks: Iterable[bytes | Piece]) -> Iterator[Batch]:
        """Every chunk, then the end."""
        for chunk in chunks:
            yield from self.feed(chunk)
        yield self.finish()

    @property
    def totals(self) -> Totals:
        """What became of every line and frame so far."""
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
