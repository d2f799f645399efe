"""`findings`: what `check` finds, a row a rule."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import FoundBreach, StatEnd

COLUMNS = (
    StatColumn("rule", "Rule", "text"),
    StatColumn("severity", "Severity", "text"),
    StatColumn("category", "Category", "text", rank=4),
    StatColumn("title", "Title", "text"),
    StatColumn("findings", "Findings", rank=3),
    StatColumn("count", "Times", bar=True),
    StatColumn("who", "Who", "text"),
    StatColumn("first_ns", "First", "time", rank=2),
    StatColumn("last_ns", "Last", "time", rank=3),
)


class FindingTable(Statistic):
    """Counts the findings of a report, in its order: the worst first."""

    judges = True

    def __init__(self, order: StatOrder) -> None:
        self._filtered = order.filtered

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the rules that are broken."""
        by_rule: dict[str, list[FoundBreach]] = {}
        for finding in end.findings:
            by_rule.setdefault(finding.rule, []).append(finding)
        rows = [_row(some) for some in by_rule.values()]
        total = ("all", None, None, None, len(end.findings), sum(one.count for one in end.findings), *[None] * 3)
        notes = ["everything is judged; these name a frame that matches"] * self._filtered
        return (StatTable("findings", "what check finds, worst first", COLUMNS, rows, notes, total=total),)


def _row(some: Sequence[FoundBreach]) -> tuple[object, ...]:
    head = some[0]
    first = min((one.first for one in some if one.first is not None), default=None)
    last = max((one.last for one in some if one.last is not None), default=None)
    who = ", ".join(dict.fromkeys(one.who for one in some if one.who))
    count = sum(one.count for one in some)
    return head.rule, head.severity, head.category, head.title, len(some), count, who, first, last
