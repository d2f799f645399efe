"""Evidence from measurements of an autopilot's log: that it was written on, what it put out, what it heard."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass, field
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.flight.autopilot.side import AutopilotSide
    from analyzer.flight.verdict.case import FlightCase
    from analyzer.flight.verdict.model import Verdict
    from analyzer.flight.verdict.said import Onset

_LOWEST = 0.05  # of the range of its outputs: motors stand
_ENDS = frozenset({"fits", "would tell"})  # notes of a recording that just ends
_THE_RECORDER = "the recorder: its power, plug, disk or wire; or somebody ended the recording"
_THE_VEHICLE = "power of the vehicle: the autopilot's log ends then, too; or both were written by the same recorder"


@dataclass(slots=True)
class Opinion:
    """An addition to a verdict; `dropped` are the labels of notes that no longer hold."""

    reasons: list[str] = field(default_factory=list)
    against: list[str] = field(default_factory=list)
    notes: list[tuple[str, str]] = field(default_factory=list)
    dropped: frozenset[str] = frozenset()


class Question(NamedTuple):
    """A verdict on a case, when what it speaks of began, and the log that is asked about it."""

    case: FlightCase
    side: AutopilotSide
    verdict: Verdict
    onset: Onset


def measured_for(asked: Question, found: Opinion) -> None:
    """Add what the log measured for and against a verdict."""
    if look := _LOOKS.get(asked.verdict.kind):
        look(asked, found)


def _commands_lost(asked: Question, found: Opinion) -> None:
    """Look whether the autopilot lived on."""
    beyond = (asked.side.ended - asked.onset.low - asked.side.error) / SECOND
    if beyond <= threshold("log_runs_on_s"):
        if asked.side.ended >= asked.onset.low - lasting("log_runs_on"):
            found.reasons.append("the autopilot's log ends then, too: it stopped, or lost its power")
        return
    up = asked.side.drive(asked.onset.high, asked.onset.high + SECOND)
    outputs = f", outputs at {100 * float(np.median(up)):.0f} % of their range" if len(up) else ""
    found.reasons.append(
        f"the autopilot lived: its log runs on for {beyond:.1f} s{outputs}; what takes commands to the bus did not"
    )


def _commanded(asked: Question, found: Opinion) -> None:
    """Look whether its outputs went down, too."""
    up = asked.side.drive(asked.onset.high + asked.side.error, asked.onset.high + asked.side.error + SECOND)
    if not len(up):
        return
    level = float(np.median(up))
    if level <= _LOWEST:
        found.reasons.append("its own outputs (RCOU) go down to nothing then, too")
    else:
        found.against.append(f"its own outputs (RCOU) stay at {100 * level:.0f} % of their range")


def _wiring(asked: Question, found: Opinion) -> None:
    """Look whether the autopilot went on hearing an ESC that this recording does not."""
    silent = [
        one for one in asked.case.events
        if one.kind == "silence" and (one.bus, one.node) == (asked.verdict.bus, asked.verdict.node)
    ]  # fmt: skip
    if not silent or asked.verdict.ch is None:
        return
    one = max(silent, key=lambda one: one.values.get("silent_s", 0) if one.after else float("inf"))
    margin = asked.side.error + lasting("log_late")
    flight, until = asked.case.flight, asked.case.stop if one.after is None else one.after.ran
    start, stop = one.first.t + margin, (flight.last.t if one.after is None else one.after.t) - margin
    before = asked.side.heard(asked.verdict.ch, flight.first.t, (one.before or one.first).t)
    if not before or stop - start < lasting("log_late") or not asked.side.covers(one.first.ran, until):
        return
    heard = asked.side.heard(asked.verdict.ch, start, stop)
    if heard:
        found.against.append(f"the autopilot heard it on: {heard} reports of ch{asked.verdict.ch} in its log meanwhile")
    elif asked.side.heard_at_all(start, stop):
        found.reasons.append(f"the autopilot's log has no report of ch{asked.verdict.ch} then either, but of others")


def _everybody(asked: Question, found: Opinion) -> None:
    """Look whether the autopilot went on hearing ESCs where this recording has none."""
    holes = [(one.before.t, one.first.t) for one in asked.case.events if one.kind == "gap" and one.before]
    margin = asked.side.error + lasting("log_late")
    heard = sum(asked.side.heard_at_all(low + margin, high - margin) for low, high in holes if high - low > 2 * margin)
    if heard:
        sides = found.reasons if asked.verdict.kind == "recorder" else found.against
        sides.append(f"the autopilot heard ESCs meanwhile: {heard} reports in its log where this recording has none")


def _battery(asked: Question, found: Opinion) -> None:
    """Look what its battery monitor says."""
    error, sag = asked.side.error, lasting("sag")
    before = asked.side.volts(asked.onset.low - error - lasting("said_before"), asked.onset.low - error)
    then = asked.side.volts(asked.onset.low - error, asked.onset.high + error + sag)
    if not len(before) or not len(then):
        return
    usual, lowest = float(np.median(before)), float(then.min())
    line = f"its battery monitor: {usual:.1f} -> {lowest:.1f} V"
    if lowest < usual * (1 - threshold("unexplained_percent") / 100):
        found.reasons.append(line)
    elif len(asked.verdict.chs) in {0, len(asked.case.escs_by_channel)}:
        found.against.append(f"{line}: not the pack that it watches")


def _ends(asked: Question, found: Opinion) -> None:
    """Look whether its log ends where the recording does: then power was lost, else it was the recorder."""
    if asked.case.flight.end != "cut" or not any(label == "fits" for label, _ in asked.verdict.notes):
        return
    beyond, slack = (asked.side.ended - asked.case.border) / SECOND, threshold("log_runs_on_s")
    if beyond > slack:
        found.dropped = _ENDS
        found.notes.append(("fits", _THE_RECORDER))
        found.notes.append(("does not", f"power of the vehicle: the autopilot's log runs on for {beyond:.1f} s"))
    elif beyond > -slack:
        found.dropped = _ENDS
        found.notes.append(("fits", _THE_VEHICLE))
    else:
        found.notes.append(("autopilot", f"its log ends {-beyond:.1f} s before: it says nothing of the end"))


_LOOKS: dict[str, Callable[[Question, Opinion], None]] = {
    "commands-lost": _commands_lost,
    "commanded": _commanded,
    "wiring": _wiring,
    "esc": _wiring,
    "recorder": _everybody,
    "bus": _everybody,
    "battery": _battery,
    "unknown": _ends,
}
