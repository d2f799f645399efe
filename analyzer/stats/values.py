"""`values,FIELD`: how the values of a field are spread, for each device that tells it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.compiled import compile_expression
from analyzer.stats.distribution import ERROR, EXACT, Distribution
from analyzer.stats.order import is_type
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from dissectors import picture
from dissectors.kit import groups
from dissectors.kit.cells import numbers, valid
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors.kit import Array

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("device", "Device", "text"),
    StatColumn("count", "Count"),
    StatColumn("min", "Min", "number", 3),
    StatColumn("mean", "Mean", "number", 3),
    StatColumn("p50", "p50", "number", 3),
    StatColumn("p95", "p95", "number", 3),
    StatColumn("p99", "p99", "number", 3),
    StatColumn("max", "Max", "number", 3),
)
MOST_DEVICES = 4096
_NUMBER_BITS, _MOST_NUMBER = 16, 0xFFFF  # of a device; above it the place of the table that speaks of it
_DEVICE_BITS = _NUMBER_BITS + 8
_NOBODY = (1 << _DEVICE_BITS) - 1
_HUNDRED = 100  # from here on numbers need fewer decimals


class ValueTable(Statistic):
    """A row a device: the ESC or unit that a message speaks of where the profile says which, else the node.

    Args:
        order: its argument is an expression of the filter language. Raises `FilterError`.
    """

    def __init__(self, order: StatOrder) -> None:
        (text,) = order.arguments
        self._expression = compile_expression(text, order.registry)
        if is_type(text, order.registry):
            raise ValueError(f"{text} is a type: values needs a field (tailbyte fields {text} lists them)")
        plots = picture.load(order.registry).plots
        self._whose = {table: plot.who for table, plot in plots.items() if table in self._expression.tables}
        self._found: dict[int, Distribution] = {}
        self._beyond = 0

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        measured = self._expression.feed(batch.batch)
        rows, values = measured.rows, measured.every
        if not len(rows):
            return
        devices = self._devices(batch.batch, rows, len(measured.valid))
        if batch.rows is not None:
            chosen = np.zeros(len(measured.valid), bool)
            chosen[batch.rows] = True
            rows, values, devices = (column[chosen[rows]] for column in (rows, values, devices))
        transfers = batch.batch.transfers
        bus, src = (numbers(transfers.column(name)).astype(np.int64)[rows] for name in ("bus", "src"))
        for key, at in groups((bus << 8 | src) << _DEVICE_BITS | devices):
            if key not in self._found and len(self._found) >= MOST_DEVICES:
                self._beyond += len(at)
                continue
            self._found.setdefault(key, Distribution()).feed(values[at])

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the devices, by interface, node and number."""
        rows = []
        whole = sum(one.count for one in self._found.values()) + self._beyond
        for key, one in sorted(self._found.items()):
            if not one.count:
                continue
            bus, node = key >> _DEVICE_BITS + 8, key >> _DEVICE_BITS & 0xFF
            quantiles = (one.quantile(share) for share in (0.5, 0.95, 0.99))
            rows.append(
                (end.buses[bus], str(node), self._title(key), one.count, one.low, one.mean, *quantiles, one.high)
            )
        notes = (
            [f"quantiles of more than {EXACT} values are within {100 * ERROR:g} % of the value"]
            if any(one.count > EXACT for one in self._found.values())
            else []
        )
        if left_out := sum(one.left_out for one in self._found.values()):
            notes.append(f"{left_out} values are no numbers (NaN, infinite): left out")
        if self._beyond:
            notes.append(f"and {self._beyond} values of further devices")
        unit = f" in {self._expression.unit}" if self._expression.unit else ""
        total = (None, "all", None, whole, *[None] * 6)
        about = f"{self._expression.text}{unit}"
        largest = max((max(abs(one.low), abs(one.high)) for one in self._found.values()), default=0.0)
        digits = 3 - (largest >= _HUNDRED) - (largest >= 10 * _HUNDRED)
        columns = [replace(column, digits=digits) if column.kind == "number" else column for column in COLUMNS]
        return (StatTable("values", about, columns, rows, notes, total=total),)

    def _title(self, key: int) -> str | None:
        """Return what people call a device: ESCs and power units have numbers of their own."""
        code = key & _NOBODY
        who = None if code == _NOBODY else list(self._whose.values())[code >> _NUMBER_BITS]
        return None if who is None else f"{who.title} {code & _MOST_NUMBER}"

    def _devices(self, batch: Batch, rows: Array, count: int) -> Array:
        """Return the device of each value, the place of its table and its number in one; `_NOBODY` of none.

        Args:
            batch: the batch.
            rows: the transfer of each value.
            count: of transfers.
        """
        found = np.full(count, _NOBODY, np.int64)
        for place, (table, who) in enumerate(self._whose.items()):
            told = batch.messages.get(table)
            if told is None or not who.column or who.column not in told.schema.names:
                continue
            column = told.column(who.column)
            of = (numbers(told.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
            number = np.nan_to_num(numbers(column)).astype(np.int64) + who.first
            number = np.where(valid(column), place << _NUMBER_BITS | np.clip(number, 0, _MOST_NUMBER), _NOBODY)
            if len(self._whose) == 1 and np.array_equal(of, rows):
                return number  # a value a row
            found[of] = number
            found[of[found[of] != number]] = _NOBODY  # its packets are of several devices
        return found[rows]
