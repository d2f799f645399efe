"""The parameters that devices report of themselves, and the serial numbers among them.

Tables of parameters are those that a profile says are such, and that do not actuate: what somebody else sets is no
report. The standard's `GetSet` answers are parameters by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.devices import fields
from analyzer.devices.rows import usable
from analyzer.devices.settings import GET_SET, MOST_TEXT, commands, given, is_setting, written
from analyzer.facts.meaning import meaning
from analyzer.facts.traffic import times
from dissectors import picture
from dissectors.kit.cells import numbers, pylist
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.picture import Plot

ANSWERS = f"{GET_SET}.Response"
MOST_PARAMETERS = 1 << 15
MOST_VALUES = 8  # of one parameter

ParameterKey = tuple[int, int, str, str]  # bus, node, table, name


@dataclass(slots=True)
class ToldParameter:
    """The values of one parameter in their order, each with the time in ns when it was told first; `last` is the last.

    Of more than `MOST_VALUES` the last one takes the place of the one before. `reports` tell of it.
    """

    values: dict[str, int | None]
    last: str
    reports: int = 1

    def take(self, text: str, t: int | None) -> None:
        """Note a value."""
        if text != self.last and text not in self.values:
            if len(self.values) >= MOST_VALUES:
                self.values.popitem()
            self.values[text] = t
        self.last = text


class Parameters:
    """Adds up batches; at most `MOST_PARAMETERS`. Raises `ProfileError` for a wrong `plots.toml`."""

    def __init__(self, registry: Registry) -> None:
        self.all: dict[ParameterKey, ToldParameter] = {}
        self.serials: dict[tuple[int, int], str] = {}
        self._registry = registry
        plots = picture.load(registry).plots.values()
        self._plots = [plot for plot in plots if plot.parameters and not commands(registry, plot.table)]

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            table = batch.messages.get(plot.table)
            if table is not None and len(table := usable(table)):
                self._add(plot, table)
        table = batch.messages.get(ANSWERS)
        if table is not None and {"name.text", "value"} <= {*table.schema.names}:
            self._add_named(usable(table))

    def _add(self, plot: Plot, table: pa.RecordBatch) -> None:
        of = self._registry.definition(plot.table)
        node = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
        leave = fields.ABOUT_ROWS | plot.hidden | plot.own | {plot.identity}
        names = [name for name in table.schema.names if name not in leave and is_setting(of, table, name)]
        t, timed = times(table)
        for code in np.unique(node).tolist():
            rows = np.flatnonzero(node == code)
            at = code >> 8, code & 0xFF
            when = [int(t[row]) if timed[row] else None for row in rows.tolist()]
            for name in names:
                found = meaning(of, name)
                column = table.column(name).take(pa.array(rows))
                for row, value in _changes(column):
                    text = found.texts.get(value) if isinstance(value, (int, float)) else None
                    unit = "" if found.unit in ("", "unspecified") else f" {found.unit}"
                    self._note((*at, plot.table, name), f"{text or written(value)}{unit}", when[row], len(rows))
            if plot.identity in table.schema.names:
                self.serials[at] = str(table.column(plot.identity)[int(rows[-1])].as_py())

    def _add_named(self, table: pa.RecordBatch) -> None:
        t, timed = times(table)
        columns = [pylist(table.column(name)) for name in ("bus", "src", "name.text", "value")]
        for row, (bus, src, name, value) in enumerate(zip(*columns, strict=True)):
            told = given(value)
            if name and told is not None:
                when = int(t[row]) if timed[row] else None
                self._note((bus, src, "", str(name)[:MOST_TEXT]), written(told), when, 1)

    def _note(self, key: ParameterKey, text: str, t: int | None, reports: int) -> None:
        told = self.all.get(key)
        if told is None:
            if len(self.all) < MOST_PARAMETERS:
                self.all[key] = ToldParameter({text: t}, text, reports)
            return
        told.reports += reports
        told.take(text, t)


def _changes(column: pa.Array) -> Iterator[tuple[int, Any]]:
    """Yield row and value wherever it is another one than before, the first one too; nulls tell nothing."""
    before: Any = None
    for row, value in enumerate(pylist(column)):
        if value is not None and value != before:
            before = value
            yield row, value
