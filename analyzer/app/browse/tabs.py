"""The tabs of the browser, as lines with the place that each leads to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.browser.supply import TabLine
from analyzer.report.triage.text import render
from analyzer.views.stats.text import StatText
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.verdict.model import Triage
    from analyzer.report.model import Finding, Report
    from analyzer.stats.table import StatTable

_STYLES = {"error": "bad", "warning": "warn", "note": "dim"}
_SHORT = {"warning": "warn"}
_WIDTH = 200  # columns that are written; narrower terminals cut them
_NARROW = 78  # columns of text that fit beside the edge of the narrowest terminal
_YEAR_2000 = 946_684_800 * SECOND
# Columns of statistics that are conditions on rows: what each asks for.
_ASKS = {
    "node": "dronecan.src == {}", "client": "node == {}", "server": "node == {}", "bus": 'frame.interface_name == "{}"',
}  # fmt: skip


def moment(t: int | None, start: int | None) -> str:
    """Return a time of day, or seconds from the first frame for one without a date."""
    if t is None:
        return "-"
    if t >= _YEAR_2000:
        return TimeFormat("a", digits=6).text(t)[:-3]
    return f"{(t - (start or 0)) / SECOND:.3f} s"


def finding_lines(report: Report, start: int | None) -> list[TabLine]:
    """Return the findings, the worst first, each with its first frame."""
    if not report.findings:
        return [TabLine("nothing is found: every rule that could be judged has passed", "good")]
    return [finding_line(one, start) for one in report.findings]


def finding_line(one: Finding, start: int | None) -> TabLine:
    """Return a finding with its first frame."""
    return TabLine(_finding(one, start), _STYLES[one.severity], _frame(one), one.first.t_ns, _rule_filter(one))


def _finding(one: Finding, start: int | None) -> str:
    who = one.label or ("" if one.node is None else f"node {one.node}") or one.bus
    often, at = f"{one.count}x", moment(one.first.t_ns, start)
    grade = _SHORT.get(one.severity, one.severity)
    said = f"{one.title}: {one.text}" + (f"  {one.type}" if one.type and one.type not in one.text else "")
    return escape(f"{grade:<5} {one.rule:<8} {who:<9} {at:<12} {often:>6}  {said}")


def _frame(one: Finding) -> int | None:
    return None if one.first.frame is None else one.first.frame - 1


def _rule_filter(one: Finding) -> str:
    found = f'finding.rule == "{one.rule}"'
    return found if one.node is None else f"{found} && node == {one.node}"


def flight_lines(table: StatTable, start: int | None) -> list[TabLine]:
    """Return the flights, each with its first frame."""
    rows = table.records()
    if not rows:
        return [TabLine("no flight: motors never turned for long enough", "dim"), *_notes(table)]
    return [*(_flight(one, start) for one in rows), *_notes(table)]


def _flight(one: Any, start: int | None) -> TabLine:
    seconds = "" if one["duration_s"] is None else f"{one['duration_s']:.1f} s"
    span = f"{moment(one['t_ns'], start)} to {moment(one['t_end_ns'], start)}"
    chosen = ""
    if one["t_ns"] is not None and one["t_end_ns"] is not None:
        low, high = one["t_ns"] / SECOND, one["t_end_ns"] / SECOND
        chosen = f"frame.time_epoch >= {low:.9f} && frame.time_epoch <= {high:.9f}"
    text = f"flight {one['flight']}  {span}  {seconds:>9}  {one['end']:<6} ch {one['chs']}  by {one['by']}"
    return TabLine(escape(text), "head", _place(one["frame"]), one["t_ns"], chosen)


def triage_lines(found: Triage) -> list[TabLine]:
    """Return the screen of `triage`; lines with a time lead to where it broke first."""
    frame = getattr(found.first, "frame", None)
    t = getattr(found.first, "t_end", None)
    return [TabLine(line, "", frame, t) for line in render(found, width=_NARROW).splitlines()]


def statistic_lines(
    tables: Sequence[StatTable], start: int | None, end: int | None, buses: int
) -> list[TabLine]:  # fmt: skip
    """Return statistics; a row leads to its first time, and stands for the filter that its columns make."""
    return [line for table in tables for line in _table(table, start, end, buses)]


def _table(table: StatTable, start: int | None, end: int | None, buses: int) -> Iterator[TabLine]:
    writer = StatText(_WIDTH, start, end, timed=start is not None)
    shown = list(range(len(table.rows)) if table.shown is None else table.shown)
    # One row a line, so that each line knows its row.
    whole = replace(table, notes=(), shown=shown, gaps="")
    lines = list(writer.table(whole, buses=buses))
    above = len(lines) - len(shown) - (table.total is not None)
    for k, line in enumerate(lines):
        row = k - above
        if not 0 <= row < len(shown) or above < 0:
            yield TabLine(escape(line), "head" if k < above else "bold")
            continue
        record = dict(zip([c.name for c in table.columns], table.rows[shown[row]], strict=True))
        yield TabLine(escape(line), "", _place(record.get("frame")), _time(record), _filter(record, buses))
    yield from _notes(table)
    yield TabLine("")


def _notes(table: StatTable) -> Iterator[TabLine]:
    return (TabLine(f"  {escape(note)}", "dim") for note in table.notes)


def _place(number: Any) -> int | None:
    """Return the place of a frame, from 0, by its number in a table, from 1."""
    return number - 1 if isinstance(number, int) else None


def _time(record: dict[str, Any]) -> int | None:
    names = ("t_end_ns", "t_ns", "start_ns", "worst_ns", "first_ns")
    return next((record[name] for name in names if isinstance(record.get(name), int)), None)


def _filter(record: dict[str, Any], buses: int) -> str:
    names = [name for name in _ASKS if name != "bus" or buses > 1]
    asked = [_ASKS[name].format(record[name]) for name in names if record.get(name) not in (None, "", "-")]
    if "rule" in record:
        asked.insert(0, f'finding.rule == "{record["rule"]}"')
    kind = record.get("type")
    if isinstance(kind, str) and kind and kind[0].isupper() and kind.replace(".", "").replace("_", "").isalnum():
        asked.append(kind)
    return " && ".join(asked)
