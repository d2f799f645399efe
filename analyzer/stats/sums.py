"""Frames, bytes and bits by interface, sender, type and verdict: what the hierarchy and the talkers are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import who
from analyzer.stats.chosen import alike
from analyzer.tables import KINDS, VERDICTS
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from analyzer.stats.chosen import ChosenBatch, ChosenFrames
    from dissectors.kit import Array

MOST_SUMS = 1 << 16
NO_TYPE = -1  # of frames that carry nothing of DroneCAN
BEYOND = -2  # of frames beyond `MOST_SUMS`
_MESSAGE, _ANONYMOUS = KINDS.index("message"), KINDS.index("anonymous")
# Source 0 and no service: anonymous, or of a sender without node ID, which only its transfers tell.
_UNNAMED = len(KINDS)
_OTHER = NO_TYPE & 0x7
_USED = VERDICTS.index("used")


class SumKey(NamedTuple):
    """The sender of frames: interface, source, kind and type ID, verdict. `kind` is -1 of what is not DroneCAN."""

    bus: int
    node: int
    kind: int
    type_id: int
    verdict: int


@dataclass(slots=True)
class FrameSum:
    """Frames, their data bytes, and the bits that they occupy the bus for."""

    frames: int = 0
    size: int = 0
    bits: int = 0

    def add(self, frames: int, size: int, bits: int) -> None:
        """Add some more."""
        self.frames += frames
        self.size += size
        self.bits += bits


class FrameSums:
    """Adds up batches. Frames beyond `MOST_SUMS` combinations are counted by interface and verdict alone."""

    def __init__(self) -> None:
        self._sums: dict[int, FrameSum] = {}

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch; verdicts that are found out later move frames from one sum to another."""
        for rows, sign in batch.changes:
            if not len(rows.bus):
                continue
            order, begins = alike(rows)
            columns = zip(
                _codes(rows.take(order[begins])).tolist(), np.diff(begins, append=len(order)).tolist(),
                *(np.add.reduceat(c[order], begins, dtype=np.int64).tolist() for c in (rows.size, rows.bits)),
                strict=True,
            )  # fmt: skip
            for code, frames, size, bits in columns:
                self._sum(code).add(sign * frames, sign * size, sign * bits)

    def all(self, nameless: Collection[tuple[int, int]]) -> Iterator[tuple[SumKey, FrameSum]]:
        """Yield all sums that are not empty; `nameless` are interfaces and type IDs of messages with source 0."""
        found: dict[SumKey, FrameSum] = {}
        for code, one in self._sums.items():
            key = _key(code)
            if key.kind == _UNNAMED:
                known = (key.bus, key.type_id) in nameless
                key = key._replace(kind=_MESSAGE) if known else key._replace(kind=_ANONYMOUS, type_id=key.type_id & 3)
            if one.frames:
                found.setdefault(key, FrameSum()).add(one.frames, one.size, one.bits)
        yield from sorted(found.items())

    def _sum(self, code: int) -> FrameSum:
        if code not in self._sums:
            if len(self._sums) >= MOST_SUMS:
                key = _key(code)
                code = _code(key.bus, 0, BEYOND & 0x7, 0, key.verdict)
            if code not in self._sums:
                self._sums[code] = FrameSum()
        return self._sums[code]


def _codes(rows: ChosenFrames) -> Array:
    """Return for each frame its `SumKey` as one number."""
    node, code = who(rows.id, rows.flags, rows.verdict)
    number = rows.id.astype(np.int64)
    ours = code >= 0
    unnamed = ours & (number & 0xFF == 0) & (rows.verdict == _USED)
    code = np.where(unnamed, _UNNAMED << 16 | number >> 8 & 0xFFFF, np.where(ours, code, _OTHER << 16))
    node = np.where(ours, np.maximum(node, 0), 0)
    found: Array = rows.bus.astype(np.int64) << 32 | node << 24 | code << 4 | rows.verdict
    return found


def _code(bus: int, node: int, kind: int, type_id: int, verdict: int) -> int:
    return bus << 32 | node << 24 | kind << 20 | type_id << 4 | verdict


def _key(code: int) -> SumKey:
    kind = code >> 20 & 0x7
    return SumKey(code >> 32, code >> 24 & 0xFF, kind - 8 if kind > _UNNAMED else kind, code >> 4 & 0xFFFF, code & 0xF)
