"""Counters over frames and transfers, batch by batch, with a bound on each: what `info` knows of the traffic."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.tables import EXTENDED, FD, REMOTE, STATUSES, VERDICTS, counted
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array


BIT_RATE = 1_000_000
MOST_TALKS = 8192
MOST_IDS = 65536
FEWEST_OF_RATE = 4  # transfers: the times between two or three say nothing of how many come in a second
_BATCHES_KEPT = 8
# Nominal bits of a classic frame without data or stuffing, interframe space included.
_EXTENDED_BITS, _STANDARD_BITS = 67, 47
_NEVER = np.iinfo(np.int64).max
_BAD = np.array([name not in {"ok", "unchecked"} for name in STATUSES])
_FOREIGN = VERDICTS.index("foreign")


def times(table: pa.RecordBatch, column: str = "t") -> tuple[Array, Array]:
    """Return a time column as nanoseconds, and which of them there are."""
    array = table.column(column)
    return numbers(array), valid(array)


def rate(count: int, first: int | None, last: int | None) -> float | None:
    """Return the mean rate of transfers, in a second, from the first to the last.

    None for fewer than `FEWEST_OF_RATE`, and without times.
    """
    if first is None or last is None or count < FEWEST_OF_RATE or last <= first:
        return None
    return (count - 1) * SECOND / (last - first)


@dataclass(slots=True)
class BusCount:
    """One interface. `bits` are nominal; `peak` is the most frames within a second of the clock of the first frame."""

    frames: int = 0
    bits: int = 0
    fd: int = 0
    first: int | None = None
    last: int | None = None
    peak: int = 0
    _second: int | None = None
    _count: int = 0

    def feed(self, sizes: Array, flags: Array, t: Array) -> None:
        """Add frames in capture order: data bytes, flags, and the times of those that have one."""
        self.frames += len(sizes)
        self.fd += int(np.count_nonzero(flags & FD))
        remote = flags & REMOTE != 0
        data = int(sizes.sum()) - (int(sizes[remote].sum()) if remote.any() else 0)
        extended = int(np.count_nonzero(flags & EXTENDED))
        self.bits += _EXTENDED_BITS * extended + _STANDARD_BITS * (len(sizes) - extended) + 8 * data
        if not t.size:
            return
        first, last = int(t.min()), int(t.max())
        self.first = first if self.first is None else min(self.first, first)
        self.last = last if self.last is None else max(self.last, last)
        for second, count in _seconds(t, self.first):
            self._count = count + (self._count if second == self._second else 0)
            self._second = second
            self.peak = max(self.peak, self._count)


def _seconds(t: Array, start: int) -> Iterator[tuple[int, int]]:
    """Yield the seconds from a start on in which frames came, in order, and how many each."""
    first, last = (int(t[0]) - start) // SECOND, (int(t[-1]) - start) // SECOND
    if last - first < len(t) and bool((t[1:] >= t[:-1]).all()):
        ends = np.searchsorted(t, start + np.arange(first, last + 2) * SECOND).tolist()
        yield from ((first + k, b - a) for k, (a, b) in enumerate(pairwise(ends)) if b > a)
    else:
        yield from zip(*counted((t - start) // SECOND), strict=True)


@dataclass(slots=True)
class Talk:
    """Transfers of one type that one node sends on one bus."""

    count: int = 0
    bad: int = 0
    first: int | None = None
    last: int | None = None
    channels: frozenset[int] = frozenset()

    @property
    def hz(self) -> float | None:
        """Mean rate, see `rate`."""
        return rate(self.count, self.first, self.last)


TypeKey = tuple[int, int, int]  # kind, type ID, variant
TalkKey = tuple[int, int, TypeKey]  # bus, node, what it sends


class Talks:
    """Every `Talk` of a capture; those beyond `MOST_TALKS` are only counted together."""

    def __init__(self) -> None:
        self.all: dict[TalkKey, Talk] = {}
        self._by_code: dict[int, tuple[TypeKey, Talk]] = {}
        self.beyond = 0

    def feed(self, transfers: pa.RecordBatch) -> set[TypeKey]:
        """Count a batch; gives the types that occur in it."""
        if not len(transfers):
            return set()
        names = ("bus", "src", "variant", "kind", "type_id")
        bus, src, variant, kind, type_id = (numbers(transfers.column(name)).astype(np.int64) for name in names)
        code = bus << 40 | src << 32 | variant << 24 | kind << 16 | type_id
        order, begins = grouped(code)
        count = np.diff(begins, append=len(code))
        bad = np.add.reduceat(_BAD[numbers(transfers.column("status"))[order]], begins, dtype=np.int64)
        t, timed = times(transfers)
        low, high = (t, t) if timed.all() else (np.where(timed, t, _NEVER), np.where(timed, t, -_NEVER))
        firsts, lasts = np.minimum.reduceat(low[order], begins), np.maximum.reduceat(high[order], begins)
        types: set[TypeKey] = set()
        columns = (column.tolist() for column in (code[order[begins]], count, bad, firsts, lasts))
        for one, number, broken, first, last in zip(*columns, strict=True):
            known = self._by_code.get(one)
            if known is None:
                types.add(type_ := _type(one))
                talk = self._talk((one >> 40, one >> 32 & 0xFF, type_), number)
                if talk is None:
                    continue
                known = self._by_code[one] = type_, talk
            type_, talk = known
            types.add(type_)
            talk.count += number
            if broken:
                talk.bad += broken
            if first <= last:
                if talk.first is None or first < talk.first:
                    talk.first = first
                if talk.last is None or last > talk.last:
                    talk.last = last
        return types

    def _talk(self, key: TalkKey, count: int) -> Talk | None:
        """Return a talk that is new, None if there is no room for it."""
        if len(self.all) >= MOST_TALKS:
            self.beyond += count
            return None
        talk = self.all[key] = Talk()
        return talk


def _type(code: int) -> TypeKey:
    return code >> 16 & 0xFF, code & 0xFFFF, code >> 24 & 0xFF


def _codes(ids: Array, flags: Array) -> Array:
    """Return identifiers, each with a bit that says whether it has 29 bits."""
    codes: Array = ids.astype(np.int64) << 1 | (flags & EXTENDED != 0)
    return codes


class ForeignIds:
    """Identifiers of frames that are not DroneCAN, with how often each occurs.

    Verdicts that settle later than `_BATCHES_KEPT` batches after their frame, and more than `MOST_IDS` identifiers,
    are not followed up.
    """

    def __init__(self) -> None:
        self._counts: dict[int, int] = {}  # by identifier and length, as `_codes` has them
        self._kept: deque[tuple[int, Array, Array, Array]] = deque(maxlen=_BATCHES_KEPT)

    def feed(self, batch: Batch) -> None:
        """Count a batch, and correct earlier ones by what settled."""
        frames = batch.frames
        ids, flags = numbers(frames.column("id")), numbers(frames.column("flags"))
        verdicts = numbers(frames.column("verdict"))
        foreign = np.flatnonzero(verdicts == _FOREIGN)
        if len(foreign):
            self._change(_codes(ids[foreign], flags[foreign]), 1)
        if len(frames):
            self._kept.append((batch.first_frame, ids, flags, verdicts.copy()))
        if not len(batch.settled):
            return
        number, verdict = (numbers(batch.settled.column(c)).astype(np.int64) for c in ("frame", "verdict"))
        for first, ids, flags, known in self._kept:
            here = (number >= first) & (number < first + len(known))
            if not here.any():
                continue
            at = np.unique(number[here]) - first
            before = known[at] == _FOREIGN
            known[number[here] - first] = verdict[here]
            after = known[at] == _FOREIGN
            for rows, by in ((at[after & ~before], 1), (at[before & ~after], -1)):
                self._change(_codes(ids[rows], flags[rows]), by)

    def _change(self, codes: Array, by: int) -> None:
        counts = self._counts
        for code, count in zip(*counted(codes), strict=True):
            known = counts.get(code)
            if known is None and len(counts) >= MOST_IDS:
                continue
            now = (known or 0) + by * count
            if now > 0:
                counts[code] = now
            else:
                counts.pop(code, None)

    def most(self) -> Iterator[tuple[str, int]]:
        """Yield identifiers as candump writes them, the most frequent first."""
        for code, count in sorted(self._counts.items(), key=lambda item: (-item[1], item[0])):
            yield f"{code >> 1:08X}" if code & 1 else f"{code >> 1:03X}", count
