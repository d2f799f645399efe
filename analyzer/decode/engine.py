"""The pipeline: candump text or rows of frames in, one batch of every table out. Files and live buses both run this."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import dissectors
from analyzer.decode.core import Core
from analyzer.decode.messages import Messages
from analyzer.decode.sent import cells
from analyzer.tables import EVENT_ROWS, FRAMES, SETTLED, TRANSFERS, wrap

if TYPE_CHECKING:
    from collections.abc import Collection, Generator, Iterable, Iterator, Mapping

    import pyarrow as pa

    from analyzer._native import FrameBatch
    from analyzer.decode.core import AskedSessions, Piece, Totals
    from analyzer.decode.messages import ReadMessages
    from analyzer.decode.places import Places
    from analyzer.decode.readings import Statement
    from dissectors.kit import Array
    from dissectors.registry import Registry

HELD_ROWS = 1 << 17  # frames that wait at most for what decides how they are read


class SelectedRows(NamedTuple):
    """Masks of the rows of a batch that somebody wants to see; of frames those without a transfer, of events errors."""

    transfers: Array
    frames: Array
    settled: Array
    events: Array


@dataclass(frozen=True, slots=True)
class Batch:
    """A slice of every table, as one step of the pipeline gives it. Row numbers run through the whole capture.

    `messages` holds a table for each message type and packet that occurred, by name; it is made when it is asked for.
    `settled` lists verdicts of frames of earlier batches that were found out only now; those of frames before the
    number `settled_before` are the last ones. `readings` says how doubtful fields of nodes are read so far,
    `bit_times` how many bits each frame occupies the bus, u16, if its core has `measured` that; `selected` the rows
    that a filter has chosen, None without one. Where only frames that were picked are numbered, `places` says where in
    the capture these are; `zero` is the time of its first frame, in ns, where this batch is a part of it.
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
    bit_times: Array | None = field(default=None, compare=False)
    selected: SelectedRows | None = field(default=None, compare=False)
    places: Places | None = field(default=None, compare=False)
    zero: int | None = field(default=None, compare=False)
    settled_before: int = field(default=0, compare=False)

    def make_tables(self) -> Batch:
        """Return it with all message tables made: in a thread that works ahead of who looks at them."""
        for _ in self.messages.values():
            pass
        return self


class Engine:
    """The pipeline with its state: open transfers, and how many rows have gone by.

    Args:
        registry: the types to decode; the built-in ones if not given.
        forced: readings of doubtful fields by node ID, against the node's own data.
        ahead: batches wait until it is decided how their nodes are read, `HELD_ROWS` frames at most; without it rows
            before that follow their own values, and say so.
        only: the tables of messages and packets that somebody will ask for, all if not given. Of others batches may
            have none, and no `readings`.
        sessions: those of which somebody wants to see the transfers, all if not given. Of others batches have the first
            ones only; rows are numbered without them.
    """

    def __init__(
        self, registry: Registry | None = None, forced: Mapping[int, Collection[str]] | None = None, *,
        ahead: bool = False, only: Collection[str] | None = None, sessions: AskedSessions | None = None,
    ) -> None:  # fmt: skip
        self.registry = registry if registry is not None else dissectors.load()
        self._messages = Messages(self.registry, forced, ahead=ahead, only=only)
        self._unread = only is not None and not only
        self.core = Core(self.registry, sessions)
        self._account = self.core.account
        self._frames = self._transfers = 0
        self._ahead = ahead
        self._held: list[tuple[Batch, ReadMessages]] = []

    def feed(self, chunk: bytes | FrameBatch) -> Iterator[Batch]:
        """Take candump text, cut anywhere, or the rows of a reader; yield a batch for about every 131,072 rows.

        A capture is either text or rows.
        """
        for piece in self.core.feed(chunk):
            yield from self.decoded(piece)
        self._account = self.core.account

    def flush(self) -> Batch:
        """Return everything that is known now; open transfers stay open. Not for batches that wait."""
        (batch,) = self.flushed()
        return batch

    def flushed(self) -> Iterator[Batch]:
        """Yield what waits, and everything that is known now; open transfers stay open."""
        yield from self.decoded(self.core.flush())

    def finish(self) -> Batch:
        """End the capture: close what is still open. Not for batches that wait."""
        (batch,) = self.end()
        return batch

    def end(self) -> Iterator[Batch]:
        """End the capture: yield what waits, and what is still open."""
        yield from self.decoded(self.core.end())

    def decoded(self, piece: Piece) -> Iterator[Batch]:
        """Take the next piece of `core`, which another thread may run; yield what does not have to wait any longer."""
        if self._unread:
            yield self.bare(piece)
            return
        read = self._messages.read(piece.groups, self._transfers, last=piece.last)
        self._held.append((self.bare(piece), read))
        full = sum(len(one.frames) for one, _ in self._held) >= HELD_ROWS
        if full or not (piece.waits and self._ahead and self._messages.waiting):
            held, self._held = self._held, []
            for one, its in held:
                yield replace(one, messages=self._messages.told(its), readings=self._messages.statements())

    def bare(self, piece: Piece) -> Batch:
        """Return the next piece of `core` without its messages, where nobody asks for any of the capture."""
        frames, transfers, events, settled = piece.tables
        bits = frames.get("bit_times")
        batch = Batch(
            frames=wrap(FRAMES, frames),
            transfers=wrap(TRANSFERS, transfers),
            events=wrap(EVENT_ROWS, events),
            messages={},
            settled=wrap(SETTLED, settled),
            first_frame=self._frames,
            first_transfer=self._transfers,
            buses=piece.account.buses,
            bit_times=None if bits is None else cells(bits, np.uint16),
            settled_before=piece.settled_before,
        )
        self._account = piece.account
        self._frames += len(batch.frames)
        self._transfers += len(batch.transfers)
        return batch

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
        return self._account.totals

    @property
    def transfers(self) -> int:
        """How many transfers there were so far, those of sessions that nobody asks for too."""
        return self._transfers + self._account.unasked

    @property
    def stamps(self) -> int:
        """Kinds of time stamps seen, as bits of `tables.STAMPS`."""
        return self._account.stamps

    @property
    def buses(self) -> tuple[str, ...]:
        """Interface names by index."""
        return self._account.buses
