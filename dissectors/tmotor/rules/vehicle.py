"""The vehicle as a whole: its ESCs by index, and whether motors turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, SECOND, RunningTime
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, NO_CHANNEL, commands, units
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import View
    from dissectors.tmotor.rules.joined.joins import RawCommands


class VehicleExercise:
    """Collects what the vehicle did, in the words for what rules need.

    `escs` are the indexes that each (bus, node) reported, `running_ns` is how long motors turned.
    """

    def __init__(self) -> None:
        self.escs: dict[tuple[int, int], set[int]] = {}
        self._words: set[str] = set()
        self._motion = Motion()
        self._running = RunningTime()
        self._commanded: dict[int, int] = {}
        self._channels: dict[int, int] = {}  # of the last command, by bus

    @property
    def running_ns(self) -> int:
        """Time with motors turning, on the bus with the most."""
        return self._running.longest

    def feed(self, view: View) -> None:
        """Add the next batch."""
        for unit in units(view):
            if len(self.escs) < MOST_UNITS or (unit.bus, unit.node) in self.escs:
                self.escs.setdefault((unit.bus, unit.node), set()).add(unit.index)
        self._note_motion(view)
        self._note_commands(view)
        self._running.end = view.end

    def words(self) -> Iterable[str]:
        """Return what was there."""
        if sum(map(len, self.escs.values())) > 1:
            self._words.add("several ESCs")
        return self._words

    def facts(self) -> dict[str, float]:
        """Return how many ESCs there are, on all buses that repeat each other, and seconds with motors turning."""
        escs = {(node, index) for (_, node), indexes in self.escs.items() for index in indexes}
        return {"escs": len(escs), "running_s": self.running_ns / SECOND}

    def _note_motion(self, view: View) -> None:
        started = {bus: _first(view, bus) for bus in range(len(view.buses)) if not self._motion.known(bus)}
        changes = self._motion.feed(view)
        for bus, (number, times, on) in changes.items():
            if len(on) and (not on.all() or number[0] > started.get(bus, number[0])):
                self._words.add("motors at rest")
            if len(on):
                self._words.add("motors running")
            for t, turning in zip(times.tolist(), on.tolist(), strict=True):
                self._running.note(bus, t, turning=turning)
        if "motors at rest" not in self._words and any(
            self._motion.known(bus) and not self._motion.turning(bus) for bus in range(len(view.buses))
        ):
            self._words.add("motors at rest")

    def _note_commands(self, view: View) -> None:
        for bus, sent in commands(view).items():
            below = "negative throttle" not in self._words and bool(sent.cmd.min(initial=0) < 0)
            if below and ((sent.cmd < 0) & (sent.cmd != NO_CHANNEL)).any():
                self._words |= {"negative throttle", "bad throttle"}
            if "bad throttle" not in self._words:
                self._note_pauses(bus, sent)
        if "bad throttle" not in self._words and any(
            view.end - t > 100 * MILLISECOND for t in self._commanded.values()
        ):
            self._words.add("bad throttle")

    def _note_pauses(self, bus: int, sent: RawCommands) -> None:
        last = self._commanded.get(bus, int(sent.t[0]))
        if (np.diff(sent.t, prepend=last) > 100 * MILLISECOND).any():
            self._words.add("bad throttle")
        if self._channels.get(bus, 0) > int(sent.counts.min()) or (np.diff(sent.counts) < 0).any():
            self._words.add("bad throttle")  # a channel is left out
        self._channels[bus] = int(sent.counts[-1])
        self._commanded[bus] = int(sent.t[-1])


def _first(view: View, bus: int) -> int:
    """Return the first transfer of this batch that tells something of a bus's motors; a large number without any."""
    table = view.table("ESCStatus")
    numbers = [int(table["transfer"][rows[0]]) for unit, rows in units(view).items() if table and unit.bus == bus]
    numbers += [int(sent.number[0]) for index, sent in commands(view).items() if index == bus]
    return min(numbers, default=1 << 62)


def labels(view: View) -> Iterator[tuple[int, int, str]]:
    """Yield ESCs by the channel that people call them, which counts from 1."""
    for unit in units(view):
        yield unit.bus, unit.node, f"ch{unit.index + 1}"
