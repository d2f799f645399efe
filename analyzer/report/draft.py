"""The captures of a report as they were judged, the report so far, and the wishes for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from analyzer.report.model import CaptureSummary, Coverage, DeviceEvent, Finding, Requirement, RuleVerdict, WaiverUse
from analyzer.rules.gate import Least
from analyzer.tables import VERDICTS
from dissectors.records import dataclass, field
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.facts.frame_marks import Mark
    from analyzer.flight.verdict.model import Triage
    from analyzer.rules.checking import Checked
    from analyzer.rules.gate import FailOn


@dataclass(frozen=True, slots=True)
class JudgedCapture:
    """A capture as it was taken in. `damage` says what could not be read, `unopened` that this is all of it.

    `triage` is what happened in its flights, None if nobody looked. `marks` are what somebody marked.
    """

    id: str
    path: str
    checked: Checked
    damage: str = ""
    unopened: bool = False
    live: bool = False
    ends: bool = True
    arguments: tuple[str, ...] = ()
    triage: Triage | None = None
    marks: Sequence[Mark] = ()

    @property
    def timed(self) -> bool:
        """True if it tells how much time went by."""
        return self.checked.facts.judge["timing"] == "yes"

    @property
    def judgeable(self) -> bool:
        """True if there was anything of DroneCAN in it."""
        return self.checked.facts.transfers > 0 or self.checked.facts.verdicts[VERDICTS[0]] > 0

    def lack(self, least: Least) -> str:
        """Say what it has too little of to be judged; empty if it has enough."""
        facts = self.checked.facts
        complete = facts.transfers - facts.broken
        timed = self.timed and facts.start is not None and facts.end is not None
        return least.lack(complete, ((facts.end or 0) - (facts.start or 0)) / SECOND if timed else None)


@dataclass(frozen=True, slots=True)
class Draft:
    """The report so far, for what a vehicle or a baseline has to say of it."""

    taken: tuple[JudgedCapture, ...]
    captures: tuple[CaptureSummary, ...]
    findings: tuple[Finding, ...]
    rules: tuple[RuleVerdict, ...] = ()
    coverage: Coverage | None = None
    events: tuple[DeviceEvent, ...] = ()


Revise = Callable[[Draft], Draft]  # with waivers and labels, or compared with a baseline
Demand = Callable[[Draft], Iterable[Requirement]]
Excuses = Callable[[Sequence[Finding]], Iterable[WaiverUse]]


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """The wishes for a report. `asked` are options to be printed with the settings."""

    tool: str
    fail_on: FailOn
    least: Least = Least()
    asked: Mapping[str, Any] = field(default_factory=dict)
    profile: str = ""
    revise: Sequence[Revise] = ()
    demands: Sequence[Demand] = ()
    excuses: Sequence[Excuses] = ()
