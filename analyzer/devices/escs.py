"""The table `esc`: what ESCs report beside what they were commanded, of any vendor whose folder says which columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.devices import fields
from analyzer.devices.as_of import AsOf, ToldValues
from analyzer.devices.readings import holding
from analyzer.devices.rows import NUMBER_BITS, keyed, usable
from analyzer.facts.traffic import times
from analyzer.tables import ESC, empty
from dissectors import picture
from dissectors.kit.cells import floats, numbers, valid
from dissectors.picture import EscColumns
from dissectors.records import dataclass, replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot

CHANNEL = "channel"  # the column in which a profile gives people's number of an ESC
LONGEST = 2 * SECOND  # from the first frame of a transfer to its last
CARRIED = SECOND  # as long as what an ESC said in another message counts
_NUMBERS = ("reported", "rpm", "voltage", "current", "temperature")


def beside(batches: Iterable[Batch], registry: Registry) -> Iterator[Batch]:
    """Yield the batches with the table `esc` among their messages. Raises `ProfileError` for a wrong `plots.toml`."""
    escs = Escs(registry)
    for batch in batches:
        rows = escs.feed(batch)
        yield replace(batch, messages={**batch.messages, "esc": rows}) if len(rows) else batch


@dataclass(frozen=True, slots=True)
class _EscRows:
    """The rows of one table. `device` tells apart the ESCs that a node speaks of, `number` is that of the ESC or -1."""

    plot: Plot
    table: pa.RecordBatch
    transfer: Array
    t: Array
    timed: Array
    device: Array
    number: Array


class Escs:
    """Makes the table of one batch after the other; what is joined to a report may be of an earlier one.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
    """

    def __init__(self, registry: Registry) -> None:
        plots = picture.load(registry).plots.values()
        self._registry = registry
        self._commands = [plot for plot in plots if plot.esc.commanded]
        self._plots = [plot for plot in plots if replace(plot.esc, commanded="") != EscColumns()]
        self._commanded = AsOf(LONGEST)
        self._channels = AsOf()
        self._said = {name: AsOf() for name in _NUMBERS}

    def feed(self, batch: Batch) -> pa.RecordBatch:
        """Return the rows of the next batch, in the order in which the reports were complete."""
        for plot in self._commands:
            if (table := batch.messages.get(plot.table)) is not None:
                self._note_commands(plot, usable(table), batch)
        for table in batch.messages.values():
            if CHANNEL in table.schema.names and "src" in table.schema.names:
                self._note_channels(usable(table))
        reports = [one for plot in self._plots for one in self._reports(plot, batch.messages)]
        for one in reports:
            self._note_values(one)
        rows = [self._rows(one) for one in reports]
        for kept in (self._commanded, self._channels, *self._said.values()):
            kept.forget()
        if not rows:
            return empty(ESC)
        return pa.Table.from_batches(rows).sort_by("transfer").combine_chunks().to_batches()[0]

    def _note_commands(self, plot: Plot, table: pa.RecordBatch, batch: Batch) -> None:
        """Note each value with the time at which its command was complete."""
        found = fields.elements(self._registry.definition(plot.table), table, plot.esc.commanded)
        if found is None:
            return
        row, place, values = found
        whole = (numbers(table.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
        ends = batch.transfers.column("t_end")
        end, (t, timed) = numbers(ends)[whole], times(table)
        good = np.flatnonzero((timed & valid(ends)[whole])[row] & _has(values))
        row, place = row[good], place[good]
        key = _esc(numbers(table.column("bus"))[row], place + plot.who.first)
        self._commanded.feed(ToldValues(key, end[row], values.values[good].astype(np.float64), t[row]))

    def _note_channels(self, table: pa.RecordBatch) -> None:
        column = table.column(CHANNEL)
        if not pa.types.is_floating(column.type) and not pa.types.is_integer(column.type):
            return
        rows = np.flatnonzero(valid(column))
        node, transfer = (array[rows] for array in (_nodes(table), _transfers(table)))
        self._channels.feed(ToldValues(node, transfer, numbers(column)[rows].astype(np.float64), times(table)[0][rows]))

    def _reports(self, plot: Plot, tables: Mapping[str, pa.RecordBatch]) -> Iterator[_EscRows]:
        """Yield the rows of a table, if it has some."""
        table = tables.get(plot.table)
        if table is None:
            return
        table, device = keyed(usable(table), plot.who)
        if not len(table):
            return
        t, timed = times(table)
        number = np.full(len(table), -1, np.int64)
        if plot.who.column:
            number = (device & (1 << NUMBER_BITS) - 1) + plot.who.first
        yield _EscRows(plot, table, _transfers(table), t, timed, device, number)

    def _note_values(self, one: _EscRows) -> None:
        """Note what a table says of its ESCs: also that it says nothing now."""
        of = self._registry.definition(one.plot.table)
        for name in _NUMBERS:
            found = fields.column(of, one.table, getattr(one.plot.esc, name))
            if found:
                values = np.where(_has(found[0]), floats(found[0].values), np.nan)
                self._said[name].feed(ToldValues(one.device, one.transfer, values, one.t))

    def _rows(self, one: _EscRows) -> pa.RecordBatch:
        bus = numbers(one.table.column("bus"))
        known, told, _ = self._channels.ask(_nodes(one.table), one.transfer)
        channel = np.where(one.number >= 0, one.number, np.where(known, np.nan_to_num(told), -1)).astype(np.int64)
        commanded, value, since = self._commanded.ask(_esc(bus, channel), one.t)
        commanded &= one.timed & (channel >= 0)
        columns = {
            "transfer": pa.array(one.transfer.astype(np.uint64)),
            "t": one.table.column("t"),
            "bus": one.table.column("bus"),
            "node": one.table.column("src"),
            "ch": pa.array(channel.astype(np.int32), mask=channel < 0),
            "type": pa.array([one.plot.table] * len(bus)),
            "commanded": pa.array(value.astype(np.float32), mask=~commanded),
            "command_age": pa.array(one.t - since, mask=~commanded).cast(pa.duration("ns")),
        }
        for name, said in self._said.items():
            there, value, t = said.ask(one.device, one.transfer)
            there &= ~np.isnan(value) & (~one.timed | (one.t - t <= CARRIED))
            columns[name] = pa.array(value.astype(np.float32), mask=~there)
        columns["mode"], columns["faults"] = self._mode(one), self._faults(one)
        return pa.RecordBatch.from_arrays([columns[field.name] for field in ESC], schema=ESC)

    def _mode(self, one: _EscRows) -> pa.Array:
        name = one.plot.esc.mode
        found = fields.column(self._registry.definition(one.plot.table), one.table, name)
        if not found:
            return pa.nulls(len(one.table), pa.string())
        (column,) = found
        has = self._holds(one, name) & _has(column)
        codes, inverse = np.unique(column.values, return_inverse=True)
        texts = [column.texts.get(code) or f"{code} (undefined)" for code in codes.tolist()]
        return pa.array(np.array(texts, object)[inverse], pa.string(), mask=~has)

    def _faults(self, one: _EscRows) -> pa.Array:
        word = one.plot.esc.faults
        prefix = f"{word}."
        flags = [
            (field.name.removeprefix(prefix).replace("_", " "), one.table.column(field.name))
            for field in one.table.schema
            if word and field.name.startswith(prefix) and pa.types.is_boolean(field.type)
        ]
        if not flags:
            return pa.nulls(len(one.table), pa.string())
        has = self._holds(one, word) & valid(one.table.column(word))
        which = sum(((numbers(flag) & valid(flag)).astype(np.int64) << k) for k, (_, flag) in enumerate(flags))
        codes, inverse = np.unique(which, return_inverse=True)
        texts = [", ".join(name for k, (name, _) in enumerate(flags) if code >> k & 1) for code in codes.tolist()]
        return pa.array(np.array(texts, object)[inverse], pa.string(), mask=~has)

    def _holds(self, one: _EscRows, column: str) -> Array:
        """Return the rows whose node means this word, or the word of this part, as `states` says."""
        words = {states.column: states.only for states in one.plot.states}
        only = words.get(column, words.get(column.rpartition(".")[0]))
        rows = holding(only, one.table)
        return np.ones(len(one.table), bool) if rows is None else rows


def _has(column: fields.Column) -> Array:
    return np.ones(len(column.values), bool) if column.has is None else column.has


def _esc(bus: Array, channel: Array) -> Array:
    key: Array = bus.astype(np.int64) << 32 | channel.astype(np.int64) & 0xFFFF_FFFF
    return key


def _nodes(table: pa.RecordBatch) -> Array:
    node: Array = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
    return node


def _transfers(table: pa.RecordBatch) -> Array:
    return numbers(table.column("transfer")).astype(np.int64)
