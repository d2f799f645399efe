"""Events that devices tell of themselves: faults from onset to end, and changes of mode and health."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.devices import fields
from analyzer.devices.readings import holding
from analyzer.devices.rows import split
from analyzer.facts.meaning import meaning
from analyzer.facts.node_status import NODE_STATUS
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from analyzer.flight.spells import Spells
from dissectors.kit.cells import numbers, valid
from dissectors.kit.order import changes
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from collections.abc import Set as AbstractSet

    from analyzer.decode.engine import Batch
    from analyzer.facts.meaning import Meaning
    from analyzer.flight.clock import RowPlaces, Spot
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.spells import Spell
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot, States
    from dissectors.schema import Message, Packet

MOST_DEVICES = 4096
_MEASURED = ("voltage", "current", "temperature", "speed")
_LOWEST = frozenset({"voltage", "speed"})  # are worst next to 0


@dataclass(frozen=True, slots=True)
class _Flag:
    """A bit of a word: `name` is its column, `title` what people call it, `sign` the trouble that it is a sign of."""

    name: str
    title: str
    clause: str
    sign: str


class _Report(NamedTuple):
    """Reports of one device: their rows in the table, and their places. `of` defines the table."""

    plot: Plot
    of: Message | Packet | None
    table: pa.RecordBatch
    key: int
    rows: Array
    at: RowPlaces

    @property
    def who(self) -> tuple[int, int, int | None]:
        """Bus, node and channel; None where the number of the device is none."""
        bus, node, number = split(self.key)
        numbered = bool(self.plot.who.column) and bool(self.plot.esc.rpm)
        return bus, node, number + self.plot.who.first if numbered else None

    def only(self, some: Array) -> _Report:
        """Return some of them."""
        return self._replace(rows=self.rows[some], at=self.at.take(some))

    def measured(self, rows: slice) -> Iterator[tuple[str, Array]]:
        """Yield what some of them measured by quantity, numbers alone."""
        places = self.rows[rows]
        if not len(places):
            return
        near = self.table.slice(int(places[0]), int(places[-1]) + 1 - int(places[0]))
        for line in self.plot.lines:
            if line.quantity in _MEASURED and not line.role and (found := fields.column(self.of, near, line.column)):
                values, has = found[0].values[places - places[0]].astype(np.float64), found[0].has
                has = None if has is None else has[places - places[0]]
                good = ~np.isnan(values) if has is None else has & ~np.isnan(values)
                if good.any():
                    yield line.quantity, values[good]


class _Mode:
    """A column with named values, in the order of devices; `has` are the rows that have one, None for all of them.

    `same` is what all rows say, mostly for the whole of a flight; None if they do not.
    """

    def __init__(self, name: str, values: Array, has: Array | None) -> None:
        self.name, self.values, self.has = name, values, has
        self.same = int(values[0]) if has is None and values.min() == values.max() else None


class StateEvents(ReportEvents):
    """Adds up batches. Bounds: those of `Spells`, and `MOST_DEVICES`."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells states that are no parameters."""
        return bool(plot.states) and not plot.parameters

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._spells = Spells()
        self._last: dict[tuple[int, str], Spot] = {}  # report of a device and word
        self._known: dict[tuple[str, str], tuple[list[str], list[_Flag], list[str]]] = {}
        self._modes: dict[tuple[int, str], tuple[int, Spot]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.table(plot, batch)) is not None:
                self._feed_table(table)

    def finish(self) -> None:
        """Tell the faults that last to the end."""
        for spell in self._spells.finish():
            self._tell(spell)

    def _feed_table(self, read: ReportTable) -> None:
        plot, of, table = read.plot, read.of, read.table
        for states in plot.states:
            rows = holding(states.only, table)
            good = None if rows is None else rows[read.order]
            flags, modes = self._columns(plot, of, table, states)
            told = {flag.name for flag in flags if table.column(flag.name).true_count}
            word = table.column(states.column)
            known = _with(word, good, read.order)
            codes = [
                _Mode(name, numbers(column)[read.order], _with(column, good, read.order))
                for name, column in ((name, table.column(name)) for name in modes)
            ]
            for key, part, at in read.devices:
                some = _Report(plot, of, table, key, read.order[part], at)
                if flags:
                    self._feed_flags(states, flags, told, some if known is None else some.only(known[part]))
                for mode in codes:
                    self._feed_mode(mode, part, some, states.signs)

    def _columns(
        self, plot: Plot, of: Message | Packet | None, table: pa.RecordBatch, states: States
    ) -> tuple[list[_Flag], list[str]]:
        """Return the faults of a word, and the columns with named values."""
        key, names = (plot.table, states.column), table.schema.names
        known = self._known.get(key)
        if known is None or known[0] != names:
            known = self._known[key] = names, list(_flags(of, table, states)), list(_modes(of, table, states))
        return known[1:]

    def _feed_flags(self, states: States, flags: list[_Flag], told: AbstractSet[str], some: _Report) -> None:
        """Take words of a device; `told` are the flags that are set in any of the table."""
        if not len(some.rows):
            return
        word = some.key, f"{some.plot.table}.{states.column}"
        if word not in self._last and len(self._last) >= MOST_DEVICES:
            return
        for flag in flags:
            key = *word, flag.name
            if flag.name not in told and not self._spells.open(key):
                continue
            column = some.table.column(flag.name)
            on = (numbers(column) & valid(column))[some.rows]
            for part in self._spells.feed(key, on, some.at, last=self._last.get(word)):
                if part.spell.memory is None:
                    part.spell.memory = _Memory(flag, some.plot.table, some.who, {}, {})
                part.spell.memory.note(some.measured(slice(part.start, part.stop)))
                if part.over:
                    self._tell(part.spell)
        self._last[word] = some.at.at(-1)

    def _tell(self, spell: Spell) -> None:
        about: _Memory = spell.memory
        self._add(FlightEvent(
            "fault", about.flag.title, spell.before, spell.first, spell.after, *about.who, about.table,
            about.flag.clause, about.values(), about.flag.sign,
        ))  # fmt: skip

    def _feed_mode(self, mode: _Mode, rows: slice, some: _Report, signs: Mapping[str, str]) -> None:
        name, values = mode.name, mode.values[rows]
        word = some.key, f"{some.plot.table}.{name}"
        before = self._modes.get(word)
        if before is not None and before[0] == mode.same:
            self._modes[word] = before[0], some.at.at(-1)
            return
        if mode.has is not None:
            values, some = values[mode.has[rows]], some.only(mode.has[rows])
        if not len(values) or (before is None and len(self._modes) >= MOST_DEVICES):
            return
        about = meaning(some.of, name)
        kind = "health" if (some.plot.table, name) == (NODE_STATUS, "health") else "mode"
        if before is None and kind == "health" and values[0]:
            self._change(kind, _word(about, int(values[0])), None, some, 0, about.clause)
        part = name.rpartition(".")[2]
        for k in changes(values, values[0] if before is None else before[0]).tolist():
            old, spot = (int(values[k - 1]), some.at.at(k - 1)) if k else before or (0, some.at.at(0))
            text, sign = f"{_word(about, old)} -> {_word(about, int(values[k]))}", signs.get(f"{part}={values[k]}", "")
            of_what = "" if part in {kind, some.plot.esc.mode.rpartition(".")[2]} else f"{part.replace('_', ' ')} "
            self._change(kind, of_what + text, spot, some, k, about.clause, sign)
        self._modes[word] = int(values[-1]), some.at.at(-1)

    def _change(
        self, kind: str, text: str, before: Spot | None, some: _Report, k: int, clause: str, sign: str = ""
    ) -> None:
        values = {name: round(float(found[0]), 3) for name, found in some.measured(slice(k, k + 1))}
        self._add(FlightEvent(
            kind, text, before, some.at.at(k), None, *some.who, some.plot.table, clause, values, sign
        ))  # fmt: skip


