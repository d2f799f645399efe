"""The devices of one kind as a table: a row each, what they measure, what they say, how long ago."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from analyzer.terminal.figures import age, number, span
from analyzer.terminal.sheet import Cell, Style, TableColumn, TextTable, text_cell

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.board.snapshot import DeviceReading, DeviceRow, DeviceTable, Head, Snapshot

Shown = Literal["now", "min", "max"]
SHOWN: tuple[Shown, ...] = ("now", "min", "max")
_ROLE = 3  # letters of a role in a head
_LEAST = 5
_FIRST = 6  # columns of quantities that matter more than others


def devices(snapshot: Snapshot, kind: int, shown: Shown) -> TextTable:
    """Return the devices of the kind with this number (there may be fewer), with values now or since the mark."""
    if not snapshot.devices:
        return TextTable(
            (TableColumn("Devices", right=False, grow=True, least=10, sortable=False),), empty="none heard yet"
        )
    table = snapshot.devices[kind % len(snapshot.devices)]
    several = len({row.bus for row in table.rows}) > 1
    name = table.title if shown == "now" else f"{table.title} {shown}"
    columns = [TableColumn(name, right=False, rank=0, least=4)]
    if several:
        columns.append(TableColumn("bus", right=False, rank=2))
    for place, head in enumerate(table.heads):
        columns += _columns(head, table, shown, rank=2 if place >= _FIRST or head.role == "commanded" else 1)
    columns += [
        TableColumn("state", right=False, least=9, rank=0),
        TableColumn("flags", right=False, grow=True, least=9, most=24, rank=0),
        TableColumn("age", rank=0, least=5),
        TableColumn("gap", rank=3, least=5, long="worst gap"),
        TableColumn("node", rank=4),
    ]
    return TextTable(tuple(columns), tuple(tuple(_row(row, table, several, shown)) for row in table.rows))


def _columns(head: Head, table: DeviceTable, shown: Shown, rank: int) -> Iterator[TableColumn]:
    alone = sum(one.unit == head.unit for one in table.heads) == 1
    unit = head.unit or head.title
    name = unit if alone else f"{unit} {head.role[:_ROLE] or head.title[:_ROLE]}"
    full = f"{head.title} {head.role}".strip()
    yield TableColumn(name, least=_LEAST, rank=rank, long=f"{full} {head.unit}".strip())
    if shown == "now":
        yield TableColumn(f"{name} range", rank=6, least=len("-1000..1000"), long="min..max", sortable=False)


def _row(row: DeviceRow, table: DeviceTable, several: bool, shown: Shown) -> Iterator[Cell]:
    faint: Style = "dim" if row.stale else ""
    wrong: Style = "bad" if row.found.errors or row.flags else "warn" if row.found.warnings else faint
    yield text_cell(row.label, wrong or "bold", value=row.number)
    if several:
        yield text_cell(row.bus, faint)
    for head in table.heads:
        reading = row.readings.get((head.quantity, head.role))
        value = None if reading is None else {"now": reading.last, "min": reading.low, "max": reading.high}[shown]
        yield Cell(number(value, whole=head.whole), faint, value)
        if shown == "now":
            yield Cell(_range(reading, whole=head.whole), "dim")
    silent = row.age is None
    state = "only commanded" if silent else ", ".join(row.states)
    yield text_cell(state, "warn" if silent else faint)
    yield text_cell(", ".join(row.flags), "bad")
    yield Cell(age(row.age), "bad" if row.stale else "", row.age)
    yield Cell(span(row.gap), faint, row.gap)
    yield Cell(str(row.node) if row.node else "-", faint, row.node)


def _range(reading: DeviceReading | None, *, whole: bool) -> str:
    if reading is None or reading.low is None:
        return "-"
    return f"{number(reading.low, whole=whole)}..{number(reading.high, whole=whole)}"
