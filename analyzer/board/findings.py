"""Findings as the rules report them while a bus runs: one row for what one node does wrong again and again."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

from analyzer.board.snapshot import FindingRow, Tally

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.board.latches import Latches
    from dissectors.conformance import Severity

MOST_FINDINGS = 512
_FIELDS = {"error": 0, "warning": 1, "note": 2}


class News(Protocol):
    """A finding that is new, or has come up again.

    `bus` and `node` are -1 for none, `t` is its latest time, `count` what is new of it; `fresh` says that it is new.
    """

    @property
    def rule(self) -> str: ...  # noqa: D102 - the table of findings says what they are
    @property
    def severity(self) -> Severity: ...  # noqa: D102
    @property
    def category(self) -> str: ...  # noqa: D102
    @property
    def bus(self) -> int: ...  # noqa: D102
    @property
    def node(self) -> int: ...  # noqa: D102
    @property
    def type(self) -> str: ...  # noqa: D102
    @property
    def text(self) -> str: ...  # noqa: D102
    @property
    def t(self) -> int: ...  # noqa: D102
    @property
    def count(self) -> int: ...  # noqa: D102
    @property
    def fresh(self) -> bool: ...  # noqa: D102


class _Key(NamedTuple):
    rule: str
    severity: Severity
    bus: int
    node: int
    type: str


class Findings:
    """The newest `MOST_FINDINGS` kinds, and how many there were of each severity.

    Args:
        latches: told of each of them.
    """

    def __init__(self, latches: Latches) -> None:
        self._latches = latches
        self._rows: dict[_Key, FindingRow] = {}
        self._all = [0, 0, 0]
        self.by_node: dict[tuple[int, int], Tally] = {}

    def add(self, news: Iterable[News], buses: tuple[str, ...]) -> None:
        """What is new; interfaces go by their names."""
        for one in news:
            key = _Key(one.rule, one.severity, one.bus, one.node, one.type)
            bus = buses[one.bus] if 0 <= one.bus < len(buses) else ""
            old = self._rows.pop(key, None)
            if old is None and len(self._rows) >= MOST_FINDINGS:
                del self._rows[next(iter(self._rows))]
            self._rows[key] = FindingRow(
                one.rule, one.severity, one.category, bus, one.node, one.type, one.text,
                first=old.first if old else one.t, last=one.t, count=one.count + (old.count if old else 0),
            )  # fmt: skip
            if one.fresh:
                self._count(one)
            subject = f"{bus} node {one.node}" if one.node >= 0 else bus
            text = f"{one.severity} {one.rule} {one.text}"
            self._latches.put("finding", key, subject, text, one.t, count=one.count)

    def _count(self, one: News) -> None:
        self._all[_FIELDS[one.severity]] += 1
        place = one.bus, one.node
        if one.node >= 0 and (place in self.by_node or len(self.by_node) < MOST_FINDINGS):
            known = self.by_node.get(place, Tally())
            more = [known.errors, known.warnings, known.notes]
            more[_FIELDS[one.severity]] += 1
            self.by_node[place] = Tally(*more)

    @property
    def tally(self) -> Tally:
        """All there were."""
        return Tally(*self._all)

    def mark(self) -> None:
        """Nodes have done nothing wrong yet."""
        self.by_node.clear()

    def clear(self) -> None:
        """None is shown any more; they remain counted."""
        self._rows.clear()

    def rows(self) -> Iterator[FindingRow]:
        """The newest first."""
        return reversed(self._rows.values())
