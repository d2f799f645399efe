"""Stories as ESCs of another vendor tell them: speed in one message, volts and amperes in another, and no number."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults import catalogue
from kit import encode
from kit.simulated import simulation
from kit.vendors import SPACE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_KEPT = ("RawCommand", "uavcan.protocol.NodeStatus")
_SLOW = 3  # speeds to one report of the supply


def other_esc_log(name: str, seed: int = 3, escs: int = 4, rate: int = 30) -> str:
    """The candump text of a story without distractors."""
    family = name.partition(":")[0]
    story = catalogue.scenario(family)
    run = simulation(
        story.seconds, scenario=f"{name}:distract=no", flight=story.flight, seed=seed, escs=escs, rate=rate
    )  # fmt: skip
    lines: list[tuple[int, str]] = []
    counts: Counter[tuple[str, int]] = Counter()
    start = run.settings.start
    sent = [one for one in (frame.sending for frame in run.frames()) if one is not None]
    for sending in dict.fromkeys(sent):
        for kind, fields in _told(sending.name, sending.values, sending.node, counts):
            tid = counts[kind, sending.node]
            counts[kind, sending.node] += 1
            frames = encode.transfer(kind, fields, sending.node, tid % 32).frames(start + sending.frames[0].t)
            lines.extend((frame.t, encode.log_line(frame) + "\n") for frame in frames)
    return "".join(line for _, line in sorted(lines, key=lambda one: one[0]))


def _told(
    name: str, values: Mapping[str, Any], node: int, counts: Counter[tuple[str, int]]
) -> Iterator[tuple[str, dict[str, Any]]]:
    if name in _KEPT:
        yield name, dict(values)
    if name != "ESCStatus":
        return
    if not counts[f"{SPACE}StatusMsg1", node]:
        yield f"{SPACE}GetEscID", {"payload": [node, values["esc_index"] + 1]}
    rpm = abs(values["rpm"])
    yield f"{SPACE}StatusMsg1", {"rpm": rpm, "pwm": 0, "status": 0}
    if counts[f"{SPACE}StatusMsg1", node] % _SLOW == 1:
        yield f"{SPACE}StatusMsg2", {
            "input_voltage": round(10 * values["voltage"]), "current": round(10 * values["current"]),
            "temperature": round(values["temperature"] - 273),
        }  # fmt: skip
