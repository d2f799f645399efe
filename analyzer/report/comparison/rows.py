"""Differences as people count them: one at many nodes is a row, and so are the parameters or findings of one node."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Literal

from analyzer.report.comparison.model import WEIGHTS
from analyzer.report.wording import moment, plural, safe
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.comparison.model import CaptureDiff, Difference

_MANY = 3  # nodes with the same difference are one row
_TOGETHER = ("parameter", "reading", "finding", "telemetry")  # of one node
_NAMED = 4
_ALSO = 2
_START = "start"


@dataclass(frozen=True, slots=True)
class DifferenceRow:
    """Differences that are told together; the first one stands for all."""

    members: tuple[Difference, ...]
    everywhere: bool = False

    @property
    def head(self) -> Difference:
        """The first of them."""
        return self.members[0]

    @property
    def who(self) -> str:
        """The device it is about: `ch5 node 24`, the first of many, or a bus."""
        if not self.everywhere:
            return name(self.head)
        names = list(dict.fromkeys(one.who or f"node {one.node}" for one in self.members))
        more = f" +{len(names) - _NAMED}" if len(names) > _NAMED else ""
        return " ".join(map(safe, names[:_NAMED])) + more

    @property
    def more(self) -> str:
        """The rest of it: other parameters or rules of the same node by name, or whose values of many nodes' stand."""
        if len(self.members) == 1:
            return ""
        if self.everywhere:
            alike = len({(one.good, one.bad) for one in self.members}) == 1
            return "" if alike else f"values of {name(self.head)}"
        if self.head.kind == "finding":
            rules = dict.fromkeys(one.rule for one in self.members if one.rule != self.head.rule)
            return f"also {', '.join(rules)}" if rules else ""
        names = [f"{safe(one.what)} {safe(one.good)} -> {safe(one.bad)}" for one in self.members[1:]]
        tail = f" and {len(names) - _ALSO} more" if len(names) > _ALSO else ""
        return f"also {', '.join(names[:_ALSO])}{tail}"


def name(one: Difference) -> str:
    """Say who a difference is about."""
    words = [safe(one.who), "" if one.node is None else f"node {one.node}"]
    return " ".join(filter(None, words)) or safe(one.bus) or "bus"


def rows(found: Sequence[Difference], *, everything: bool = False) -> list[DifferenceRow]:
    """Return the differences in their order, each as a row; those that belong together as one unless `everything`."""
    if everything:
        return [DifferenceRow((one,)) for one in found]
    spread: dict[tuple[str, ...], list[Difference]] = {}
    for one in found:
        if one.node is not None:
            spread.setdefault(_alike(one), []).append(one)
    wide = {key for key, some in spread.items() if len({(one.bus, one.node) for one in some}) >= _MANY}
    groups: dict[tuple[object, ...], list[Difference]] = {}
    for k, one in enumerate(found):
        alike = _alike(one)
        if one.node is not None and alike in wide:
            key: tuple[object, ...] = ("everywhere", *alike)
        elif one.node is not None and one.kind in _TOGETHER:
            key = (one.kind, one.weight, one.bus, one.node)
        else:
            key = (k,)
        groups.setdefault(key, []).append(one)
    return [DifferenceRow(tuple(some), key[0] == "everywhere") for key, some in groups.items()]


def counted(found: Iterable[Difference]) -> str:
    """Write `2 errors, 5 warnings, 1 note`, of rows as people count them."""
    counts = Counter(row.head.weight for row in rows(list(found)))
    return ", ".join(plural(counts[weight], weight) for weight in WEIGHTS if counts[weight])


def headline(of: CaptureDiff) -> tuple[str, str]:
    """Return the verdict in a word, and what it says."""
    if not of.judged:
        return "NOT COMPARED", "nothing that both captures have"
    if not of.differences:
        return "NO DIFFERENCE FOUND", "in what both captures show"
    if all(one.weight == "note" for one in of.differences):
        return "ALIKE", f"no difference that matters, {counted(of.differences)}"
    return "DIFFERENT", counted(of.differences)


def tone(of: CaptureDiff) -> Literal["good", "caution", "bad", "idle"]:
    """Return how a verdict is coloured: errors are bad, warnings a caution."""
    if not of.judged:
        return "idle"
    weights = {one.weight for one in of.differences}
    return "bad" if "error" in weights else "caution" if "warning" in weights else "good"


def since(one: Difference, start: int | None, *, utc: bool = True) -> str:
    """Say when it begins in the second capture: a time, `start` for all of it, or nothing."""
    if one.t_ns is not None:
        return moment(one.t_ns, start, utc=utc)
    return _START if one.since == "throughout" else ""


def evidence(one: Difference) -> list[str]:
    """Return how sure it is and what it is drawn from, piece by piece."""
    counts = f"{one.good_count} and {one.bad_count} reports" if one.kind == "telemetry" else ""
    return [piece for piece in (one.support, counts) if piece]


def earliest(of: CaptureDiff) -> Difference | None:
    """Return what begins first inside the second capture and is more than a note."""
    found = [one for one in of.differences if one.t_ns is not None and one.weight != "note"]
    return min(found, key=lambda one: one.t_ns or 0, default=None)


def _alike(one: Difference) -> tuple[str, ...]:
    what = one.what.partition(" at ")[0] if one.kind == "telemetry" else one.what
    same = (one.good, one.bad) if one.kind in ("firmware", "parameter", "reading") else ()
    return (one.kind, one.weight, what, *same)
