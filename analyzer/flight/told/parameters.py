"""Events of a vendor's parameters: somebody sets them, or a device reports others than before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.decode.columns import senders
from analyzer.devices import fields
from analyzer.devices.settings import commands, is_setting, written
from analyzer.facts.meaning import meaning
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from dissectors.kit.cells import numbers
from dissectors.kit.order import groups
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces, Spot
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_KNOWN = 1 << 14  # parameters, of all devices
MOST_SHOWN = 8  # in one text


class _Known(NamedTuple):
    """The last value of a parameter, as a number and in words."""

    value: float
    text: str


class _Device(NamedTuple):
    """The rows of one device in a table: what is `changed` in which of them, from which words, and is `known` now."""

    code: int
    rows: Array
    changed: dict[int, list[tuple[_Setting, str]]]
    known: dict[str, _Known]


class ParameterEvents(ReportEvents):
    """Adds up batches; bound: `MOST_KNOWN` of what is remembered."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it has parameters."""
        return plot.parameters

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._told = [plot for plot in self._plots if plot.parameters and not commands(order.registry, plot.table)]
        self._known: dict[tuple[str, int, str], _Known] = {}
        self._last: dict[tuple[str, int], Spot] = {}  # report of a device
        self._settings: dict[
            str, tuple[list[str], list[_About]]
        ] = {}  # columns of a table, and those that are settings

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.rows(plot.table, batch)) is None:
                continue
            if plot.saved in table.schema.names:
                self._note_sets(plot, table)
            if plot in self._told:
                self._note_reports(plot, table)

    def finish(self) -> None:
        """Take the end: everything has been told."""

    def _columns(self, plot: Plot, table: pa.RecordBatch, leave: frozenset[str]) -> Iterator[_Setting]:
        of, names = self._registry.definition(plot.table), table.schema.names
        known = self._settings.get(plot.table)
        if known is None or known[0] != names:
            own = [_About.of(of, name, names) for name in names if name not in leave and is_setting(of, table, name)]
            known = self._settings[plot.table] = names, own
        for one in known[1]:
            for column in fields.column(of, table, one.name):
                has = np.ones(len(table), bool) if column.has is None else column.has
                for word, special in one.unsaid:
                    has = has & ~np.isin(numbers(table.column(word)), special)
                unit = "" if column.unit in ("", "unspecified") else f" {column.unit}"
                yield _Setting(one.name, column.values, has, one.texts, unit, one.in_hex)

    def _note_sets(self, plot: Plot, table: pa.RecordBatch) -> None:
        """Take commands that set parameters; those that change nothing are questions."""
        at, bus, src = self._clock.of(table), *_senders(table)
        whose = plot.own | {plot.identity}
        columns = list(self._columns(plot, table, fields.ABOUT_ROWS | plot.hidden | whose | {plot.saved}))
        about = [one for name in (*plot.own, plot.identity) for one in self._named(plot, table, name)]
        kept = list(self._named(plot, table, plot.saved))
        clause = getattr(self._registry.definition(plot.table), "clause", "")
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            found = [one for one in columns if one.has[row]]
            if not found:
                continue
            text = f"sets {_listed([f'{one.name} {one.text(row)}' for one in found])}"
            more = [f"{one.name} {one.text(row)}" for one in about] + [one.text(row) for one in kept if one.has[row]]
            text += f" ({', '.join(more)})" if more else ""
            values = {one.name: float(one.values[row]) for one in found[:MOST_SHOWN]}
            spot = at.at(row)
            self._tell(text, spot, spot, (bus[row], src[row]), plot.table, values, clause)

    def _named(self, plot: Plot, table: pa.RecordBatch, name: str) -> Iterator[_Setting]:
        """Yield a column that says whom or how a command means; all its values count."""
        of = self._registry.definition(plot.table)
        for column in fields.column(of, table, name) if name in table.schema.names else []:
            about = meaning(of, name)
            has = np.ones(len(table), bool) if name != plot.saved else ~_special(about, table.column(name))
            yield _Setting(name, column.values, has, about.texts, "", about.note is not None and about.note.hex)

    def _note_reports(self, plot: Plot, table: pa.RecordBatch) -> None:
        """Note what devices report of their parameters that they did not before."""
        at = self._clock.of(table)
        columns = list(self._columns(plot, table, fields.ABOUT_ROWS | plot.hidden | plot.own))
        clause = getattr(self._registry.definition(plot.table), "clause", "")
        timed = at.t != NO_TIME
        nodes = groups(senders(table))
        devices = [_Device(code, places[timed[places]], {}, {}) for code, places in nodes if timed[places].any()]
        if not devices:
            return
        rows, ends = np.concatenate([one.rows for one in devices]), np.cumsum([len(one.rows) for one in devices])
        for setting in columns:
            self._compare(plot, setting, devices, rows, ends)
        for device in devices:
            self._tell_reports(plot, device, at, clause)

    def _compare(self, plot: Plot, one: _Setting, devices: Sequence[_Device], rows: Array, ends: Array) -> None:
        """Let devices know where a setting is not what it was in their report before, and what it is at the end.

        Their `rows` stand one device behind the other, up to the `ends`.
        """
        if not one.has.all():
            has = one.has[rows]
            rows, ends = rows[has], np.cumsum(has)[ends - 1]
            if not len(rows):
                return
            some = np.flatnonzero(np.diff(ends, prepend=0))
            devices, ends = [devices[k] for k in some.tolist()], ends[some]
        values, begins = one.values[rows], np.concatenate(([0], ends[:-1]))
        moves = np.empty(len(rows), bool)
        np.not_equal(values[1:], values[:-1], out=moves[1:])
        knowns = [self._known.get((plot.table, device.code, one.name)) for device in devices]
        firsts = list(map(float, values[begins].tolist()))
        moves[begins] = [
            first != (first if known is None else known.value) for first, known in zip(firsts, knowns, strict=True)
        ]
        moved = np.flatnonzero(moves)
        if not len(moved) and None not in knowns:
            return
        whose = np.searchsorted(ends, moved, "right")
        for place, who in zip(moved.tolist(), whose.tolist(), strict=True):
            known = knowns[who]
            old = "" if known is None else known.text
            if place != begins[who]:
                old = one.text(int(rows[place - 1]))
            devices[who].changed.setdefault(int(rows[place]), []).append((one, old))
        for device, known, last in zip(devices, knowns, (ends - 1).tolist(), strict=True):
            value = float(values[last])
            if known is None or known.value != value:
                device.known[one.name] = _Known(value, one.text(int(rows[last])))

    def _tell_reports(self, plot: Plot, device: _Device, at: RowPlaces, clause: str) -> None:
        code = device.code
        for name, known in device.known.items():
            if (key := (plot.table, code, name)) in self._known or self._room:
                self._known[key] = known
        whole = plot.table, code
        if device.changed:
            self._tell_changes(plot, device, at, clause)
        if whole in self._last or self._room:
            self._last[whole] = at.at(int(device.rows[-1]))

    def _tell_changes(self, plot: Plot, device: _Device, at: RowPlaces, clause: str) -> None:
        code, last = device.code, self._last.get((plot.table, device.code))
        rows = np.array(sorted(device.changed), np.int64)
        places = np.searchsorted(device.rows, rows)
        columns = rows.tolist(), places.tolist(), at.spots(device.rows[places - 1]), at.spots(rows)
        for row, place, before, here in zip(*columns, strict=True):
            since = before if place else last or here
            changed = device.changed[row]
            text = _listed([f"{one.name} {old} -> {one.text(row)}" for one, old in changed])
            values = {one.name: float(one.values[row]) for one, _ in changed[:MOST_SHOWN]}
            self._tell(f"reports {text}", since, here, (code >> 8, code & 0xFF), plot.table, values, clause)

    @property
    def _room(self) -> bool:
        return len(self._known) + len(self._last) < MOST_KNOWN

    def _tell(
        self, text: str, before: Spot, here: Spot, who: tuple[int, int], type_: str, values: Mapping[str, float],
        clause: str,
    ) -> None:  # fmt: skip
        self._add(FlightEvent("parameter", text, before, here, None, *who, None, type_, clause, values))


