"""Interfaces and nodes as tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.terminal.figures import age, amount, bits, duration, rate, span
from analyzer.terminal.sheet import Cell, Style, TableColumn, TextTable, text_cell

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.board.snapshot import BusRow, NodeRow, Snapshot

BUSY, FULL = 70.0, 90.0  # percent of the bit rate that are worth a colour
_CONTROLLER: dict[str, Style] = {"error-warning": "warn", "error-passive": "bad", "bus-off": "alarm"}
_HEALTH: dict[str, Style] = {"ok": "good", "warning": "warn", "error": "bad", "critical": "alarm"}
_OPERATIONAL = "operational"

_BUSES = (
    TableColumn("Bus", right=False, rank=0, least=5),
    TableColumn("frames/s", rank=0),
    TableColumn("load", rank=0, least=6),
    TableColumn("of", right=False, rank=2, sortable=False),
    TableColumn("dropped", rank=0, long="dropped by kernel"),
    TableColumn("by us", rank=1, long="dropped by us"),
    TableColumn("errors", rank=1),
    TableColumn("tx/rx", rank=2, least=5, sortable=False),
    TableColumn("controller", rank=1, right=False, least=12),
    TableColumn("received", rank=4),
    TableColumn("link", right=False, rank=3, grow=True, least=8, sortable=False),
)
_NODES = (
    TableColumn("Node", rank=0, least=5),
    TableColumn("bus", right=False, rank=2),
    TableColumn("name", right=False, rank=1, grow=True, least=14),
    TableColumn("health", right=False, rank=0, least=8),
    TableColumn("mode", right=False, rank=1, least=11),
    TableColumn("uptime", rank=3, least=7),
    TableColumn("fr/s", rank=2, least=5, long="frames/s"),
    TableColumn("tr/s", rank=4, least=5, long="transfers/s"),
    TableColumn("age", rank=1, least=5),
    TableColumn("gap", rank=5, least=5, long="worst gap"),
    TableColumn("err", rank=1, long="errors"),
    TableColumn("warn", rank=2, long="warnings"),
    TableColumn("note", rank=7, long="notes"),
    TableColumn("rst", rank=6, long="restarts"),
    TableColumn("open", rank=6, long="timed out"),
)


def buses(snapshot: Snapshot) -> TextTable:
    """Return every interface: how full, what was lost, what its controller says."""
    return TextTable(_BUSES, tuple(tuple(_bus(row)) for row in snapshot.buses), empty="no interface yet")


def _bus(row: BusRow) -> Iterator[Cell]:
    yield text_cell(row.name, "bold")
    yield Cell("silent" if row.silent else rate(row.frames), "warn" if row.silent else "", row.frames)
    busy: Style = "bad" if row.load >= FULL else "warn" if row.load >= BUSY else ""
    yield Cell(f"{row.load:.1f}%", busy, row.load)
    yield Cell(f"{bits(row.bit_rate)}bit/s{'?' if row.assumed else ''}", "dim")
    for lost in (row.dropped, row.here):
        yield Cell(amount(lost), "alarm" if lost else "", lost)
    yield Cell(amount(row.error_frames), "bad" if row.error_frames else "", row.error_frames)
    counters = [("-" if count is None else str(count)) for count in (row.tx_errors, row.rx_errors)]
    yield Cell("/".join(counters) if counters != ["-", "-"] else "-")
    yield Cell(row.controller or "-", _CONTROLLER.get(row.controller, ""), row.controller)
    yield Cell(amount(row.received), "", row.received)
    yield text_cell(row.note)


def nodes(snapshot: Snapshot) -> TextTable:
    """Return every node: what it calls itself, how it is, how much it sends."""
    several = len(snapshot.buses) > 1
    places = [k for k, column in enumerate(_NODES) if several or column.head != "bus"]
    rows = (tuple(_node(row)) for row in snapshot.nodes)
    picked = tuple(tuple(row[k] for k in places) for row in rows)
    return TextTable(tuple(_NODES[k] for k in places), picked, empty="none heard yet")


def _node(row: NodeRow) -> Iterator[Cell]:
    faint: Style = "dim" if row.stale else ""
    wrong: Style = "bad" if row.found.errors else "warn" if row.found.warnings else faint
    yield Cell(str(row.node), wrong or "bold", row.node)
    yield text_cell(row.bus, faint)
    yield text_cell(row.name or "-", faint)
    yield Cell(row.health or "-", faint or _HEALTH.get(row.health, ""), row.health)
    usual = row.mode in ("", _OPERATIONAL)
    yield Cell(row.mode or "-", faint if usual or row.stale else "warn", row.mode)
    yield Cell(duration(row.uptime), faint, row.uptime)
    yield Cell(rate(row.frames), faint, row.frames)
    yield Cell(rate(row.transfers), faint, row.transfers)
    yield Cell(age(row.age), "bad" if row.stale else "", row.age)
    yield Cell(span(row.gap), faint, row.gap)
    found = row.found
    counts: tuple[tuple[int, Style], ...] = (
        (found.errors, "bad"),
        (found.warnings, "warn"),
        (found.notes, ""),
        (row.restarts, "warn"),
        (row.overdue, "warn"),
    )
    for count, style in counts:
        yield Cell(amount(count) if count else "", style, count)
