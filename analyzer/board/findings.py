"""Findings as the rules report them while a bus runs: one row for what one node does wrong again and again."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.board.snapshot import FindingRow, Tally

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.board.latches import Latches
    from analyzer.report.newest import Change
    from dissectors.kit import Severity

MOST_FINDINGS = 512
_FIELDS = {"error": 0, "warning": 1, "note": 2}


class _Key(NamedTuple):
    rule: str
    severity: Severity
    bus: str
    node: int
    type: str


class FindingRows:
    """The newest `MOST_FINDINGS` kinds, and how many there were of each severity.

    Args:
        latches: told of each of them.
    """

    def __init__(self, latches: Latches) -> None:
        self._latches = latches
        self._rows: dict[_Key, FindingRow] = {}
        self._all = [0, 0, 0]
        self.by_node: dict[tuple[int, int], Tally] = {}

    def feed(self, changes: Iterable[Change], buses: tuple[str, ...], now_ns: int) -> None:
        """Take what is new; interfaces go by their names, what has no time is of `now_ns`."""
        for change in changes:
            one = change.finding
            bus, node = (one.bus if one.bus in buses else ""), (-1 if one.node is None else one.node)
            t = now_ns if one.last.t_ns is None else one.last.t_ns
            text = f"{one.title}: {one.text}"
            key = _Key(one.rule, one.severity, bus, node, one.type)
            old = self._rows.pop(key, None)
            if old is None and len(self._rows) >= MOST_FINDINGS:
                del self._rows[next(iter(self._rows))]
            self._rows[key] = FindingRow(
                one.rule, one.severity, one.category, bus, node, one.type, text,
                first=old.first if old else t, last=t, count=change.more + (old.count if old else 0),
            )  # fmt: skip
            if change.fresh:
                self._count(one.severity, (buses.index(bus) if bus else -1, node))
            subject = f"{bus} node {node}" if node >= 0 else bus
            self._latches.put("finding", key, subject, f"{one.severity} {one.rule} {text}", t, count=change.more)

    def _count(self, severity: Severity, place: tuple[int, int]) -> None:
        self._all[_FIELDS[severity]] += 1
        if place[1] >= 0 and (place in self.by_node or len(self.by_node) < MOST_FINDINGS):
            known = self.by_node.get(place, Tally())
            more = [known.errors, known.warnings, known.notes]
            more[_FIELDS[severity]] += 1
            self.by_node[place] = Tally(*more)

    @property
    def tally(self) -> Tally:
        """All there were."""
        return Tally(*self._all)

    def mark(self) -> None:
        """Begin anew: nodes have done nothing wrong yet."""
        self.by_node.clear()

    def clear(self) -> None:
        """Show none any more; they remain counted."""
        self._rows.clear()

    def rows(self) -> Iterator[FindingRow]:
        """Give the findings, the newest first."""
        return reversed(self._rows.values())
