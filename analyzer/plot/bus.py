"""The load of each interface, second by second, and how many frames that were, beside the limits."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import BIT_RATE
from analyzer.plot.chunks import path
from analyzer.plot.inventory import Series
from analyzer.plot.moments import Moments
from analyzer.rules.load import bit_times, split
from dissectors.kit import SECOND
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.plot.canvas import Canvas
    from dissectors.kit import Array, FrameTable

LOAD, RATE = "bus_load", "frame_rate"
MOST_SECONDS = 1 << 17  # of each bus, whose loads are remembered: 36 hours
_OPEN = 2 * SECOND  # a second is over when a frame of this much later is there


@dataclass(slots=True)
class _Second:
    frame: int
    frames: int = 0
    bits: int = 0


class BusPlots:
    """Adds up frames by interface and second; whole seconds are drawn.

    Args:
        canvas: takes the points.
        bit_rate: of the buses, in bits a second.
    """

    def __init__(self, canvas: Canvas, bit_rate: int | None = None) -> None:
        self._canvas = canvas
        self._bit_rate = bit_rate or BIT_RATE
        self._open: dict[int, dict[int, _Second]] = {}
        self._latest: dict[int, int] = {}
        self._span: dict[int, tuple[int, int]] = {}  # first and last frame number drawn
        self._ends: list[tuple[int, int]] = []  # time and frame of the first and of the last second drawn
        self._buses: tuple[str, ...] = ()
        self._loads: dict[int, tuple[array[int], array[float]]] = {}  # seconds in order, and the load in each

    def feed(
        self, frames: FrameTable, places: Array, start: int | None, buses: tuple[str, ...], bits: Array | None = None
    ) -> None:
        """Take frames of a batch; `places` are their numbers in the capture from 0, `bits` their `bit_times` if any."""
        self._buses = buses
        if start is None or not len(frames):
            return
        over: dict[int, list[tuple[int, _Second]]] = {}
        for second in split(frames, bit_times(frames) if bits is None else bits, start).each():
            frame = int(places[second.frame])
            here = self._open.setdefault(second.bus, {})
            one = here.setdefault(second.start, _Second(frame + 1))
            one.frames += second.frames
            one.bits += second.bits
            if second.start > self._latest.get(second.bus, start - 1):
                self._latest[second.bus] = second.start
                for old in sorted(at for at in here if at <= second.start - _OPEN):
                    over.setdefault(second.bus, []).append((old, here.pop(old)))
        for bus, seconds in over.items():
            self._draw(bus, seconds)

    def finish(self, limits: Mapping[str, float]) -> None:
        """Draw the seconds that are still open, and the limits as long as all: frames a second by what they are for."""
        for bus, here in self._open.items():
            self._draw(bus, sorted(here.items()))
        self._open = {}
        if len(self._ends):
            ends = [min(self._ends), max(self._ends)]
            moments = Moments(np.array([t for t, _ in ends]), np.array([frame for _, frame in ends]))
            for name, limit in limits.items():
                series = Series(
                    path(RATE, "limit", f"{limit:g}"), "line", RATE, f"{limit:g} {name}".strip(), "frames/s",
                    role="limit", owner="bus",
                )  # fmt: skip
                self._canvas.lines([(series, np.full(2, float(limit)), None)], moments)

    def _draw(self, bus: int, seconds: list[tuple[int, _Second]]) -> None:
        if not seconds:
            return
        rows = list(self._with_silence(bus, seconds))
        moments = Moments(np.array([t for t, _ in rows], np.int64), np.array([one.frame for _, one in rows], np.int64))
        rates = np.array([one.frames for _, one in rows], np.float64)
        loads = np.array([100 * one.bits / self._bit_rate for _, one in rows])
        name = self._buses[bus] or "bus"
        known = self._canvas.inventory.series
        columns = []
        for quantity, title, unit, values in ((LOAD, "load", "%", loads), (RATE, "rate", "frames/s", rates)):
            entity = path(quantity, name)
            series = known.get(entity) or Series(
                entity, "line", quantity, f"{name} {title}", unit, unit=name, owner="bus", number=bus
            )
            columns.append((series, values, None))
        self._canvas.lines(columns, moments)
        seconds_, kept = self._loads.setdefault(bus, (array("q"), array("d")))
        if len(kept) < MOST_SECONDS and (not seconds_ or rows[0][0] >= seconds_[-1]):
            seconds_.extend(t for t, _ in rows)
            kept.extend(loads.tolist())
        places = [*self._ends, *((t, one.frame) for t, one in rows)]
        self._ends = [min(places), max(places)]

    def load(self, bus: int, t: int) -> float:
        """Return the load that is drawn at a time, in percent."""
        seconds, loads = self._loads.get(bus, (array("q"), array("d")))
        place = bisect_right(seconds, t)
        return loads[max(place - 1, 0)] if loads else 0.0

    def _with_silence(self, bus: int, seconds: list[tuple[int, _Second]]) -> Iterable[tuple[int, _Second]]:
        """Put a zero behind and in front of seconds between which there were none."""
        last = self._span.get(bus)
        for t, one in seconds:
            if last is not None and t - last[0] > SECOND:
                yield last[0] + SECOND, _Second(one.frame)
                if t - last[0] > 2 * SECOND:
                    yield t - SECOND, _Second(one.frame)
            yield t, one
            last = (t, one.frame)
        if last is not None:
            self._span[bus] = last