class _About(NamedTuple):
    """A column that is a setting: `unsaid` are words and their values that say that there is none."""

    name: str
    texts: Mapping[float, str]
    in_hex: bool
    unsaid: Sequence[tuple[str, Sequence[float]]]

    @classmethod
    def of(cls, of: Any, name: str, names: Sequence[str]) -> _About:
        """Return what is said of a column of a table with these `names`."""
        about, owner = meaning(of, name), name.rpartition(".")[0]
        notes = [(name, about.note), (owner, meaning(of, owner).note if owner in names else None)]
        unsaid = [(word, list(note.special)) for word, note in notes if note is not None and note.special]
        return cls(name, about.texts, about.note is not None and about.note.hex, unsaid)


class _Setting(NamedTuple):
    """A column of settings: `has` are the rows that have one, `texts` names of values."""

    name: str
    values: Array
    has: Array
    texts: Mapping[float, str]
    unit: str
    in_hex: bool

    def text(self, row: int) -> str:
        """Return the value of a row in words."""
        value = self.values[row].item()
        if (name := self.texts.get(value)) is not None:
            return name
        if self.in_hex and isinstance(value, int):
            return f"0x{value & 0xFFFF_FFFF:X}" if value < 0 else f"0x{value:X}"
        return f"{written(value)}{self.unit}"


def _special(about: Any, column: pa.Array) -> Array:
    """Return the rows that hold no value, but a sign for none."""
    found: Array = np.isin(numbers(column), list(about.note.special) if about.note is not None else [])
    return found


def _senders(table: pa.RecordBatch) -> tuple[list[int], list[int]]:
    bus, src = (numbers(table.column(name)).astype(np.int64).tolist() for name in ("bus", "src"))
    return bus, src


def _listed(parts: Sequence[str]) -> str:
    more = f" and {len(parts) - MOST_SHOWN} more" if parts[MOST_SHOWN:] else ""
    return ", ".join(parts[:MOST_SHOWN]) + more