@dataclass(slots=True)
class _Memory:
    """The memory of a fault: what was measured at its onset, and what was worst until it was over."""

    flag: _Flag
    table: str
    who: tuple[int, int, int | None]
    onset: dict[str, float]
    worst: dict[str, float]

    def note(self, measured: Iterator[tuple[str, Array]]) -> None:
        """Take what was measured in the next reports of the fault."""
        for name, values in measured:
            worst = float(values[np.argmin(np.abs(values)) if name in _LOWEST else np.argmax(values)])
            self.onset.setdefault(name, float(values[0]))
            both = self.worst.get(name, worst), worst
            self.worst[name] = min(both, key=abs) if name in _LOWEST else max(both)

    def values(self) -> dict[str, float]:
        """Return both by name."""
        worst = {f"worst_{name}": value for name, value in self.worst.items()}
        return {name: round(value, 3) for name, value in (self.onset | worst).items()}


def _with(column: pa.Array, good: Array | None, order: Array) -> Array | None:
    """Return which rows, in an order, have a value and are good; None for all."""
    if not column.null_count:
        return good
    has = valid(column)[order]
    return has if good is None else has & good


def _parts(table: pa.RecordBatch, word: str) -> Iterator[str]:
    return (name for name in table.schema.names if name.startswith(f"{word}."))


def _flags(of: Message | Packet | None, table: pa.RecordBatch, states: States) -> Iterator[_Flag]:
    """Yield the bits of a word that are faults."""
    for name in _parts(table, states.column):
        if pa.types.is_boolean(table.column(name).type):
            part = meaning(of, name).part
            title = part.title if part is not None and part.title else name.rpartition(".")[2].replace("_", " ")
            sign = states.signs.get(name.rpartition(".")[2], "")
            yield _Flag(name, title, meaning(of, states.column).clause, sign)


def _modes(of: Message | Packet | None, table: pa.RecordBatch, states: States) -> Iterator[str]:
    """Yield the columns with named values."""
    for name in (states.column, *_parts(table, states.column)):
        about, kind = meaning(of, name), table.column(name).type if name in table.schema.names else pa.null()
        enum = about.part.enum if about.part is not None else about.note.enum if about.note is not None else {}
        if enum and pa.types.is_integer(kind):
            yield name


def _word(about: Meaning, code: int) -> str:
    return about.texts.get(code, f"{code} (undefined)")
