"""The answer key: which faults a simulated capture holds, where, and the story behind them."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.simulate.recorder import SimulatedRecorder
    from analyzer.simulate.settings import SimulationSettings
    from analyzer.simulate.story import RecordedStory
    from dissectors.tmotor.traffic import SimulatedVehicle
    from dissectors.traffic import Answer, Scenario, Truth

SCHEMA = "tailbyte.simulate.key/1"


def build_key(
    settings: SimulationSettings,
    recorder: SimulatedRecorder,
    vehicle: SimulatedVehicle,
    answers: Iterable[Answer],
    story: Mapping[str, Any] | None,
) -> dict[str, Any]:
    """Return everything known about a run that has ended.

    Times are twice: `t_ns` since 1970, as in the capture, and `time` in seconds since the start of the simulation.
    `frames` are frame numbers from 1; `lines` are the lines (or records) of what has no frame
    number: error frames and broken lines.
    """
    start = settings.start
    return {
        "schema": SCHEMA,
        "settings": {
            "profile": settings.flight,
            "scenario": settings.scenario or None,
            "esc": settings.escs,
            "duration_ns": settings.duration,
            "seed": settings.seed,
            "bit_rate": settings.bit_rate,
            "rate_hz": vehicle.rate,
            "stock": settings.stock,
            "start_ns": start,
            "faults": [order.text for order in settings.orders if order.rate is None],
            "fault_rates": [order.text for order in settings.orders if order.rate is not None],
        },
        "capture": {
            "bus": settings.bus,
            "frames": recorder.frames,
            "error_frames": recorder.error_frames,
            "unreadable": recorder.unreadable,
            "first_ns": None if recorder.first is None else start + recorder.first,
            "last_ns": None if recorder.last is None else start + recorder.last,
        },
        "vehicle": vehicle.describe(),
        "scenario": story,
        "faults": [_entry(answer, start) for answer in sorted(answers, key=_place)],
    }


def describe_story(scenario: Scenario, story: RecordedStory, start: int) -> dict[str, Any]:
    """Return what a scenario is, and when each part of it happened; `start` is in ns since 1970."""
    events = [{"t_ns": start + stamp, "time": t / SECOND, "what": what} for t, stamp, what in story.events]
    found: dict[str, Any] = {"name": scenario.name, "title": scenario.title, "story": scenario.story, "events": events}
    if story.truth is not None:
        found |= _truth(story.truth, events, start)
    return found


def _truth(truth: Truth, events: Iterable[Mapping[str, Any]], start: int) -> dict[str, Any]:
    """Return cause, right verdicts and first event; where there is no fault, there is no first event of it."""
    told = next((one for one in events if one["time"] >= truth.t / SECOND), None)
    begin = start + truth.stamp
    first = told and {**told, "t_ns": begin, "time": truth.t / SECOND, "t_end_ns": begin + truth.within}
    return {
        "cause": {"kind": truth.kind, "nodes": list(truth.nodes), "channels": list(truth.channels)},
        "knowable": list(truth.knowable),
        "first_event": None if truth.kind == "none" else first,
    }


def text(found: Mapping[str, Any]) -> str:
    """Return the key as JSON to read: a line for each value, and one for each list of numbers."""
    lines = json.dumps(found, ensure_ascii=False, indent=1)
    # Texts cannot match: a line break in one of them is written as an escape.
    return (
        re.sub(r"\[\n[\s\d.,-]*\]", lambda found: f"[{', '.join(found[0][1:-1].replace(',', ' ').split())}]", lines)
        + "\n"
    )


def _entry(answer: Answer, start: int) -> dict[str, Any]:
    return {
        "rule": answer.rule,
        "t_ns": start + answer.t,
        "t_end_ns": start + max(answer.t, answer.t_end),
        "time": answer.t / SECOND,
        "frames": answer.frames,
        "lines": answer.lines,
        "more": answer.more,
        "node": answer.node,
        "type": answer.type or None,
        "done": answer.done,
        "also": list(answer.also),
    }


def _place(answer: Answer) -> tuple[int, str]:
    return answer.t, answer.rule
