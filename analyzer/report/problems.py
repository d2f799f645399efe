"""Findings as people count them: the runs of one and the same trouble are one problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer.report.model import SEVERITIES, Place

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.model import Example, Finding, Severity, Waiver

MOST_FRAMES = 20
MOST_EXAMPLES = 20

WHERE = ("capture", "rule", "bus", "node", "type")  # a problem as a test case
SAME = (*WHERE, "severity", "label", "key")  # a problem as a line of a report

_BASELINES = ("new", "worse", "known", "")


@dataclass(frozen=True, slots=True)
class Problem:
    """Findings that agree in all that keeps problems apart; never empty, the worst first."""

    runs: tuple[Finding, ...]

    @property
    def head(self) -> Finding:
        """The run that stands for all."""
        return self.runs[0]

    @property
    def severity(self) -> Severity:
        """The worst of all runs."""
        return min((run.severity for run in self.runs), key=SEVERITIES.index)

    @property
    def count(self) -> int:
        """Occurrences in all runs."""
        return sum(run.count for run in self.runs)

    @property
    def fails(self) -> bool:
        """Whether a run of it counts against the gate."""
        return any(run.fails for run in self.runs)

    @property
    def waiver(self) -> Waiver | None:
        """What excuses it, if all of it is excused."""
        waivers = [run.waiver for run in self.runs]
        return None if None in waivers else waivers[0]

    @property
    def baseline(self) -> str:
        """The worst comparison of a run with an older report."""
        return min((run.baseline for run in self.runs), key=_BASELINES.index)

    @property
    def open(self) -> bool:
        """Whether somebody has to look at it: neither waived nor known from an older report."""
        return self.waiver is None and self.baseline != "known"

    @property
    def first(self) -> Place:
        """Where it began, by time, else by frame."""
        return min((run.first for run in self.runs), key=_order)

    @property
    def last(self) -> Place:
        """Where it was seen last."""
        return max((run.last for run in self.runs), key=_order)

    @property
    def frames(self) -> Sequence[int]:
        """The first evidence frames, up to 20, in rising order."""
        return sorted({frame for run in self.runs for frame in run.frames})[:MOST_FRAMES]

    @property
    def examples(self) -> Sequence[Example]:
        """The first examples, up to 20."""
        return [example for run in self.runs for example in run.examples][:MOST_EXAMPLES]


def _order(place: Place) -> tuple[int, int]:
    return (-1 if place.t_ns is None else place.t_ns, -1 if place.frame is None else place.frame)


def problems(findings: Iterable[Finding], alike: Sequence[str] = SAME) -> list[Problem]:
    """Findings joined where all attributes named by `alike` are equal, in the order of each one's first finding."""
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for finding in findings:
        groups.setdefault(tuple(getattr(finding, name) for name in alike), []).append(finding)
    return [Problem(tuple(group)) for group in groups.values()]


def ranked(found: Iterable[Problem]) -> list[Problem]:
    """What fails the gate first, then what is open, then by severity; what is equal keeps its order."""
    return sorted(found, key=lambda one: (not one.fails, not one.open, SEVERITIES.index(one.severity)))
