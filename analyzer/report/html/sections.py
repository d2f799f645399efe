"""Words and tables of the HTML report, taken from the report's data."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from analyzer.report import wording
from analyzer.report.html.evidence import frame_line
from analyzer.report.model import CATEGORIES, SEVERITIES
from analyzer.report.moments import MISSING
from analyzer.report.problems import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.report.html.evidence import FrameLine
    from analyzer.report.model import CaptureSummary, Coverage, Finding

ROWS = 500  # of a table that a capture can make as long as it likes
_DEEPEST = 2


def tally(found: Sequence[Problem]) -> list[tuple[str, list[int]]]:
    """Return rows by category, columns by severity."""
    counts = Counter((one.head.category, one.severity) for one in found)
    return [(category, [counts[category, severity] for severity in SEVERITIES]) for category in CATEGORIES]


def who(finding: Finding) -> str:
    """Say whom a finding is about, the way people call it: `ch6 node 25 ESCStatus`."""
    words = [finding.label, "" if finding.node is None else f"node {finding.node}"]
    if not any(words):
        words.append(finding.bus)
    key = "" if finding.key == f"cause={finding.cause}" else finding.key  # a cause has a place of its own
    return " ".join(word for word in (*words, finding.type, key) if word)


def capture_facts(capture: CaptureSummary) -> dict[str, Any]:
    """Return one capture with its sums."""
    length = (capture.end_ns or 0) - (capture.start_ns or 0) if wording.timed(capture) else None
    return {
        "of": capture,
        "length": MISSING if length is None else wording.length(length),
        "sums": [_balance("lines", capture.accounting), _balance("frames", capture.verdicts, capture.frames)],
        "dialects": [
            (node, statement) for node, of in list(capture.dialects.items())[:ROWS] for statement in of.items()
        ][:ROWS],
    }


def _balance(unit: str, terms: Mapping[str, int], total: int | None = None) -> dict[str, Any]:
    """Return a sum that must come out: its total is the term called like the unit, unless it is given."""
    parts = {name: count for name, count in terms.items() if name != unit or total is not None}
    said = terms.get(unit, sum(parts.values())) if total is None else total
    listed = [(name, count) for k, (name, count) in enumerate(parts.items()) if count or not k]
    return {"unit": unit, "total": said, "terms": listed, "balanced": said == sum(parts.values())}


def commands(finding: Finding, capture: CaptureSummary | None) -> list[str]:
    """Return what to type to see more of a finding."""
    return [wording.command(Problem((finding,)), capture), f"tailbyte explain {finding.rule}"]


def examples(finding: Finding, room: int) -> Iterator[tuple[Any, list[FrameLine]]]:
    """Give the examples of a finding with the lines of their frames, `room` lines together; the first one always."""
    dronecan = finding.node is not None or bool(finding.type)  # else it may be about foreign traffic
    for k, example in enumerate(finding.examples):
        lines = example.lines[: max(room, 0)]
        if k and not lines:
            return
        room -= len(example.lines)
        yield example, [frame_line(line, dronecan=dronecan) for line in lines]


def coverage(seen: Coverage) -> dict[str, Any]:
    """Return what was exercised, each list with a headline."""
    values = [(field, name, count) for field, counts in seen.values.items() for name, count in counts.items()]
    return {
        "counted": [
            ("Types", _used(seen.types), _bounded(seen.types.items())),
            ("Packets", _used(seen.packets), _bounded(seen.packets.items())),
        ],
        "values": (f"{sum(1 for *_, count in values if count)} of {len(values)}", values[:ROWS]),
        "fields": list(dict.fromkeys(field for field, *_ in values[:ROWS])),
        "clauses": (Counter(seen.clauses.values()), _bounded(seen.clauses.items())),
        "never": seen.never[:ROWS],
    }


def _used(counts: Mapping[str, int]) -> str:
    return f"{sum(1 for count in counts.values() if count)} of {len(counts)}"


def settings(values: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return settings as rows (of what, name, value): plain ones first, then the numbers of each rule."""
    return sorted(_rows(values, ()), key=lambda row: row[0] != "")[: 4 * ROWS]


def _rows(values: Mapping[str, Any], scope: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    for name, value in values.items():
        if isinstance(value, dict) and value and len(scope) < _DEEPEST:
            yield from _rows(value, (*scope, str(name)))
        else:
            yield " ".join(scope), str(name), wording.setting(value)


def _bounded(rows: Iterable[tuple[str, Any]]) -> list[tuple[str, Any]]:
    return list(rows)[:ROWS]
