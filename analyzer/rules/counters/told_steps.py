"""Which steps a cause explains, and those that nothing explains, told together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.counters.id_steps import COPIED, GAP, IS_COPY, IS_GAP, IS_RESTART, RESTARTED, RULES, of_message
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.rules.counters.id_steps import IdSteps, MovedStep
    from dissectors.kit import Array, Occurrence, Severity

SHARED_ID = "BUS-010"


def told(of: tuple[int, int], steps: IdSteps, rows: Array, moved: Mapping[int, MovedStep]) -> Iterator[Occurrences]:
    """Yield steps of a node, put together by rule, severity and cause.

    Args:
        of: bus and node.
        steps: steps of the node.
        rows: those of them that are told.
        moved: what is told of some of them instead, as only their order changed.
    """
    rule = steps.rule[rows]
    gap = rule == IS_GAP
    apart = rule * 4 + (gap & (steps.late[rows] | steps.early[rows])) * 2 + (gap & steps.astray[rows])
    if moved:
        also = np.isin(rows, list(moved))
        noted = [moved[k].noted for k in rows[also].tolist()]
        apart[also] = -1 - np.array(noted, np.int64)
    for one in dict.fromkeys(apart.tolist()):
        mine = rows[apart == one]
        if one < 0:
            yield _together(of, steps, mine, (GAP, "note" if one < -1 else None), [moved[k] for k in mine.tolist()])
        else:
            yield _together(of, steps, mine, (RULES[one // 4], "note" if one & 2 else None), [])


def _together(
    of: tuple[int, int], steps: IdSteps, rows: Array, what: tuple[str, Severity | None], others: list[MovedStep]
) -> Occurrences:
    ours = steps.take(rows).compact()
    rule, severity = what
    return Occurrences(
        rule=rule,
        t=ours.t,
        bus=np.full(len(rows), of[0]),
        node=np.full(len(rows), of[1]),
        type=ours.code,
        frame=ours.lead,
        values=lambda k: others[k].values if others else ours.values(k),
        frames=lambda k: others[k].frames if others else ours.frames(k),
        severity=severity,
        drops=rule != COPIED,
        since=ours.since,
    )


def explained(cause: Occurrence, steps: IdSteps, begin: int, end: int) -> Array:
    """Return which steps a cause explains.

    Several devices explain every breach of a node, a shared counter those of its messages that are no copies.
    """
    rule = steps.rule[begin:end]
    if cause.rule == SHARED_ID:
        return np.ones(len(rule), bool)
    if cause.rule == RESTARTED:
        same: Array = (rule == IS_RESTART) & (steps.before[begin:end] + 1 == cause.values["expected"])
        return same
    ours: Array = of_message(steps.place[begin:end]) & (rule != IS_COPY)
    return ours
