"""A capture judged before it is listed, so that its rows can be marked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import RuleChoice
from analyzer.rules.named_frames import NamedFrames

if TYPE_CHECKING:
    from analyzer.app.run import Run


def named_frames(run: Run, asked: str = "-Y with finding.*") -> NamedFrames:
    """Return which rules name which frames of the whole capture of a run that has not been read yet.

    Rules are those of `tailbyte check`, with the vehicle file of the run's request. Ends the run if its capture exists
    only once, for `asked`, the option that is to blame. Once the run is stopped, it holds what was found until then.
    """
    before = run.before()
    named = NamedFrames()
    if before is None:
        run.require(f"{asked} reads a capture twice: save it to a file first")
        return named
    criteria = Criteria(RuleChoice(vehicle=run.request.rules.vehicle), run.registry)
    judged = JudgedRun(before, criteria, named)
    for _ in judged.batches(before.batches()):
        pass
    report = criteria.report([judged.taken(run.source.name)])
    index = {name: bus for bus, name in enumerate(before.engine.buses)}
    named.finish(
        (one.rule, index.get(one.bus or "", -1), -1 if one.node is None else one.node) for one in report.findings
    )
    return named
