"""Events of a vendor's parameters: somebody sets them, or a device reports others than before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.devices import fields
from analyzer.devices.settings import commands, is_setting, written
from analyzer.facts.meaning import meaning
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from dissectors.kit.cells import numbers
from dissectors.kit.order import changes, groups
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
    """The last value of a parameter, as a number (None: it is none) and in words, and where it was."""

    value: float | None
    text: str
    at: Spot


class ParameterEvents(ReportEvents):
    """Adds up batches; bound: `MOST_KNOWN` of what is remembered."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it has parameters."""
        return plot.parameters

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._told = [plot for plot in self._plots if plot.parameters and not commands(order.registry, plot.table)]
        self._known: dict[tuple[object, ...], _Known] = {}
        self._settings: dict[str, tuple[list[str], list[str]]] = {}  # columns of a table, and those that are settings

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
            own = [name for name in names if name not in leave and is_setting(of, table, name)]
            known = self._settings[plot.table] = names, own
        for name in known[1]:
            for column in fields.column(of, table, name):
                about = meaning(of, name)
                owner = name.rpartition(".")[0]
                special = about.note.special if about.note is not None else {}
                raw, unsaid = column.values, np.zeros(len(table), bool)
                if special:
                    unsaid |= np.isin(numbers(table.column(name)), list(special))
                if owner in table.schema.names and (note := meaning(of, owner).note) is not None and note.special:
                    unsaid |= np.isin(numbers(table.column(owner)), list(note.special))
                has = ~unsaid if column.has is None else column.has & ~unsaid
                unit = "" if column.unit in ("", "unspecified") else f" {column.unit}"
                in_hex = about.note is not None and about.note.hex
                yield _Setting(name, raw, has, about.texts, unit, in_hex)

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
        nodes = groups(numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src")))
        devices = [(code, places[timed[places]]) for code, places in nodes]
        still = _still(columns, [rows for _, rows in devices if len(rows)])
        for code, rows in devices:
            found: dict[int, list[tuple[_Setting, str]]] = {}
            for one in columns:
                key = plot.table, code, one.name
                known = self._known.get(key)
                if known is not None and one.name in still and len(rows) and known.value == one.values[rows[0]]:
                    continue
                mine = rows[one.has[rows]]
                if not len(mine):
                    continue
                first = known.value if known is not None and known.value is not None else float(one.values[mine[0]])
                for k in changes(one.values[mine], first).tolist():
                    before = one.text(int(mine[k - 1])) if k else known.text if known is not None else ""
                    found.setdefault(int(mine[k]), []).append((one, before))
                last = int(mine[-1])
                self._remember(key, _Known(float(one.values[last]), one.text(last), at.at(last)))
            self._tell_reports(plot, code, found, rows, at, clause)

    def _tell_reports(
        self, plot: Plot, code: int, found: Mapping[int, list[tuple[_Setting, str]]], rows: Array, at: RowPlaces,
        clause: str,
    ) -> None:  # fmt: skip
        key = plot.table, code
        last = self._known.get(key)
        for row in sorted(found):
            place = int(np.searchsorted(rows, row))
            before = at.at(int(rows[place - 1])) if place else last.at if last is not None else at.at(row)
            text = _listed([f"{one.name} {old} -> {one.text(row)}" for one, old in found[row]])
            values = {one.name: float(one.values[row]) for one, _ in found[row][:MOST_SHOWN]}
            who = code >> 8, code & 0xFF
            self._tell(f"reports {text}", before, at.at(row), who, plot.table, values, clause)
        if len(rows):
            self._remember(key, _Known(None, "", at.at(int(rows[-1]))))

    def _remember(self, key: tuple[object, ...], known: _Known) -> None:
        if key in self._known or len(self._known) < MOST_KNOWN:
            self._known[key] = known

    def _tell(
        self, text: str, before: Spot, here: Spot, who: tuple[int, int], type_: str, values: Mapping[str, float],
        clause: str,
    ) -> None:  # fmt: skip
        self._add(FlightEvent("parameter", text, before, here, None, *who, None, type_, clause, values))


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


def _still(columns: Sequence[_Setting], devices: Sequence[Array]) -> set[str]:
    """Return the settings that all rows have and that change between no two rows of one device."""
    rows = np.concatenate(devices) if devices else np.zeros(0, np.int64)
    first = np.cumsum([len(one) for one in devices], dtype=np.int64)[:-1]
    found = set()
    for one in columns:
        values = one.values[rows]
        moves = values[1:] != values[:-1]
        moves[first - 1] = False
        if not moves.any() and one.has.all():
            found.add(one.name)
    return found


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
