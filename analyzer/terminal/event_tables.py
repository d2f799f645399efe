"""Findings, and what happened since the mark, as tables: the newest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.terminal.figures import amount, clock, span
from analyzer.terminal.sheet import Cell, Style, TableColumn, TextTable, text_cell

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.board.snapshot import FindingRow, Latched, Snapshot, Tally

SEVERITIES: dict[str, Style] = {"error": "bad", "warning": "warn", "note": ""}
_KINDS: dict[str, Style] = {"drop": "alarm", "error": "bad", "flag": "bad", "restart": "warn", "silence": "warn"}
# In the order of their weight.
_NAMES = {
    "drop": ("loss", "losses"), "error": ("error frame", "error frames"), "restart": ("restart", "restarts"),
    "flag": ("flag set", "flags set"), "silence": ("silence", "silences"), "note": ("note", "notes"),
    "finding": ("finding", "findings"),
}  # fmt: skip


_FINDINGS = (
    TableColumn("last", right=False, rank=0, least=8, sortable=False),
    TableColumn("severity", right=False, rank=3, least=7, sortable=False),
    TableColumn("rule", right=False, rank=0, least=7, sortable=False),
    TableColumn("where", right=False, rank=1, least=7, sortable=False),
    TableColumn("count", rank=2, least=4, sortable=False),
    TableColumn("text", right=False, rank=0, grow=True, least=20, sortable=False),
    TableColumn("type", right=False, rank=4, sortable=False),
)
_LATCHED = (
    TableColumn("first", right=False, rank=0, least=8, sortable=False),
    TableColumn("last", right=False, rank=2, least=8, sortable=False),
    TableColumn("kind", right=False, rank=3, least=7, sortable=False),
    TableColumn("who", right=False, rank=0, least=7, sortable=False),
    TableColumn("count", rank=1, least=4, sortable=False),
    TableColumn("text", right=False, rank=0, grow=True, least=20, sortable=False),
)


def findings(snapshot: Snapshot) -> TextTable:
    """Return what the rules found."""
    rows = tuple(tuple(_finding(row, snapshot)) for row in snapshot.findings)
    return TextTable(_FINDINGS, rows, empty="nothing to show", title=f"Findings: {_tally(snapshot.found)}")


def _finding(row: FindingRow, snapshot: Snapshot) -> Iterator[Cell]:
    style = SEVERITIES[row.severity]
    yield Cell(clock(row.last), "", row.last)
    yield Cell(row.severity, style)
    yield text_cell(row.rule, style)
    where = [row.bus] if len(snapshot.buses) > 1 or row.node < 0 else []
    yield text_cell(" ".join([*where, *([f"node {row.node}"] if row.node >= 0 else [])]), value=row.node)
    yield Cell(f"{amount(row.count)}x", "", row.count)
    yield text_cell(row.text)
    yield text_cell(row.type, "dim")


def _tally(found: Tally) -> str:
    return ", ".join(
        f"{count} {word}{'' if count == 1 else 's'}"
        for count, word in ((found.errors, "error"), (found.warnings, "warning"), (found.notes, "note"))
    )


def latched(snapshot: Snapshot) -> TextTable:
    """Return what happened since the mark; findings, which have a table of their own, come last."""
    ordered = sorted(snapshot.latched, key=lambda one: one.kind == "finding")
    return TextTable(
        _LATCHED, tuple(tuple(_latched(row)) for row in ordered), empty="nothing to show", title=_since(snapshot)
    )


def _latched(row: Latched) -> Iterator[Cell]:
    style = _KINDS.get(row.kind, "")
    yield Cell(clock(row.first), "", row.first)
    yield Cell("now" if row.now else clock(row.last), "bold" if row.now else "", row.last)
    yield Cell(row.kind, style)
    yield text_cell(row.subject)
    yield Cell(f"{amount(row.count)}x", "", row.count)
    yield text_cell(row.text, style)


def _since(snapshot: Snapshot) -> str:
    """Return the mark, and how often what happened since then."""
    sums: dict[str, int] = {}
    for one in snapshot.latched:
        sums[one.kind] = sums.get(one.kind, 0) + one.count
    parts = [f"{amount(sums[kind])} {names[sums[kind] != 1]}" for kind, names in _NAMES.items() if kind in sums]
    if snapshot.beyond:
        parts.append(f"{amount(snapshot.beyond)} more than there is room for")
    mark = f"mark {snapshot.marks}" if snapshot.marks else "the start"
    return f"Since {mark}, {span(max(0, snapshot.now - snapshot.since))} ago: {', '.join(parts) or 'nothing'}"
