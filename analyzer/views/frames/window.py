"""The frames behind the transfers, looked up by number, for as long as they are kept."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.tables import BRS, ERROR, ESI, EXTENDED, FD, FRAMES, REMOTE, empty
from dissectors.kit.cells import pylist

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

KEPT = 1 << 17  # frames
_FEW, _MOST = 2, 64  # batches
_COLUMNS = ("id", "flags", "data")  # of frames, as they are asked for by number
_LENGTH_CODE = 8  # lowest bit of it in the flags


class RawFrame(NamedTuple):
    """One CAN frame as captured; `t` in nanoseconds, None if there was no time; `flags` as in the frame table."""

    id: int
    data: bytes
    bus: int
    t: int | None
    flags: int

    @property
    def id_text(self) -> str:
        """The identifier as candump writes it: 8 digits when extended, 3 when not."""
        return f"{self.id:08X}" if self.flags & EXTENDED else f"{self.id:03X}"

    @property
    def length_code(self) -> int:
        """The length code of a remote frame, which has no data."""
        return self.flags >> _LENGTH_CODE & 0xF

    @property
    def candump(self) -> str:
        """The frame as candump writes it: `123#DEADBEEF`, `123#R8`, `123##1DEADBEEF`."""
        if self.flags & REMOTE:
            return f"{self.id_text}#R{self.length_code}"
        fd = f"#{bool(self.flags & BRS) | bool(self.flags & ESI) << 1}" if self.flags & FD else ""
        return f"{self.id_text}#{fd}{self.data.hex().upper()}"

    def flag(self, name: str) -> bool:
        """Return `xtd`, `rtr` or `err`."""
        return bool(self.flags & {"xtd": EXTENDED, "rtr": REMOTE, "err": ERROR}[name])


if TYPE_CHECKING:
    FrameData = Callable[[int], RawFrame | None]


class FrameWindow:
    """The last frames, by frame number from 0: `window.feed(batch)`, then `window(number)`.

    Transfers end in the batch they are listed in, but may begin in an earlier one: batches are kept that hold so many
    `frames`, and the one before the last in any case. What is gone gives None.
    """

    def __init__(self, frames: int = KEPT) -> None:
        self._batches: OrderedDict[int, pa.RecordBatch] = OrderedDict()
        self._kept, self._held = frames, 0
        self._open: tuple[int, list[tuple[int, bytes, int, int | None, int]]] = (0, [])

    def feed(self, batch: Batch) -> None:
        """Keep the batch's frames, and forget those of the oldest batches when there are too many."""
        if len(batch.frames):
            self._batches[batch.first_frame] = batch.frames
            self._held += len(batch.frames)
        while len(self._batches) > _FEW and self._is_full():
            _, gone = self._batches.popitem(last=False)
            self._held -= len(gone)

    def _is_full(self) -> bool:
        oldest = next(iter(self._batches.values()))
        return len(self._batches) > _MOST or self._held - len(oldest) >= self._kept

    def rows(self, places: Array) -> dict[str, pa.Array]:
        """Return the columns `id`, `flags` and `data` of frames, null for those that are gone."""
        at, end = np.full(len(places), -1), 0
        found: list[list[pa.Array]] = [[empty(FRAMES).column(name)] for name in _COLUMNS]
        for first, frames in self._batches.items():
            inside = np.flatnonzero((places >= first) & (places < first + len(frames)))
            if len(inside):
                at[inside] = np.arange(end, end + len(inside))
                end += len(inside)
                rows = pa.array(places[inside] - first)
                for part, name in zip(found, _COLUMNS, strict=True):
                    part.append(frames.column(name).take(rows))
        order = pa.array(at, mask=at < 0)
        return {name: pa.concat_arrays(parts).take(order) for name, parts in zip(_COLUMNS, found, strict=True)}

    def __call__(self, number: int) -> RawFrame | None:
        """Return the frame with this number."""
        first, rows = self._open
        if not first <= number < first + len(rows):
            start = max((k for k in self._batches if k <= number), default=None)
            if start is None or number >= start + len(self._batches[start]):
                return None
            table, first = self._batches[start], start
            rows = list(zip(*(pylist(table.column(c)) for c in ("id", "data", "bus", "t", "flags")), strict=True))
            self._open = first, rows
        return RawFrame(*rows[number - first])
