"""Events of parameters: somebody sets or saves them, a device reports others than before, or was powered up again."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.devices import fields
from analyzer.devices.rows import keyed, split, usable
from analyzer.devices.settings import GET_SET, MOST_TEXT, commands, given, is_setting, written
from analyzer.facts.meaning import meaning
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from analyzer.flight.thresholds import lasting
from dissectors.kit.cells import numbers, pylist
from dissectors.kit.order import changes, groups
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Places, Spot
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_KNOWN = 1 << 14  # parameters, of all devices
MOST_SHOWN = 8  # in one text
OPCODE = "uavcan.protocol.param.ExecuteOpcode"
_MOST_ASKED = 64  # of one node by another, that an answer may belong to
_LARGEST = 2**63


class _Known(NamedTuple):
    """The last value of a parameter, as a number (None: it is none) and in words, and where it was."""

    value: float | None
    text: str
    at: Spot


class ParameterEvents(ReportEvents):
    """Adds up batches; bound: `MOST_KNOWN` of what is remembered."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it has parameters, or counts power-ups."""
        return plot.parameters or bool(plot.starts)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._told = [plot for plot in self._plots if plot.parameters and not commands(order.registry, plot.table)]
        self._known: dict[tuple[object, ...], _Known] = {}
        # What was asked for and in which frame, by bus, who asks and who is asked.
        self._opcodes: dict[tuple[int, int, int], deque[tuple[int, str]]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            table = batch.messages.get(plot.table)
            if table is None or not len(table := usable(table)):
                continue
            if plot.saved in table.schema.names:
                self._note_sets(plot, table)
            if plot in self._told:
                self._note_reports(plot, table)
            if plot.starts in table.schema.names:
                self._note_starts(plot, table)
        for name, column, feed in (
            (f"{GET_SET}.Request", "value", self._note_asked),
            (f"{GET_SET}.Response", "value", self._note_answers),
            (f"{OPCODE}.Request", "opcode", self._note_opcodes),
            (f"{OPCODE}.Response", "ok", self._note_done),
        ):
            table = batch.messages.get(name)
            if table is not None and column in table.schema.names and len(table := usable(table)):
                feed(table)

    def finish(self) -> None:
        """Take the end: everything has been told."""

    # ---- a vendor's tables

    def _columns(self, plot: Plot, table: pa.RecordBatch, leave: frozenset[str]) -> Iterator[_Setting]:
        of = self._registry.definition(plot.table)
        for name in table.schema.names:
            if name in leave or not is_setting(of, table, name):
                continue
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
            self._tell("parameter", text, spot, spot, (bus[row], src[row], None), plot.table, values, clause)

    def _named(self, plot: Plot, table: pa.RecordBatch, name: str) -> Iterator[_Setting]:
        """Yield a column that says whom or how a command means; all its values count."""
        of = self._registry.definition(plot.table)
        for column in fields.column(of, table, name) if name in table.schema.names else []:
            about = meaning(of, name)
            has = np.ones(len(table), bool) if name != plot.saved else ~_special(about, table.column(name))
            yield _Setting(name, column.values, has, about.texts, "", about.note is not None and about.note.hex)

    def _note_reports(self, plot: Plot, table: pa.RecordBatch) -> None:
        """Note what devices report of their parameters that they did not before."""
        at, (bus, src) = self._clock.of(table), _senders(table)
        columns = list(self._columns(plot, table, fields.ABOUT_ROWS | plot.hidden | plot.own))
        clause = getattr(self._registry.definition(plot.table), "clause", "")
        timed = at.t != NO_TIME
        for code, places in groups(np.array(bus, np.int64) << 8 | np.array(src, np.int64)):
            rows = places[timed[places]]
            found: dict[int, list[tuple[_Setting, str]]] = {}
            for one in columns:
                mine = rows[one.has[rows]]
                if not len(mine):
                    continue
                key = plot.table, code, one.name
                known = self._known.get(key)
                first = known.value if known is not None and known.value is not None else float(one.values[mine[0]])
                for k in changes(one.values[mine], first).tolist():
                    before = one.text(int(mine[k - 1])) if k else known.text if known is not None else ""
                    found.setdefault(int(mine[k]), []).append((one, before))
                last = int(mine[-1])
                self._remember(key, _Known(float(one.values[last]), one.text(last), at.at(last)))
            self._tell_reports(plot, code, found, rows, at, clause)

    def _tell_reports(
        self, plot: Plot, code: int, found: Mapping[int, list[tuple[_Setting, str]]], rows: Array, at: Places,
        clause: str,
    ) -> None:  # fmt: skip
        key = plot.table, code
        last = self._known.get(key)
        for row in sorted(found):
            place = int(np.searchsorted(rows, row))
            before = at.at(int(rows[place - 1])) if place else last.at if last is not None else at.at(row)
            text = _listed([f"{one.name} {old} -> {one.text(row)}" for one, old in found[row]])
            values = {one.name: float(one.values[row]) for one, _ in found[row][:MOST_SHOWN]}
            who = code >> 8, code & 0xFF, None
            self._tell("parameter", f"reports {text}", before, at.at(row), who, plot.table, values, clause)
        if len(rows):
            self._remember(key, _Known(None, "", at.at(int(rows[-1]))))

    def _note_starts(self, plot: Plot, table: pa.RecordBatch) -> None:
        """Note counters of power-ups that went on, by no more than there was time for."""
        table, device = keyed(table, plot.who)
        if not len(table):
            return
        at, of = self._clock.of(table), self._registry.definition(plot.table)
        (counter,) = fields.column(of, table, plot.starts)[:1] or (None,)
        if counter is None:
            return
        identity = numbers(table.column(plot.identity)) if plot.identity in table.schema.names else None
        timed = (at.t != NO_TIME) & (True if counter.has is None else counter.has)
        for key, places in groups(device):
            rows = places[timed[places]]
            if not len(rows):
                continue
            bus, node, number = split(key)
            pieces = [("", rows)] if identity is None else list(_by_value(identity, rows))
            for which, mine in pieces:
                self._count(plot, (key, which), counter.values[mine], at.take(mine), (bus, node, number))

    def _count(
        self, plot: Plot, device: tuple[int, object], counts: Array, at: Places, who: tuple[int, int, int]
    ) -> None:  # fmt: skip
        key = plot.table, "starts", *device
        known = self._known.get(key)
        first = known.value if known is not None and known.value is not None else float(counts[0])
        for k in changes(counts, first).tolist():
            before = at.at(k - 1) if k else known.at if known is not None else at.at(k)
            old, new = int(counts[k - 1]) if k else int(first), int(counts[k])
            room = (at.t[k] - before.t + lasting("power_up_slack")) // SECOND
            if 0 < new - old <= room:
                often = "again" if new - old == 1 else f"{new - old} times"
                text = f"was powered up {often}: {plot.starts} {old} -> {new}"
                ch = who[2] + plot.who.first if plot.who.column and plot.esc.rpm else None
                values = {plot.starts: float(new)}
                self._tell("power-up", text, before, at.at(k), (who[0], who[1], ch), plot.table, values)
        self._remember(key, _Known(float(counts[-1]), "", at.at(-1)))

    # ---- the standard's services

    def _note_asked(self, table: pa.RecordBatch) -> None:
        """Take requests that set a parameter; one without a value asks for it."""
        at, (bus, src), dst = self._clock.of(table), _senders(table), pylist(table.column("dst"))
        names, told = _texts(table), pylist(table.column("value"))
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            value = given(told[row])
            if value is not None and names[row]:
                spot, text = at.at(row), f"sets {names[row]} of node {dst[row]} to {written(value)}"
                values = _numbers(names[row], value)
                self._tell("parameter", text, spot, spot, (bus[row], src[row], None), f"{GET_SET}.Request", values)

    def _note_answers(self, table: pa.RecordBatch) -> None:
        """Note what devices answer that they did not before."""
        at, (bus, src) = self._clock.of(table), _senders(table)
        names, told = _texts(table), pylist(table.column("value"))
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            value = given(told[row])
            if value is None or not names[row]:
                continue
            key, text, spot = (GET_SET, bus[row], src[row], names[row]), written(value), at.at(row)
            known = self._known.get(key)
            if known is not None and known.text != text:
                self._tell(
                    "parameter", f"reports {names[row]} {known.text} -> {text}", known.at, spot,
                    (bus[row], src[row], None), f"{GET_SET}.Response", _numbers(names[row], value),
                )  # fmt: skip
            self._remember(key, _Known(None, text, spot))

    def _note_opcodes(self, table: pa.RecordBatch) -> None:
        """Take requests to save or erase all parameters."""
        at, (bus, src), dst = self._clock.of(table), _senders(table), pylist(table.column("dst"))
        words = meaning(self._registry.definition(f"{OPCODE}.Request"), "opcode").texts
        codes = numbers(table.column("opcode"))
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            code, spot = int(codes[row]), at.at(row)
            word = words.get(code) or f"opcode {code}"
            key = bus[row], src[row], dst[row] or 0
            if key in self._opcodes or len(self._opcodes) < MOST_KNOWN:
                self._opcodes.setdefault(key, deque(maxlen=_MOST_ASKED)).append((spot.frame, word))
            text = f"asks node {dst[row]}: {word} its parameters"
            self._tell("save", text, spot, spot, (bus[row], src[row], None), f"{OPCODE}.Request", {})

    def _note_done(self, table: pa.RecordBatch) -> None:
        """Take answers to such requests."""
        at, (bus, src), dst = self._clock.of(table), _senders(table), pylist(table.column("dst"))
        done = numbers(table.column("ok")).astype(bool)
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            spot, asked = at.at(row), self._opcodes.get((bus[row], dst[row] or 0, src[row]), ())
            word = next((word for frame, word in reversed(asked) if frame < spot.frame), "save or erase")
            text = f"{word} its parameters: {'done' if done[row] else 'not done'}"
            self._tell("save", text, spot, spot, (bus[row], src[row], None), f"{OPCODE}.Response", {})

    # ----

    def _remember(self, key: tuple[object, ...], known: _Known) -> None:
        if key in self._known or len(self._known) < MOST_KNOWN:
            self._known[key] = known

    def _tell(
        self, kind: str, text: str, before: Spot, here: Spot, who: tuple[int, int, int | None], type_: str,
        values: Mapping[str, float], clause: str = "",
    ) -> None:  # fmt: skip
        self._add(FlightEvent(kind, text, before, here, None, *who, type_, clause, values))


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


def _texts(table: pa.RecordBatch) -> list[str]:
    """Return the names of parameters in the standard's services, empty for none."""
    if "name.text" not in table.schema.names:
        return [""] * len(table)
    return [str(name or "")[:MOST_TEXT] for name in pylist(table.column("name.text"))]


def _numbers(name: str, value: Any) -> Mapping[str, float]:
    """Return a value by its name if it is a number."""
    return {name: float(value)} if isinstance(value, (int, float)) and abs(value) < _LARGEST else {}


def _by_value(values: Array, rows: Array) -> Iterator[tuple[object, Array]]:
    for value in np.unique(values[rows]).tolist():
        yield value, rows[values[rows] == value]


def _listed(parts: Sequence[str]) -> str:
    more = f" and {len(parts) - MOST_SHOWN} more" if parts[MOST_SHOWN:] else ""
    return ", ".join(parts[:MOST_SHOWN]) + more
