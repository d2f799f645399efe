"""What triage says of simulated stories, and of these with something left out."""

from __future__ import annotations

import io
from functools import lru_cache
from typing import TYPE_CHECKING

import analyzer
from analyzer.simulate.faults import catalogue
from kit.simulated import simulation, text_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.flight.verdict.model import Triage


@lru_cache(maxsize=4)
def told(scenario: str, seed: int = 3, escs: int = 4, rate: int = 30, *, stock: bool = False) -> Triage:
    """What triage says of a story without distractors, unless it asks for them."""
    return triaged(crash_log(scenario, seed, escs, rate, stock=stock))


@lru_cache(maxsize=4)
def crash_log(scenario: str, seed: int = 3, escs: int = 4, rate: int = 30, *, stock: bool = False) -> str:
    """The candump text of a story."""
    name, _, options = scenario.partition(":")
    story = catalogue.scenario(name)
    asked = options.split(":") if options else []
    if "distract" in story.options and not any(one.startswith("distract=") for one in asked):
        asked.append("distract=no")
    run = simulation(
        story.seconds, scenario=":".join([name, *asked]), flight=story.flight, seed=seed, escs=escs, rate=rate,
        stock=stock,
    )  # fmt: skip
    return text_of(run, run.frames())


def triaged(text: str) -> Triage:
    """What triage says of candump text."""
    file = io.BytesIO(text.encode())
    file.name = "crash.log"
    return analyzer.triage(file)


def without(text: str, unwanted: Callable[[int, int, float], bool]) -> str:
    """Leave out frames by sender, type of message and time in s from the first line."""
    lines = text.splitlines(keepends=True)
    start = _time(lines[0])
    return "".join(line for line in lines if not unwanted(*_sender(line), _time(line) - start))


def _time(line: str) -> float:
    return float(line[1 : line.index(")")])


def _sender(line: str) -> tuple[int, int]:
    frame = line.split()[2]
    if frame.startswith("2") or "#" not in frame:  # an error frame, or no frame at all
        return -1, -1
    number = int(frame.partition("#")[0], 16)
    return number & 0x7F, number >> 8 & 0xFFFF


def said(found: Triage) -> str:
    """Everything the first verdict says, in one text."""
    one = found.first
    return "\n".join([one.title, *one.reasons, *one.against, *(f"{label}: {text}" for label, text in one.notes)])


def excluded(found: Triage) -> dict[str, str]:
    """What was looked for and not found, by fact."""
    return {one.fact: one.seen for one in found.excluded}
