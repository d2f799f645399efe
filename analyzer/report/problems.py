"""Findings as people count them: the runs of one and the same trouble are one problem."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, TypeVar

from analyzer.report.model import SEVERITIES, Place
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer.report.model import Example, Finding, Severity, Waiver

MOST_FRAMES = 20
MOST_EXAMPLES = 20

WHERE = ("capture", "rule", "bus", "node", "type")  # a problem as a test case
SAME = (*WHERE, "severity", "label", "key")  # a problem as a line of a report
_MANY = 3  # nodes with the same problem are one line

_Item = TypeVar("_Item")

_BASELINES = ("new", "worse", "known", "")


@dataclass(frozen=True, slots=True)
class Problem:
    """Findings that agree in all that keeps problems apart; never empty, the worst first.

    `severity` is the worst of all runs, `baseline` the worst comparison of one with an older report, and `waiver` what
    excuses it, if all of it is excused.
    """

    runs: tuple[Finding, ...]
    severity: Severity = field(init=False, compare=False)
    baseline: str = field(init=False, compare=False)
    waiver: Waiver | None = field(init=False, compare=False)

    def __post_init__(self) -> None:
        """Look at all runs once: reports ask for this again and again."""
        waivers = [run.waiver for run in self.runs]
        for name, value in (
            ("severity", _least([run.severity for run in self.runs], SEVERITIES)),
            ("baseline", _least([run.baseline for run in self.runs], _BASELINES)),
            ("waiver", None if None in waivers else waivers[0]),
        ):
            object.__setattr__(self, name, value)

    @property
    def head(self) -> Finding:
        """The run that stands for all."""
        return self.runs[0]

    @property
    def count(self) -> int:
        """Occurrences in all runs."""
        return sum(run.count for run in self.runs)

    @property
    def fails(self) -> bool:
        """True if a run of it counts against the gate."""
        return any(run.fails for run in self.runs)

    @property
    def places(self) -> Sequence[str]:
        """The names of all that it is about, each once: the ESC as people call it, else its node; empty for a bus."""
        names = (run.label or ("" if run.node is None else f"node {run.node}") for run in self.runs)
        return list(dict.fromkeys(names))

    @property
    def open(self) -> bool:
        """True if somebody has to look at it: neither waived nor known from an older report."""
        return self.waiver is None and self.baseline != "known"

    @property
    def first(self) -> Place:
        """The place where it began, by time, else by frame."""
        return min((run.first for run in self.runs), key=_order)

    @property
    def last(self) -> Place:
        """The place where it was seen last."""
        return max((run.last for run in self.runs), key=_order)

    @property
    def frames(self) -> Sequence[int]:
        """The first evidence frames, up to 20, in rising order."""
        return sorted({frame for run in self.runs for frame in run.frames})[:MOST_FRAMES]

    @property
    def examples(self) -> Sequence[Example]:
        """The first examples, up to 20."""
        return [example for run in self.runs for example in run.examples][:MOST_EXAMPLES]


def _least(values: Sequence[_Item], order: Sequence[_Item]) -> _Item:
    """Return the value that comes first in an order; most problems have one run."""
    return values[0] if len(values) == 1 else min(values, key=order.index)


def _order(place: Place) -> tuple[int, int]:
    return (-1 if place.t_ns is None else place.t_ns, -1 if place.frame is None else place.frame)


def problems(findings: Iterable[Finding], alike: Sequence[str] = SAME) -> list[Problem]:
    """Join findings where all attributes named by `alike` are equal, in the order of each one's first finding.

    As lines of a report, three and more nodes with the same problem are one, too.
    """
    groups = _grouped(findings, attrgetter(*alike))
    found = [Problem(tuple(group)) for group in groups]
    if tuple(alike) != SAME:
        return found
    joined = []
    for some in _grouped(found, _nodeless):
        many = len(some) >= _MANY and some[0].head.node is not None
        joined += [Problem(tuple(run for one in some for run in one.runs))] if many else some
    order = {id(one.head): k for k, one in enumerate(found)}
    return sorted(joined, key=lambda one: order[id(one.head)])


def _nodeless(one: Problem) -> tuple[object, ...]:
    """Return what two problems must share to differ by the node only."""
    head = one.head
    return head.capture, head.rule, head.bus, head.type, one.severity, head.key, head.cause, one.open, one.baseline


def _grouped(items: Iterable[_Item], key: Callable[[_Item], object]) -> list[list[_Item]]:
    groups: dict[object, list[_Item]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return list(groups.values())


def ranked(found: Iterable[Problem]) -> list[Problem]:
    """Sort: what fails the gate first, then what is open, then by severity; what is equal keeps its order."""
    return sorted(found, key=lambda one: (not one.fails, not one.open, SEVERITIES.index(one.severity)))
