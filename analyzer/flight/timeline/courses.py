"""The courses of all devices and commands of a capture, and the modes of the devices."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.devices.readings import holding
from analyzer.devices.rows import split
from analyzer.flight.reports import ReportEvents
from analyzer.flight.timeline.course import DeviceValues
from dissectors.kit.order import changes
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.decode.engine import Batch
    from analyzer.flight.orders import CommandReader
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 64
MOST_MODES = 256  # changes of one device, the last ones
QUANTITIES = ("speed", "current", "temperature", "voltage")


class Stay(NamedTuple):
    """A mode from a recorded time on: its code, its name, and whether it is one of a device that failed."""

    ran: int
    code: int
    name: str
    failed: bool


@dataclass(slots=True)
class DeviceCourse:
    """The reports of one device in a table: `QUANTITIES`, and its modes. `ch` as people count, None if it has none.

    `esc` says that it is the table in which an ESC tells its speed.
    """

    table: str
    bus: int
    node: int
    ch: int | None
    esc: bool
    course: DeviceValues
    modes: deque[Stay] = field(default_factory=lambda: deque(maxlen=MOST_MODES))


@dataclass(slots=True)
class CommandCourse:
    """The course of one sender's commands, a row a channel, the first of which is called `first`."""

    bus: int
    node: int
    first: int
    width: int
    course: DeviceValues


class Courses(ReportEvents):
    """Adds up batches; bound: `MOST_DEVICES`, and as many senders of commands.

    Args:
        order: the plots and the clock.
        commands: of the batch, fed before.
    """

    def __init__(self, order: EventOrder, commands: CommandReader) -> None:
        super().__init__(order)
        self._commands = commands
        self.devices: dict[tuple[str, int], DeviceCourse] = {}
        self.commands: dict[tuple[str, int, int], CommandCourse] = {}

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells one of the quantities of devices that can be told apart."""
        return not plot.who.elements and any(line.quantity in QUANTITIES for line in plot.lines)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for some in self._commands.now:
            key, width = (some.plot.table, some.bus, some.node), len(some.columns)
            known = self.commands.get(key)
            if known is None:
                if len(self.commands) >= MOST_DEVICES:
                    continue
                known = CommandCourse(some.bus, some.node, some.plot.who.first, width, DeviceValues(width))
                self.commands[key] = known
            if width > known.width:
                known.course.widen(width)
                known.width = width
            columns = np.full((known.width, len(some.at)), np.nan, np.float32)
            columns[:width] = some.columns
            known.course.feed(some.at.ran, columns)
        for plot in self._plots:
            if (read := self._reader.table(plot, batch)) is not None:
                self._feed_table(read)

    def finish(self) -> None:
        """Take the end: everything is known."""

    def _feed_table(self, read: ReportTable) -> None:
        values, modes = _values(read), _modes(read)
        for key, rows, at in read.devices:
            one = self._of(read.plot, key)
            if one is None:
                continue
            one.course.feed(at.ran, values[:, rows])
            if modes is not None:
                codes, has, words = modes
                some = slice(None) if has is None else has[rows]
                _note(one, codes[rows][some], at.ran[some], words)

    def _of(self, plot: Plot, key: int) -> DeviceCourse | None:
        known = self.devices.get((plot.table, key))
        if known is None and len(self.devices) < MOST_DEVICES:
            bus, node, number = split(key)
            ch = number + plot.who.first if plot.who.column and plot.esc.rpm else None
            known = DeviceCourse(plot.table, bus, node, ch, bool(plot.esc.rpm), DeviceValues(len(QUANTITIES)))
            self.devices[plot.table, key] = known
        return known


class _Words(NamedTuple):
    """Names of modes, and the trouble they are a sign of, by `part=code`."""

    texts: Mapping[float, str]
    part: str
    signs: Mapping[str, str]


def _values(read: ReportTable) -> Array:
    """Return the quantities as rows, NaN where one is not told."""
    out = np.full((len(QUANTITIES), len(read.order)), np.nan, np.float32)
    for line in read.plot.lines:
        place = QUANTITIES.index(line.quantity) if line.quantity in QUANTITIES else None
        if place is not None and line.role != "commanded" and np.isnan(out[place]).all():
            out[place] = read.numbers(line.column)
    return out


def _modes(read: ReportTable) -> tuple[Array, Array | None, _Words] | None:
    """Return the modes of the rows, which rows have one (None: all), and what they are called."""
    name = read.plot.esc.mode
    found = read.column(name)
    if found is None:
        return None
    last = name.rpartition(".")[2]
    word = next((one for one in read.plot.states if name in {one.column, f"{one.column}.{last}"}), None)
    has = None if word is None else holding(word.only, read.table)
    if found.has is not None:
        has = found.has if has is None else has & found.has
    order = read.order
    return (
        found.values[order],
        None if has is None else has[order],
        _Words(found.texts, last, {} if word is None else word.signs),
    )


def _note(one: DeviceCourse, codes: Array, ran: Array, words: _Words) -> None:
    """Note where the mode of a device changes."""
    for k in changes(codes, one.modes[-1].code if one.modes else -1).tolist():
        code = int(codes[k])
        name = words.texts.get(code) or f"{code} (undefined)"
        failed = words.signs.get(f"{words.part}={code}") == "failed"
        one.modes.append(Stay(int(ran[k]), code, name, failed))
