"""What triage finds in captures, to be drawn."""

from __future__ import annotations

import io
from functools import cache
from typing import TYPE_CHECKING, Any

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.sources.origin import given
from kit import CAPTURES
from kit.simulated import simulation, text_of

if TYPE_CHECKING:
    from analyzer.flight.verdict.model import Triage


def looked(source: Any) -> Triage:
    run = Run(Request((given(source),)))
    triage = RunTriage(run, drawn=True)
    for _ in triage.over(run.inside()):
        pass
    return triage.found()


@cache
def of(name: str) -> Triage:
    return looked(CAPTURES / name)


@cache
def flown(scenario: str, **settings: Any) -> Triage:
    made = simulation(scenario=scenario, **settings)
    file = io.BytesIO(text_of(made, made.frames()).encode())
    file.name = "flown.log"
    return looked(file)
