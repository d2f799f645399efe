"""How full each interface is: frames and bits by the second.

Bits are those on the wire, the stuffing really needed and the gap between frames included. Of a CAN FD frame with a
faster data phase that phase is only estimated, as a fifth of its bits: no capture says how fast it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from dissectors.conformance import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.columns import Frames
    from analyzer.rules.view import View
    from dissectors.conformance import Words

MOST_STEPS = 4096  # of an interface; beyond, steps become twice as wide


class Second(NamedTuple):
    """Frames of an interface one after the other in one second; `start` is where the second begins.

    `t` and `frame` are those of the first. A second that a batch or a step back in time cuts has several of these.
    """

    bus: int
    start: int
    t: int
    frame: int
    frames: int
    bits: int


def split(frames: Frames, origin: int) -> list[Second]:
    """The seconds of a batch, counted from `origin` on, by interface and then in the order of the frames."""
    if not len(frames) or origin == NO_TIME:
        return []
    offsets, data = frames.raw
    base = int(offsets[0])
    places = (offsets - offsets.dtype.type(base)).tobytes()
    wire = data[base : int(offsets[-1])].tobytes()
    bits = np.frombuffer(_native.frame_bits(frames.id.tobytes(), frames.flags.tobytes(), places, wire), np.uint16)
    buses = np.flatnonzero(np.bincount(frames.bus)).tolist()
    timed = frames.t != NO_TIME
    whole = bool(timed.all())
    found = []
    for bus in buses:
        rows = None if len(buses) == 1 and whole else np.flatnonzero((frames.bus == bus) & timed)
        found += _of_bus(bus, frames, bits, rows, origin)
    return found


def _of_bus(bus: int, frames: Frames, bits: Words, rows: Words | None, origin: int) -> list[Second]:
    t = frames.t if rows is None else frames.t[rows]
    if not len(t):
        return []
    index = (t - origin) // SECOND
    starts = np.concatenate(([0], np.flatnonzero(index[1:] != index[:-1]) + 1))
    own = bits if rows is None else bits[rows]
    sums = np.add.reduceat(own, starts, dtype=np.int64).tolist()
    counts = np.diff(starts, append=len(t)).tolist()
    places = starts if rows is None else rows[starts]
    columns = (origin + index[starts] * SECOND, t[starts], frames.first + places)
    listed = zip(*(column.tolist() for column in columns), counts, sums, strict=True)
    return [Second(bus, start, first, frame, n, total) for start, first, frame, n, total in listed]


class BusLoad:
    """Frames and bits of each interface over the whole capture, in bounded memory."""

    def __init__(self) -> None:
        self._start = NO_TIME
        self._steps: dict[int, tuple[int, dict[int, tuple[int, int]]]] = {}

    @property
    def buses(self) -> Sequence[int]:
        """Interfaces with frames that have times."""
        return sorted(self._steps)

    def look(self, view: View) -> None:
        """The next batch."""
        for one in view.seconds:
            step, steps = self._steps.setdefault(one.bus, (SECOND, {}))
            self._start = one.start if self._start == NO_TIME else self._start
            self._steps[one.bus] = _added(step, steps, one, self._start)

    def series(self, bus: int) -> tuple[int, int, list[int], list[int]]:
        """Start of the first step, width of all (both ns), frames and bits of each; empty without frames."""
        step, steps = self._steps.get(bus, (SECOND, {}))
        if not steps:
            return NO_TIME, step, [], []
        first = min(steps)
        cells = [steps.get(at, (0, 0)) for at in range(first, max(steps) + 1)]
        return self._start + first * step, step, [frames for frames, _ in cells], [bits for _, bits in cells]


def _added(
    step: int, steps: dict[int, tuple[int, int]], one: Second, start: int
) -> tuple[int, dict[int, tuple[int, int]]]:
    at = (one.start - start) // step
    while max((at, *steps)) - min((at, *steps)) >= MOST_STEPS:
        step, at = 2 * step, at // 2
        wider: dict[int, tuple[int, int]] = {}
        for old, cell in steps.items():
            wider[old // 2] = _sum(wider.get(old // 2, (0, 0)), cell)
        steps = wider
    steps[at] = _sum(steps.get(at, (0, 0)), (one.frames, one.bits))
    return step, steps


def _sum(one: tuple[int, int], other: tuple[int, int]) -> tuple[int, int]:
    return one[0] + other[0], one[1] + other[1]
