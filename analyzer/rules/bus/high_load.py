"""The load of a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, set_back

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Second, View


class HighLoad(Rule):
    """BUS-004: a second with more bits than a share of the bit rate."""

    rules = ("BUS-004",)

    def __init__(self) -> None:
        self._open: dict[int, Second] = {}
        self._last: dict[int, int] = {}  # time of the latest frame

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Judge the seconds that a later one of the same interface has ended."""
        if view.bit_rate is None:
            return
        new: set[int] = set()
        for one in view.seconds.each():
            last = self._open.get(one.bus)
            # A batch cuts a second in two; within a batch only a clock that is set back does.
            goes_on = one.bus not in new and not len(set_back(np.array([self._last.get(one.bus, one.t), one.t])))
            new.add(one.bus)
            if last is not None and last.start == one.start and goes_on:
                self._open[one.bus] = last._replace(frames=last.frames + one.frames, bits=last.bits + one.bits)
                continue
            self._open[one.bus] = one
            if last is not None:
                yield from _judged(view, last)
        t, timed = view.frames.t, view.frames.t != NO_TIME
        for bus in self._open:
            own = np.flatnonzero((view.frames.bus == bus) & timed)
            self._last[bus] = int(t[own[-1]]) if len(own) else self._last[bus]

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Judge the last second of each interface."""
        for one in self._open.values():
            yield from _judged(view, one)


def _judged(view: View, one: Second) -> Iterator[Occurrence]:
    load = 100 * one.bits / (view.bit_rate or SECOND)
    limits = [view.number("BUS-004", name) for name in ("first_pct", "second_pct")]
    passed = [limit for limit in limits if load > limit]
    if passed:
        values = {"load_pct": load, "limit_pct": max(passed)}
        yield Occurrence("BUS-004", one.t, one.bus, None, "", (one.frame,), values)
