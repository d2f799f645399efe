"""Events of the standard's services for parameters: set, answered otherwise than before, saved, erased."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.devices.settings import GET_SET, MOST_TEXT, given, holds_value, written
from analyzer.facts.meaning import meaning
from analyzer.flight.log import FlightEvent
from dissectors.kit.cells import numbers, pylist
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Spot
    from analyzer.flight.reports import EventOrder

MOST_KNOWN = 1 << 14  # parameters, of all devices
OPCODE = "uavcan.protocol.param.ExecuteOpcode"
_MOST_ASKED = 64  # of one node by another, that an answer may belong to
_LARGEST = 2**63


class ParameterServiceEvents:
    """Adds up batches; bound: `MOST_KNOWN` of what is remembered."""

    def __init__(self, order: EventOrder) -> None:
        self._registry, self._clock, self._add, self._reader = order.registry, order.clock, order.add, order.reader
        self._known: dict[tuple[int, int, str], tuple[str, Spot]] = {}  # values by bus, node and name
        # What was asked for and in which frame, by bus, who asks and who is asked.
        self._opcodes: dict[tuple[int, int, int], deque[tuple[int, str]]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for name, column, feed in (
            (f"{GET_SET}.Request", "value", self._note_asked),
            (f"{GET_SET}.Response", "value", self._note_answers),
            (f"{OPCODE}.Request", "opcode", self._note_opcodes),
            (f"{OPCODE}.Response", "ok", self._note_done),
        ):
            table = self._reader.rows(name, batch)
            if table is not None and column in table.schema.names:
                feed(table)

    def finish(self) -> None:
        """Take the end: everything has been told."""

    def _note_asked(self, table: pa.RecordBatch) -> None:
        """Take requests that set a parameter; one without a value asks for it."""
        table = self._with_values(table)
        at, (bus, src), dst = self._clock.of(table), _senders(table), pylist(table.column("dst"))
        names, told = _texts(table), pylist(table.column("value"))
        for row, name in enumerate(names):
            if name:
                value = given(told[row])
                spot, text = at.at(row), f"sets {name} of node {dst[row]} to {written(value)}"
                values = _numbers(name, value)
                self._tell("parameter", text, spot, spot, bus[row], src[row], f"{GET_SET}.Request", values)

    def _note_answers(self, table: pa.RecordBatch) -> None:
        """Note what devices answer that they did not before."""
        table = self._with_values(table)
        at, (bus, src) = self._clock.of(table), _senders(table)
        names, told = _texts(table), pylist(table.column("value"))
        for row, name in enumerate(names):
            if not name:
                continue
            value = given(told[row])
            key, text, spot = (bus[row], src[row], name), written(value), at.at(row)
            known = self._known.get(key)
            if known is not None and known[0] != text:
                self._tell(
                    "parameter", f"reports {name} {known[0]} -> {text}", known[1], spot, bus[row], src[row],
                    f"{GET_SET}.Response", _numbers(name, value),
                )  # fmt: skip
            if known is not None or len(self._known) < MOST_KNOWN:
                self._known[key] = text, spot

    def _with_values(self, table: pa.RecordBatch) -> pa.RecordBatch:
        """Return the rows that have a time and a value."""
        rows = holds_value(table.column("value")) & (self._clock.of(table).t != NO_TIME)
        return table if rows.all() else table.filter(pa.array(rows))

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
            self._tell("save", text, spot, spot, bus[row], src[row], f"{OPCODE}.Request", {})

    def _note_done(self, table: pa.RecordBatch) -> None:
        """Take answers to such requests."""
        at, (bus, src), dst = self._clock.of(table), _senders(table), pylist(table.column("dst"))
        done = numbers(table.column("ok")).astype(bool)
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            spot, asked = at.at(row), self._opcodes.get((bus[row], dst[row] or 0, src[row]), ())
            word = next((word for frame, word in reversed(asked) if frame < spot.frame), "save or erase")
            text = f"{word} its parameters: {'done' if done[row] else 'not done'}"
            self._tell("save", text, spot, spot, bus[row], src[row], f"{OPCODE}.Response", {})

    def _tell(
        self, kind: str, text: str, before: Spot, here: Spot, bus: int, node: int, type_: str,
        values: Mapping[str, float],
    ) -> None:  # fmt: skip
        self._add(FlightEvent(kind, text, before, here, None, bus, node, None, type_, "", values))


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
