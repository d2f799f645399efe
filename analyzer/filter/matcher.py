"""A filter at work: batch by batch, which rows it selects."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.engine import SelectedRows
from analyzer.devices.as_of import AsOf, ToldValues
from analyzer.filter.context import BatchContext
from analyzer.filter.rowsets import ErrorSet, FrameSet, MemberSet, RowSet, TransferSet
from analyzer.tables import VERDICTS
from dissectors.kit.cells import floats, numbers
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.filter.memory import FilterMemory
    from analyzer.filter.nodes import Condition, LagNode, ValueNode
    from analyzer.filter.values import Values
    from analyzer.window.numbering import Numbering
    from dissectors.kit import Array


_LATE = 2 * SECOND  # from the start of a transfer to its end, and so to its row
_USED = VERDICTS.index("used")


class Matches:
    """The rows of a batch that a filter selects: masks, made when they are asked for.

    Ask before the next batch is fed.
    """

    def __init__(self, context: BatchContext, test: Callable[[RowSet], Array]) -> None:
        self._context, self._test = context, test

    @property
    def numbering(self) -> Numbering:
        """The numbers of frames."""
        return self._context.memory.numbering

    @property
    def buses(self) -> Sequence[str]:
        """The interfaces that the capture has had until now."""
        return self._context.batch.buses

    @property
    def error_rows(self) -> Array:
        """The events that are error frames, by row."""
        return self._context.error_rows

    @cached_property
    def _transfers(self) -> TransferSet:
        return TransferSet(self._context)

    @cached_property
    def transfers(self) -> Array:
        """The transfers, a flag for each."""
        return self._test(self._transfers)

    @cached_property
    def frames(self) -> Array:
        """The frames, each as one that has no transfer."""
        batch = self._context.batch
        places = np.arange(batch.first_frame, batch.first_frame + len(batch.frames))
        verdicts = numbers(batch.frames.column("verdict")) if len(places) else places
        return self._test(FrameSet(self._context, places, verdicts))

    def loose(self, rows: Array) -> Array:
        """Return a flag for each of some frames of the batch that have no transfer, by row."""
        places = np.asarray(rows, np.int64) + self._context.batch.first_frame
        verdicts = numbers(self._context.batch.frames.column("verdict"))[rows] if len(places) else places
        return self._test(FrameSet(self._context, places, verdicts))

    def seen(self, tables: Sequence[str]) -> bool:
        """Return whether the batch has a transfer of one of these types, or one of these packets."""
        context = self._context
        return any(table in context.batch.messages or context.of_type(table).any() for table in tables)

    @cached_property
    def settled(self) -> Array:
        """The frames of earlier batches that turned out to have no transfer, a flag a row of `Batch.settled`.

        Never one that turned out to have one: that is selected with it.
        """
        settled = self._context.batch.settled
        places, verdicts = (
            numbers(settled.column(name)).astype(np.int64) if len(settled) else np.zeros(0, np.int64)
            for name in ("frame", "verdict")
        )
        loose: Array = verdicts != _USED
        return self._test(FrameSet(self._context, places, verdicts)) & loose

    @cached_property
    def events(self) -> Array:
        """The error frames, a flag a row of `Batch.events`; nothing else in there is ever selected."""
        rows = self._context.error_rows
        found = np.zeros(len(self._context.batch.events), bool)
        if len(rows):
            found[rows] = self._test(ErrorSet(self._context, rows))
        return found

    def selected(self) -> SelectedRows:
        """Return the masks of all that a list shows."""
        batch = self._context.batch
        frames = np.zeros(len(batch.frames), bool)
        if len(frames):
            rows = np.flatnonzero(numbers(batch.frames.column("verdict")) != _USED)
            frames[rows] = self.loose(rows)
        return SelectedRows(self.transfers, frames, self.settled, self.events)

    @cached_property
    def members(self) -> tuple[Array, Array]:
        """The frames of transfers, by number from 0, each with what its transfer has, and a flag for each."""
        _, places = self._context.places
        return places, self._test(MemberSet(self._context, self._transfers))


class Matcher:
    """Evaluates a filter over the batches of one capture, in their order."""

    def __init__(self, condition: Condition, lags: Sequence[LagNode], memory: FilterMemory) -> None:
        self._condition, self._memory = condition, memory
        self._work = _Work(lags, memory, list(condition.fields()))

    def feed(self, batch: Batch) -> Matches:
        """Take the next batch and return what the filter selects in it."""
        return Matches(self._work.feed(batch), self._condition.test)


class ReadValues(NamedTuple):
    """Values of an expression in a batch.

    Attributes:
        values, valid: one a transfer row, of several values the first; and whether there is one.
        rows, every: all values, and the row of each, which has as many as it has elements or packets.
    """

    values: Array
    valid: Array
    rows: Array
    every: Array


class ExpressionMeter:
    """Evaluates an expression over the batches of one capture, in their order."""

    def __init__(self, value: ValueNode, lags: Sequence[LagNode], memory: FilterMemory) -> None:
        self._value = value
        self._work = _Work(lags, memory, list(value.fields()))

    def feed(self, batch: Batch) -> ReadValues:
        """Take the next batch and return the values."""
        rows = TransferSet(self._work.feed(batch))
        found = self._value.values(rows)
        there = found.there()
        at, every = found.rows()[there], found.plain[there]
        values, valid = np.zeros(rows.size, every.dtype), np.zeros(rows.size, bool)
        values[at[::-1]] = every[::-1]
        valid[at] = True
        return ReadValues(values, valid, at, every)


class _Work:
    """The work that every batch needs, whoever asks for what."""

    def __init__(self, lags: Sequence[LagNode], memory: FilterMemory, fields: Sequence[object]) -> None:
        self._lags = [LaggedField(node) for node in lags]
        self._memory = memory
        origins = {(ref.origin, ref.column) for ref in fields}  # type: ignore[attr-defined]
        self._channels = any(origin == "channel" for origin, _ in origins)
        self._deltas = ("frame", "delta") in origins

    def feed(self, batch: Batch) -> BatchContext:
        memory = self._memory
        memory.feed(batch)
        context = BatchContext(batch, memory)
        context.lagged = [lag.feed(context) for lag in self._lags]
        if self._channels:
            memory.channels.feed(context)
        if self._deltas:
            memory.deltas.feed(context)
        return context


class LaggedField:
    """Keeps what senders said for as long as somebody looks back at it, and the last of before."""

    def __init__(self, node: LagNode) -> None:
        self._node = node
        self._said = AsOf(node.ago + _LATE)

    def feed(self, context: BatchContext) -> Values:
        """Return what the field was; `node.ago` before each value of the next batch."""
        ref = self._node.of.ref
        values = context.table(ref, None)
        key, t = context.senders(ref)
        if not len(key):
            return values
        there = values.there() & (t != NO_TIME)
        if ref.kind.special:
            there &= ~np.isin(values.plain, ref.kind.special)
        told = floats(values.plain)
        self._said.feed(ToldValues(key[there], t[there], told[there], t[there]))
        known, value, _ = self._said.ask(key, np.where(t == NO_TIME, 0, t - self._node.ago))
        self._said.forget()
        return values.with_data(value, known & (t != NO_TIME))
