"""The rules' view of a capture: one batch, and what is known of the capture so far."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from analyzer.facts.dialects import Dialects
from analyzer.facts.identifiers import NOBODY, who
from analyzer.facts.names import type_name
from analyzer.rules.capture_gaps import GAP, CaptureGaps
from analyzer.rules.joint.losses import JointLossSearch
from analyzer.rules.load import bit_times, split
from analyzer.rules.paces import Paces
from analyzer.rules.recent import Recent
from analyzer.tables import EVENT_ROWS, FRAMES, KINDS, SETTLED, TRANSFERS, empty
from dissectors.kit import (
    NO_TIME,
    SECOND,
    DecodedTable,
    EventTable,
    FrameTable,
    Occurrences,
    TransferTable,
    Types,
    doubtful,
    times_by_bus,
)
from dissectors.kit.cells import numbers
from dissectors.kit.decoded import contexts_of
from dissectors.kit.view import Settled

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from analyzer._native import FrameIndex
    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array, JointLosses, Kept, Seconds, Values
    from dissectors.kit.decoded import Context
    from dissectors.schema import Message

MESSAGE = KINDS.index("message")


class Past:
    """State that lasts from batch to batch.

    Args:
        registry: the types that the capture was decoded with.
        numbers: settings by rule and name.
        bit_rate: bits per second, if known.
    """

    def __init__(
        self, registry: Registry, numbers: Mapping[str, Mapping[str, float]], bit_rate: int | None = None
    ) -> None:
        self.registry, self.numbers, self.bit_rate, self.cut_in = registry, numbers, bit_rate, False
        self.dialects = Dialects()
        self.recent = Recent()
        self.types = Types(registry)
        self.buses: Sequence[str] = ()
        self.start = self.end = self.last = self.origin = NO_TIME
        self.starts: dict[int, int] = {}
        self.gaps = CaptureGaps()
        self.resolution = SECOND  # how coarse times are
        self._joint = JointLossSearch()
        self._names: dict[int, str] = {}

    def feed(self, batch: Batch, bits: Array | None = None) -> BatchView:
        """Add the next batch.

        Return it as rules see it; `bits` are the `bit_times` of its frames, if they are known.
        """
        view = BatchView(self, batch, bits)
        self.buses = batch.buses
        self.recent.feed(view.frames)
        self._note_times(view.frames)
        self.dialects.feed(batch)
        view.joint_losses = self._joint.feed(view, view.bit_times)
        return view

    def finish(self) -> BatchView:
        """Return a view without rows, for what only the end shows."""
        view = BatchView(self, None)
        view.joint_losses = self._joint.finish(view)
        return view

    def name(self, code: int) -> str:
        """Return the table of a type by its code."""
        if code not in self._names:
            if len(self._names) > 1 << 16:
                self._names.clear()
            message = self.type_of(code)
            self._names[code] = type_name(None, code >> 16 & 0xFF, code & 0xFFFF) if message is None else message.table
        return self._names[code]

    def type_of(self, code: int) -> Message | None:
        """Return a type by its code, None if it has no definition."""
        return None if code < 0 else self.registry.message(code >> 16 & 0xFF, code & 0xFFFF, code >> 24 & 0xFF)

    def definition(self, table: str) -> Message | None:
        """Return the type of a message table, None for other tables."""
        return self.registry.message_of(table)

    def choice(self, message: str, reading: str, bus: int, node: int) -> str:
        """Return what a node's doubtful field has shown so far."""
        return self.dialects.choice(message, reading, bus, node)

    def _note_times(self, frames: FrameTable) -> None:
        times = times_by_bus(frames)
        if not times:
            return
        one = times[0]
        t = one.t if len(times) == 1 else frames.t[frames.t != NO_TIME]
        since = t - self.gaps.feed(t, calm=len(times) == 1 and max(one.longest, one.back) <= GAP)
        while self.resolution > 1 and (since // self.resolution * self.resolution != since).any():
            self.resolution //= 10
        self.origin = int(t[0]) if self.origin == NO_TIME else self.origin
        self.last = int(t[-1])
        self.start = int(t.min()) if self.start == NO_TIME else min(self.start, int(t.min()))
        self.end = max(self.end, int(t.max()))
        for one in times:
            self.starts.setdefault(one.bus, int(one.t[0]))


class BatchView:
    """One batch for the rules; `None` for a batch makes a view without rows."""

    def __init__(self, past: Past, batch: Batch | None, bits: Array | None = None) -> None:
        self._past = past
        self._bits = bits
        self.batch = batch
        self._messages = {} if batch is None else batch.messages
        first_transfer = 0 if batch is None else batch.first_transfer
        self.frames = FrameTable(empty(FRAMES), 0) if batch is None else FrameTable(batch.frames, batch.first_frame)
        self.transfers = TransferTable(empty(TRANSFERS) if batch is None else batch.transfers, first_transfer)
        self.events = EventTable(empty(EVENT_ROWS) if batch is None else batch.events)
        self._settled = None if batch is None else batch.settled
        self._tables: dict[str, DecodedTable | None] = {}
        self.before = past.last
        self.cut_in = past.cut_in
        self.joint_losses: JointLosses | None = None  # what is known now of frames that several senders lack at once

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: rules that are copied have seen this batch."""
        return self

    @cached_property
    def bit_times(self) -> Array:
        """How many bits each frame occupies the bus."""
        return bit_times(self.frames) if self._bits is None else self._bits

    @cached_property
    def seconds(self) -> Seconds:
        """Frames and bits by interface and second, counted from the first frame of the capture."""
        return split(self.frames, self.bit_times, self._past.origin)

    @cached_property
    def settled(self) -> Settled:
        """Frames of earlier batches whose verdict is final now."""
        rows = empty(SETTLED) if self._settled is None else self._settled
        number, *more = (numbers(rows.column(name)).astype(np.int64) for name in ("frame", "verdict", "anomaly"))
        return Settled(number, *more, *self._past.recent.columns(number))

    @property
    def buses(self) -> Sequence[str]:
        """Interface names by index."""
        return self._past.buses

    @property
    def start(self) -> int:
        """The first time of any frame so far."""
        return self._past.start

    @property
    def end(self) -> int:
        """The last time of any frame so far."""
        return self._past.end

    @property
    def starts(self) -> Mapping[int, int]:
        """The first time by bus."""
        return self._past.starts

    def resumed(self, t: int) -> int:
        """Return the time since when frames have come without a gap."""
        return self._past.gaps.resumed(t, self._past.start)

    @property
    def gap_ends(self) -> Array:
        """When each gap ended."""
        return self._past.gaps.ends

    def paused(self, since: int, until: int) -> bool:
        """Return whether there is a gap somewhere between two times that hides something."""
        return self._past.gaps.paused(since, until)

    @property
    def resolution(self) -> int:
        """Return how coarse times are."""
        return self._past.resolution

    @property
    def bit_rate(self) -> int | None:
        """Bits per second, if known."""
        return self._past.bit_rate

    def table(self, name: str) -> DecodedTable | None:
        """Return the rows of a message or packet in this batch."""
        if name not in self._tables:
            rows = self._messages.get(name)
            known = rows is not None and rows.num_rows
            self._tables[name] = DecodedTable(name, rows, self.transfers.first) if known else None
        return self._tables[name]

    def tables(self) -> Sequence[str]:
        """Return names of the tables that this batch has."""
        return self._every[0]

    @property
    def contexts(self) -> Sequence[Context]:
        """The message tables of this batch, small ones joined."""
        return self._every[1]

    @cached_property
    def _every(self) -> tuple[Sequence[str], Sequence[Context]]:
        """Names of all tables, and what message tables are joined to before anybody goes over all of them."""
        names = [name for name, rows in self._messages.items() if rows.num_rows]
        known = (self.table(name) for name in names if self.definition(name) is not None)
        return names, contexts_of(table for table in known if table is not None)

    def definition(self, name: str) -> Message | None:
        """Return the type of a message table, None for other tables."""
        return self._past.definition(name)

    def number(self, rule: str, name: str) -> float:
        """Return a setting of a rule."""
        return self._past.numbers[rule][name]

    def type_name(self, code: int) -> str:
        """Return the name of a table by the code of a transfer's type."""
        return "" if code < 0 else self._past.name(code)

    def type_of(self, code: int) -> Message | None:
        """Return what is known of a transfer's type by its code."""
        return self._past.type_of(code)

    @property
    def types(self) -> Types:
        """Return what the definitions say of types."""
        return self._past.types

    def frame(self, number: int) -> Kept | None:
        """Return a frame of the recent past."""
        return self._past.recent.frame(number)

    def indexes(self, low: int, high: int) -> Sequence[FrameIndex]:
        """Return batches of the recent past with frames from `low` to before `high`, by session, for the core."""
        return self._past.recent.indexes(low, high)

    def paced_reports(self, least: int, periods: float, fewest: int, span: int = 0) -> Paces:
        """Return what looks for breaks in reports at a steady pace, of which there are none yet."""
        return Paces(least, periods, fewest, span)

    def lines(self, frames: Iterable[int]) -> tuple[str, ...]:
        """Return frames of the recent past as candump writes them."""
        return self._past.recent.lines(frames, self.buses)

    def each_line(self, frames: Array) -> Array:
        """Return many frames of the recent past as candump writes them, one text each: an empty one if it is gone."""
        return self._past.recent.each_line(frames, self.buses)

    def choice(self, message: str, reading: str, bus: int, node: int) -> str:
        """Return what a node's doubtful field has shown up to this batch."""
        return self._past.choice(message, reading, bus, node)

    def among_transfers(self, rule: str, rows: Array, values: Callable[[int], Values], **about: Any) -> Occurrences:
        """Return `Occurrences` for transfers of this batch."""
        rows = np.asarray(rows, np.int64)
        return self._of_transfers(rule, rows, lambda k: values(rows.item(k)), about)

    def among_frames(self, rule: str, rows: Array, values: Callable[[int], Values], **about: Any) -> Occurrences:
        """Return `Occurrences` for frames of this batch."""
        rows = np.asarray(rows, np.int64)
        f = self.frames
        node, code = who(f.id[rows], f.flags[rows], f.verdict[rows])
        numbers = rows + f.first
        about.setdefault("frames", lambda k: (int(numbers[k]),))
        return Occurrences(
            rule=rule, t=f.t[rows], bus=f.bus[rows], node=node, type=code, frame=numbers,
            values=lambda k: values(int(rows[k])), **about,
        )  # fmt: skip

    def among_rows(
        self, rule: str, table: DecodedTable, rows: Array, values: Callable[[int], Values], **about: Any
    ) -> Occurrences:
        """Return `Occurrences` for rows of a message or packet table."""
        rows = np.asarray(rows, np.int64)
        about["doubtful"] = doubtful(table, rows)
        return self._of_transfers(rule, table.row[rows], lambda k: values(rows.item(k)), about)

    def _of_transfers(
        self, rule: str, rows: Array, values: Callable[[int], Values], about: dict[str, Any]
    ) -> Occurrences:
        t = self.transfers
        node = t.src[rows].astype(np.int64)
        if not node.all():
            node[(node == 0) & (t.kind[rows] != MESSAGE)] = NOBODY
        about.setdefault("frame", t.lead[rows])
        about.setdefault("frames", lambda k: t.frames(rows.item(k)))
        return Occurrences(
            rule=rule, t=t.t[rows], bus=t.bus[rows], node=node, type=t.code[rows], values=values, **about
        )


def node_of(src: int, code: int) -> int | None:
    """Return the node that sent a transfer: with source 0 only that of a message that is not anonymous."""
    return src if src or code >> 16 == MESSAGE else None
