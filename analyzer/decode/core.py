"""The native half of the pipeline: it needs the interpreter twice a batch, so that a thread may run it ahead."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from analyzer import _native
from analyzer.tables import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analyzer._native import FrameBatch, Group
    from dissectors.registry import Registry

    # Returns whether anybody asks for the transfers of a kind, data type ID, source and destination.
    AskedSessions = Callable[[int, int, int, int], bool]

BATCH_ROWS = 1 << 17
# A batch is half as long where more than one of so many frames has another verdict: such rows take more room.
_MOST_LOOSE = 32
_AT_HOME = [VERDICTS.index("used"), VERDICTS.index("foreign")]
# The lines of a capture and the terms of their sum.
LINES = (
    "lines", "frames", "error_frames", "drops", "comments", "blank", "unreadable", "other", "repeated"
)  # fmt: skip


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


@dataclass(frozen=True, slots=True)
class Account:
    """The fate of every line and frame, bits of `tables.STAMPS`, interfaces by index, transfers that make no row."""

    totals: Totals
    stamps: int
    buses: tuple[str, ...]
    unasked: int


@dataclass(frozen=True, slots=True)
class Piece:
    """A slice of the capture as the core hands it over: nobody else has it, whatever the core does meanwhile.

    `tables` are the columns of frames, transfers, events and settled verdicts, `groups` the transfers of each type.
    What is not decided yet about its messages may wait for the next piece if it `waits`, as none does once it is known
    how they go on, and at the `last` one. Frames before `settled_before` have their last verdicts.
    """

    tables: tuple[dict[str, Any], ...]
    groups: list[Group]
    account: Account
    waits: bool = True
    last: bool = False
    settled_before: int = 0


class Core:
    """Candump text or rows of frames in, pieces out; to be used by one thread at a time.

    Of sessions that nobody asks for transfers are counted, and make no rows but the first ones, so that every type that
    occurs is seen. With `measured` it also says how many bits each frame occupies the bus.
    """

    def __init__(self, registry: Registry, sessions: AskedSessions | None = None) -> None:
        self.measured = False
        self._native = _native.Pipeline(registry.signatures, sessions)
        self._loose = 0  # frames before this piece that have another verdict

    def feed(self, chunk: bytes | FrameBatch) -> Iterator[Piece]:
        """Take text, cut anywhere, or the rows of a reader; yield a piece for about every `BATCH_ROWS` rows.

        It is half as many where many frames are neither used nor foreign.
        """
        at: int | None = 0
        while at is not None:
            at = self._native.feed(chunk, at)
            if self._is_full():
                yield self._piece()

    def flush(self) -> Piece:
        """Return everything that is known now; open transfers stay open."""
        return self._piece(waits=False)

    def end(self) -> Piece:
        """End the capture: return the rest, with what was still open."""
        self._native.finish()
        return self._piece(waits=False, last=True)

    def run(self, chunks: Iterable[bytes | FrameBatch]) -> Iterator[Piece]:
        """Yield the pieces of a whole capture; an empty text says that nothing new has come, and nothing waits then."""
        for chunk in chunks:
            if chunk == b"":
                yield self.flush()
            else:
                yield from self.feed(chunk)
            del chunk  # else it would be there while the next one is read
        yield self.end()

    @property
    def account(self) -> Account:
        """The account so far."""
        core = self._native
        totals = Totals(dict(core.lines), dict(zip(VERDICTS, core.verdicts, strict=True)))
        return Account(totals, core.stamps, tuple(core.buses), core.unasked)

    def _is_full(self) -> bool:
        waiting = self._native.waiting
        if waiting < BATCH_ROWS // 2:
            return False
        return waiting >= BATCH_ROWS or (self._loose_so_far() - self._loose) * _MOST_LOOSE > waiting

    def _loose_so_far(self) -> int:
        verdicts = self._native.verdicts
        return sum(verdicts) - sum(verdicts[verdict] for verdict in _AT_HOME)

    def _piece(self, *, waits: bool = True, last: bool = False) -> Piece:
        self._loose = self._loose_so_far()
        tables, groups = self._native.take(measured=self.measured)
        return Piece(tables, groups, self.account, waits, last, self._native.settled_before)
