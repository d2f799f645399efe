"""Interfaces and nodes as tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.terminal.figures import age, amount, bits, duration, rate, span
from analyzer.terminal.sheet import Cell, Column, Sheet, Style, said

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.board.snapshot import BusRow, NodeRow, Snapshot

BUSY, FULL = 70.0, 90.0  # percent of the bit rate that are worth a colour
_CONTROLLER: dict[str, Style] = {"error-warning": "warn", "error-passive": "bad", "bus-off": "alarm"}
_HEALTH: dict[str, Style] = {"ok": "good", "warning": "warn", "error": "bad", "critical": "alarm"}
_OPERATIONAL = "operational"

_BUSES = (
    Column("Bus", right=False, rank=0, least=5),
    Column("frames/s", rank=0),
    Column("load", rank=0, least=6),
    Column("of", right=False, rank=2, sortable=False),
    Column("dropped", rank=0, long="dropped by kernel"),
    Column("by us", rank=1, long="dropped by us"),
    Column("errors", rank=1),
    Column("tx/rx", rank=2, least=5, sortable=False),
    Column("controller", rank=1, right=False, least=12),
    Column("received", rank=4),
    Column("link", right=False, rank=3, grow=True, least=8, sortable=False),
)
_NODES = (
    Column("Node", rank=0, least=5),
    Column("bus", right=False, rank=2),
    Column("name", right=False, rank=1, grow=True, least=14),
    Column("health", right=False, rank=0, least=8),
    Column("mode", right=False, rank=1, least=11),
    Column("uptime", rank=3, least=7),
    Column("fr/s", rank=2, least=5, long="frames/s"),
    Column("tr/s", rank=4, least=5, long="transfers/s"),
    Column("age", rank=1, least=5),
    Column("gap", rank=5, least=5, long="worst gap"),
    Column("err", rank=1, long="errors"),
    Column("warn", rank=2, long="warnings"),
    Column("note", rank=7, long="notes"),
    Column("rst", rank=6, long="restarts"),
    Column("open", rank=6, long="timed out"),
)


def buses(snapshot: Snapshot) -> Sheet:
    """Every interface: how full, what was lost, what its controller says."""
    return Sheet(_BUSES, tuple(tuple(_bus(row)) for row in snapshot.buses), empty="no interface yet")


def _bus(row: BusRow) -> Iterator[Cell]:
    yield said(row.name, "bold")
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
    yield said(row.note)


def nodes(snapshot: Snapshot) -> Sheet:
    """Every node: what it calls itself, how it is, how much it sends."""
    several = len(snapshot.buses) > 1
    places = [k for k, column in enumerate(_NODES) if several or column.head != "bus"]
    rows = (tuple(_node(row)) for row in snapshot.nodes)
    picked = tuple(tuple(row[k] for k in places) for row in rows)
    return Sheet(tuple(_NODES[k] for k in places), picked, empty="none heard yet")


def _node(row: NodeRow) -> Iterator[Cell]:
    faint: Style = "dim" if row.stale else ""
    wrong: Style = "bad" if row.found.errors else "warn" if row.found.warnings else faint
    yield Cell(str(row.node), wrong or "bold", row.node)
    yield said(row.bus, faint)
    yield said(row.name or "-", faint)
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
