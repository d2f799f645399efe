"""The transfers of one type in a batch: what is asked of them although nobody has asked for their table."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import Cells, Group
    from dissectors.kit import Array


def cells(column: Cells, kind: Any) -> Array:
    """Return a column of the native core as numpy."""
    return np.frombuffer(pa.py_buffer(column), kind)


class SentMessages:
    """Transfers of one type, all complete.

    Args:
        group: as the core has them.
        first: the number of the batch's first transfer.
        decode: makes their table.
    """

    def __init__(self, group: Group, first: int, decode: Callable[[Group, int], pa.RecordBatch]) -> None:
        self._group, self._first, self._decode = group, first, decode

    @cached_property
    def nodes(self) -> Array:
        """Senders of one with the right CRC (u16: bus and source node ID), each once, in ascending order."""
        return cells(self._group.nodes(), np.uint16)

    @cached_property
    def senders(self) -> Array:
        """The sender of each."""
        return cells(self._group.senders(), np.uint16)

    @cached_property
    def trusted(self) -> Array:
        """Those with the right CRC."""
        return cells(self._group.trusted(), np.uint8).view(bool)

    @cached_property
    def transfers(self) -> Array:
        """The number of each in the capture, u64."""
        return cells(self._group.rows(), np.uint32).astype(np.uint64) + np.uint64(self._first)

    def table(self, places: Array) -> pa.RecordBatch:
        """Return the table of some of them."""
        return self._decode(self._group.pick(places.astype(np.uint32).tobytes()), self._first)

    def whole(self) -> pa.RecordBatch:
        """Return the table of all."""
        return self._decode(self._group, self._first)
