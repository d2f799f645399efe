"""Parameters with another value, of nodes that reported them in both captures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.names import short

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Difference
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.parameters import ToldParameter
    from analyzer.report.comparison.traits import MeasuredSide


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them: last values, where at least one capture never had that of the other.

    What changed only after as long as the other capture lasts is no difference: that one ends before.
    """
    for there, name, mine, theirs in _both(pair):
        old, new = theirs.last in mine.values, mine.last in theirs.values
        if mine.last == theirs.last or (old and new):
            continue
        changed = mine if old else theirs if new else None
        t = None if changed is None else changed.values[changed.last]
        if t is not None and _beyond(*((pair.good, pair.bad) if old else (pair.bad, pair.good)), t):
            continue
        one = pair.of_node(
            there, kind="parameter", weight="note" if old else "warning", what=name, good=mine.last,
            bad=theirs.last, support="well supported", good_count=mine.reports, bad_count=theirs.reports,
            since="from" if new else "throughout", t_ns=t if new else None,
            remark="changed while the first capture ran" if old else "",
        )  # fmt: skip
        yield pair.placed(one)


def compared(pair: Pair) -> int:
    """Return how many parameters both captures tell."""
    return sum(1 for _ in _both(pair))


def _both(pair: Pair) -> Iterator[tuple[Node, str, ToldParameter, ToldParameter]]:
    theirs = pair.bad.traits.parameters.all
    for (bus, node, table, name), mine in pair.good.traits.parameters.all.items():
        there = pair.matching.nodes.get((bus, node))
        told = theirs.get((*there, table, name)) if there is not None else None
        if there is not None and told is not None:
            yield there, f"{short(table)}.{name}" if table else name, mine, told


def _beyond(side: MeasuredSide, other: MeasuredSide, t: int) -> bool:
    """Return whether the other capture had ended after as long a time as `t` is in this one."""
    start, end = other.start, other.end
    return None not in (start, end, side.start) and t - (side.start or 0) > (end or 0) - (start or 0)
