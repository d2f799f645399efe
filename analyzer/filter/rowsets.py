"""The rows that a filter chooses among, and the values that they have: transfers, frames, error frames of a batch."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.values import NO_NUMBERS, Values, spread

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.filter.context import BatchContext
    from analyzer.filter.fields import FieldRef
    from dissectors.kit import Array


class RowSet(ABC):
    """Rows of a batch, and what is asked of them.

    `wanted` are the rows that are still in question: of others nothing has to be right.
    """

    def __init__(self, context: BatchContext, size: int) -> None:
        self.context, self.size = context, size
        self.wanted: Array | None = None
        self._known: dict[object, Values] = {}

    def values(self, ref: FieldRef) -> Values:
        """Return the values of a field."""
        found = self._known.get(ref.key)
        if found is None:
            found = self._find(ref)
            if self.wanted is None or ref.origin not in ("table", "unit", "type"):
                self._known[ref.key] = found
        return found

    def lagged(self, _: int) -> Values:
        """Return what a field was some time ago; its place tells which."""
        return NO_NUMBERS

    @abstractmethod
    def _find(self, ref: FieldRef) -> Values:
        """Return values that are not known yet."""


class TransferSet(RowSet):
    """The transfers of a batch."""

    def __init__(self, context: BatchContext) -> None:
        super().__init__(context, len(context.batch.transfers))

    def lagged(self, place: int) -> Values:
        """Return what a field was some time ago."""
        return self.context.lagged[place]

    def _find(self, ref: FieldRef) -> Values:
        context = self.context
        made: dict[str, Callable[[], Values]] = {
            "transfer": lambda: context.transfer(ref.column),
            "frame": lambda: self._of_frames(ref.column),
            "type": lambda: context.types(ref, self.wanted),
            "table": lambda: context.table(ref, self.wanted),
            "node": context.nodes,
            "channel": context.channels,
            "unit": lambda: context.units(self.wanted),
            "label": lambda: context.labels(context.nodes()),
            "finding": lambda: context.findings(ref.column, *context.places),
        }
        return made[ref.origin]()

    def _of_frames(self, column: str) -> Values:
        if column in ("t", "epoch", "relative", "delta", "bus"):
            return self.context.of_transfers(column)
        row, places = self.context.places
        data, has = self.context.of_frames(column, places)
        return Values(row, data, has, "frames")


class MemberSet(RowSet):
    """The frames of the transfers of a batch, each with all that its transfer has."""

    def __init__(self, context: BatchContext, transfers: TransferSet) -> None:
        self._owner, self._places = context.places
        super().__init__(context, len(self._places))
        self._transfers = transfers

    def lagged(self, place: int) -> Values:
        """Return what a field was some time ago."""
        return spread(self._transfers.lagged(place), self._owner, self._transfers.size)

    def _find(self, ref: FieldRef) -> Values:
        if ref.origin == "frame":
            data, has = self.context.of_frames(ref.column, self._places)
            return Values(None, data, has)
        if ref.origin == "finding":
            return self.context.findings(ref.column, np.arange(self.size), self._places)
        if ref.origin == "type":
            return self._transfers.values(ref).take(self._owner)._replace(row=None)
        return spread(self._transfers.values(ref), self._owner, self._transfers.size)


class FrameSet(RowSet):
    """Frames without a transfer."""

    def __init__(self, context: BatchContext, places: Array, verdicts: Array) -> None:
        super().__init__(context, len(places))
        self._places, self._verdicts = places, verdicts

    def _find(self, ref: FieldRef) -> Values:
        context = self.context
        if ref.origin == "frame":
            data, has = context.of_frames(ref.column, self._places)
            return Values(None, data, has)
        if ref.origin == "finding":
            return context.findings(ref.column, np.arange(self.size), self._places)
        if ref.origin in ("node", "label") or ref.column in ("src", "dst"):
            which = ref.column if ref.origin == "transfer" else "node"
            nodes = context.named_by_id(which, self._places, self._verdicts)
            return context.labels(nodes) if ref.origin == "label" else nodes
        if ref.origin == "type":
            return Values(None, np.zeros(self.size, bool))
        return context.none(ref)


class ErrorSet(RowSet):
    """Error frames."""

    def __init__(self, context: BatchContext, rows: Array) -> None:
        super().__init__(context, len(rows))
        self._rows = rows

    def _find(self, ref: FieldRef) -> Values:
        if ref.origin == "frame":
            return self.context.of_errors(ref.column, self._rows)
        if ref.origin == "type":
            return Values(None, np.zeros(self.size, bool))
        return self.context.none(ref)
