"""The course of what each sender sends: how many transfers of a type in each step of time, with bounded memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import times
from dissectors.kit.cells import numbers
from dissectors.records import dataclass, field
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.report.comparison.clock import BelievedTimes
    from dissectors.kit import Array

MOST_STEPS = 2048  # as many, and two become one
MOST_SENT = 2048  # senders and types; others have no course
FEWEST_BLOCKS = 4  # that tell what is usual
FIRST_STEP = 100 * MILLISECOND

SentKey = tuple[int, int, int, int]  # bus, node, kind, type ID


@dataclass(slots=True)
class Rhythm:
    """Transfers of one type of one node, counted in the steps of `Rhythms`; times in nanoseconds."""

    first: int
    last: int
    count: int = 0
    steps: Array = field(default_factory=lambda: np.zeros(MOST_STEPS, np.int32))


@dataclass(frozen=True, slots=True)
class Pulse:
    """The usual rate of a sender, and when it was slower.

    `blocks` are transfers in blocks of `width` ns from `start` on, which is near the first one, to the end of the
    capture; `usual` is their median up to the last transfer, `spread` how far they lie from it, as a share.
    """

    start: int
    width: int
    blocks: Array
    usual: float
    spread: float
    count: int

    @property
    def hz(self) -> float:
        """Transfers a second, as usual."""
        return self.usual * SECOND / self.width

    def below(self, hz: float) -> Array:
        """Return which blocks hold less than a rate; the last one ends with the capture, and is as short as that."""
        slow: Array = self.blocks * (SECOND / self.width) < hz
        return slow[:-1] if len(slow) > 1 else slow

    def off(self, by: float) -> Array:
        """Return which blocks lie off the usual number by more than `by`, with those beside them; not the last one."""
        whole = self.blocks[:-1]
        if len(whole) < FEWEST_BLOCKS:
            return np.zeros(0, bool)
        padded = np.concatenate((whole[:1], whole, whole[-1:]))
        calm = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=1)
        found: Array = np.abs(calm - self.usual) > by
        return found


class Rhythms:
    """Adds up batches. Steps begin at the first transfer with a time; earlier ones count in the first step.

    Args:
        clock: of the capture, which is given each batch first; transfers with stray times do not count.
    """

    def __init__(self, clock: BelievedTimes) -> None:
        self._clock = clock
        self.all: dict[SentKey, Rhythm] = {}
        self.start: int | None = None
        self.step = FIRST_STEP
        self.end = 0

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        transfers = batch.transfers
        t, timed = times(transfers)
        rows = np.flatnonzero(timed & self._clock.holds(t))
        if not rows.size:
            return
        columns = (numbers(transfers.column(name))[rows].astype(np.int64) for name in ("bus", "src", "kind", "type_id"))
        bus, src, kind, type_id = columns
        t = t[rows]
        if self.start is None:
            self.start = int(t[0])
        self.end = max(self.end, int(t.max()))
        while (self.end - self.start) // self.step >= MOST_STEPS:
            self._double()
        at = np.maximum((t - self.start) // self.step, 0)
        code = bus << 40 | src << 32 | kind << 24 | type_id
        order = np.argsort(code, kind="stable")
        code, t, at = code[order], t[order], at[order]
        starts = np.flatnonzero(np.diff(code, prepend=-1)).tolist()
        for a, b in zip(starts, [*starts[1:], len(code)], strict=True):
            self._add(int(code[a]), t[a:b], at[a:b])

    def pulse(self, key: SentKey, fewest: int) -> Pulse | None:
        """Return how often it is sent, in blocks that usually hold `fewest` transfers; None for too little."""
        one = self.all.get(key)
        if one is None or self.start is None or one.count < 2 * fewest or one.last <= one.first:
            return None
        used = int((self.end - self.start) // self.step) + 1
        a, b = max(int((one.first - self.start) // self.step), 0), int((one.last - self.start) // self.step)
        many = max(1, -(-fewest * (b - a + 1) // one.count))
        begin = a + 1 if a else 0  # the step of the first one may have been cut
        if begin + many > used:
            return None
        blocks = np.add.reduceat(one.steps[:used], np.arange(begin, used, many)).astype(np.float64)
        inside = blocks[: (b + 1 - begin) // many]
        inside = inside[inside > 0]
        if len(inside) < FEWEST_BLOCKS:
            return None
        usual = float(np.median(inside))
        low, high = np.quantile(inside, (0.1, 0.9))
        start, spread = self.start + begin * self.step, float(high - low) / usual
        return Pulse(start, many * self.step, blocks, usual, spread, one.count)

    def _add(self, code: int, t: Array, at: Array) -> None:
        key = code >> 40, code >> 32 & 0xFF, code >> 24 & 0xFF, code & 0xFFFFFF
        one = self.all.get(key)
        if one is None:
            if len(self.all) >= MOST_SENT:
                return
            one = self.all[key] = Rhythm(int(t[0]), int(t[0]))
        one.count += len(t)
        one.first, one.last = min(one.first, int(t.min())), max(one.last, int(t.max()))
        low = int(at.min())
        more = np.bincount(at - low)
        one.steps[low : low + len(more)] += more.astype(np.int32)

    def _double(self) -> None:
        self.step *= 2
        for one in self.all.values():
            halved = one.steps.reshape(-1, 2).sum(axis=1)
            one.steps = np.concatenate((halved, np.zeros(MOST_STEPS - len(halved), np.int32)))


def of_node(all_: Mapping[SentKey, Rhythm], bus: int, node: int) -> Iterator[SentKey]:
    """Yield what a node sends."""
    return (key for key in sorted(all_) if key[:2] == (bus, node))
