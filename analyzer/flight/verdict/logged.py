"""The autopilot's side of a case: its words and its measurements, for and against what the bus tells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.measured import Opinion, Question, measured_for
from analyzer.flight.verdict.model import SUPPORTS, Excluded
from analyzer.flight.verdict.said import said_for
from dissectors.records import dataclass, replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.autopilot.side import AutopilotSide
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase
    from analyzer.flight.verdict.model import Support, Verdict
    from analyzer.flight.verdict.said import Onset


@dataclass(frozen=True, slots=True)
class Logged:
    """The autopilot's side of a case: what its log measured, None if that is not known, and its words, in order."""

    case: FlightCase
    side: AutopilotSide | None
    words: Sequence[FlightEvent]

    def heard(self, verdict: Verdict, onset: Onset) -> Verdict:
        """Return a verdict with what speaks for and against it here."""
        role = self.case.role(verdict.bus, verdict.node) if verdict.kind == "device" else ""
        told, denied = said_for(verdict, role, onset, self.words)
        found = Opinion([*told], [*denied])
        if self.side is not None:
            measured_for(Question(self.case, self.side, verdict, onset), found)
        notes = [(label, text) for label, text in verdict.notes if label not in found.dropped] + found.notes
        return replace(
            verdict, reasons=(*verdict.reasons, *found.reasons), against=(*verdict.against, *found.against),
            notes=notes, support=_support(verdict, found),
        )  # fmt: skip

    def excluded(self, verdict: Verdict, onset: Onset) -> list[Excluded]:
        """Return what its log rules out: facts that it would have told."""
        if not verdict.told or self.side is None:
            return []
        found, start = [], self.case.start
        beyond = (self.side.ended - onset.high) / SECOND
        if verdict.kind != "commands-lost" and beyond > threshold("log_runs_on_s"):
            found.append(Excluded("the autopilot stopping", f"its log runs on, {beyond:.1f} s behind it"))
        last = onset.high + lasting("said_with")
        decided = [one for one in self.words if start <= one.first.ran and (one.before or one.first).ran <= last]
        errors = [one for one in decided if one.type == "ERR" and one.values.get("code") != 0]
        disarmed = [one for one in decided if one.kind == "arming" and "disarm" in one.text]
        if self.side.covers(start, onset.low) and not errors and not disarmed:
            found.append(Excluded("a failsafe or disarming before it", "its log has none in this flight"))
        return found


def _support(verdict: Verdict, found: Opinion) -> Support:
    """Return how well a verdict is supported: an own word more, or less, is a step; what is possible stays so."""
    step = SUPPORTS.index(verdict.support)
    if step < len(SUPPORTS) - 1:
        step += bool(found.against) - bool(found.reasons)
    return SUPPORTS[min(max(step, 0), len(SUPPORTS) - 1)]
