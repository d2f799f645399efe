"""Transfers with what they carry: the rows of a batch, each with its type and its message row."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers, pylist
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Message, Packet

_MOST_MARKED = 1 << 20  # codes of types, rather than to sort those of a batch
_MOST_PADDING = 15  # the largest step between two lengths that CAN FD has: 48 to 64


@dataclass(frozen=True, slots=True)
class MessagePart:
    """Rows of one message or packet table that belong to picked transfers.

    `of` is their layout and meaning, None for the bytes that no packet claims. `at[k]` is the position, among the
    picked transfers, of the transfer that row k came from.
    """

    name: str
    of: Message | Packet | None
    table: pa.RecordBatch
    at: list[int]

    def own(self, field: str) -> str:
        """Return the column of a field: another one if it is called like a column that every message has."""
        other = f"{field}.field"
        return other if other in self.table.schema.names else field


class TransferRows:
    """Some transfers of a batch, column by column.

    Args:
        batch: what the pipeline produced.
        registry: the types it was decoded with.
        picked: rows of `batch.transfers`, in the order to show; all if not given.

    `messages` has each transfer's type, None when unknown. `typed` are the tables of the types that occur, cut to the
    picked transfers; a broken transfer has a type, but no row in them.
    """

    def __init__(self, batch: Batch, registry: Registry, picked: Array | None = None) -> None:
        total = len(batch.transfers)
        self.batch = batch
        self.picked = np.arange(total) if picked is None else np.asarray(picked, np.int64)
        self._whole = len(self.picked) == total and bool((self.picked == np.arange(total)).all())
        self._transfers = batch.transfers if self._whole else batch.transfers.take(pa.array(self.picked))
        self._columns: dict[str, list[Any]] = {}
        known, inverse = known_types(registry, *(self.array(name) for name in ("variant", "kind", "type_id")))
        self.messages = [known[k] for k in inverse.tolist()]
        found = {m.table: m for m in known if m is not None}.values()
        self._where = np.full(total, -1)
        self._where[self.picked] = np.arange(len(self.picked))
        self.typed = [part for m in found for part in self._part(m.table, m)]

    def __len__(self) -> int:
        """Return how many transfers were picked."""
        return len(self.picked)

    def column(self, name: str) -> list[Any]:
        """Return a column of `TRANSFERS`; times and gaps as integer nanoseconds."""
        if name not in self._columns:
            self._columns[name] = pylist(self._transfers.column(name))
        return self._columns[name]

    def array(self, name: str) -> Array:
        """Return a column of numbers as numpy, null cells with an arbitrary value."""
        return numbers(self._transfers.column(name))

    def padding(self) -> list[int]:
        """Count bytes at the end of each payload that only fill up a CAN FD frame: zero, and behind the last field."""
        found = [0] * len(self)
        fd, payload = self.column("fd"), self.column("payload")
        for part in self.typed:
            left, lost = pylist(part.table.column("bits_left")), pylist(part.table.column("bad_tag"))
            for at, bits, unknown in zip(part.at, left, lost, strict=True):
                count = bits // 8
                if fd[at] and 0 < count <= _MOST_PADDING and not unknown and not any(payload[at][-count:]):
                    found[at] = count
        return found

    def unpadded(self) -> list[bytes]:
        """Return the payloads without their CAN FD padding."""
        return [data[: len(data) - count] for data, count in zip(self.column("payload"), self.padding(), strict=True)]

    def _part(self, name: str, of: Message | Packet | None) -> list[MessagePart]:
        table = self.batch.messages.get(name)
        if table is None or not len(table):
            return []
        at = self._where[(numbers(table.column("transfer")) - np.uint64(self.batch.first_transfer)).astype(np.int64)]
        if self._whole:
            return [MessagePart(name, of, table, at.tolist())]
        rows = np.flatnonzero(at >= 0)
        return [MessagePart(name, of, table.take(pa.array(rows)), at[rows].tolist())] if rows.size else []


def known_types(registry: Registry, variant: Array, kind: Array, type_id: Array) -> tuple[list[Message | None], Array]:
    """Return the types of transfers, None for unknown ones, and for each transfer the place of its type."""
    codes = variant.astype(np.int64) << 18 | kind.astype(np.int64) << 16 | type_id
    room = int(codes.max(initial=0)) + 1
    if room > _MOST_MARKED:
        occurring, inverse = np.unique(codes, return_inverse=True)
    else:  # no need to sort
        marked = np.zeros(room, bool)
        marked[codes] = True
        occurring = np.flatnonzero(marked)
        inverse = np.cumsum(marked)[codes] - 1
    return [registry.message(code >> 16 & 3, code & 0xFFFF, code >> 18) for code in occurring.tolist()], inverse
