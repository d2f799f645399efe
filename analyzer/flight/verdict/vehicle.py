"""Troubles of the vehicle as a whole: other nodes, its commands, its bus, its thrust."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.pulse import STEP
from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.devices import device_trouble
from analyzer.flight.verdict.trouble import Trouble, by_node, harmless, made
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase

_NEARLY_ALL = 0.9  # of the last quarter of the flight


def device_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield any other node that restarts, falls silent or says that it is ill."""
    some = [
        one for one in case.events
        if one.kind in {"silence", "restart"} or (one.kind == "health" and not one.text.endswith("ok"))
    ]  # fmt: skip
    for node, events in by_node(some).items():
        if node in case.esc_nodes or node in case.commanders:
            continue
        mine = [one for one in events if not case.in_joint_loss(one)]
        restarts = [one for one in mine if one.kind == "restart"]
        gone = [one for one in mine if one.kind == "silence" and one.after is None]
        if not restarts and not gone and not any(one.kind == "health" for one in mine):
            continue
        when = "while armed" if case.flight.by == "arming" else "in flight"
        title = f"restarted {when}" if restarts else "stopped reporting" if gone else "says that it is not well"
        yield device_trouble(case, node, title, mine)


def command_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield commands that stop, or are zero while the vehicle flies."""
    for one in case.events:
        if one.kind == "commands stop" and not case.in_joint_loss(one):
            felt = _felt(case, one)
            if not felt and one.after is not None and one.values["silent_s"] < threshold("commands_gone_s"):
                continue
            reasons = [one.text]
            if felt:
                reasons.append(f"{len({(o.bus, o.node) for o in felt})} ESCs say that they get no commands")
            anew = _restarts(case, one)
            reasons += [f"node {other.node}{case.role(other.bus, other.node)} {other.text}" for other in anew]
            found = made("commands-lost", "the commands stopped", [one, *felt, *anew], 0, reasons)
            if one.after is None and case.stop - one.first.ran > lasting("coast"):
                more = (case.stop - one.first.ran) / SECOND
                found.against.append(f"motors turned for {more:.0f} s more, as if they got commands: not recorded?")
                found.possible = True
            yield found
        elif one.kind == "commands zero" and (share := _thrown(case, one)) is not None:
            before, usual = share
            yield made("commanded", "all motors were commanded to stop in the air", [one], 0, [
                f"commands go from {before:.0f} % to 0 at once; {usual:.0f} % was usual in this flight",
                *case.obeyed(),
            ])  # fmt: skip


def _restarts(case: FlightCase, one: FlightEvent) -> list[FlightEvent]:
    """Return how who commands starts anew, of which one knows when it is back."""
    until = (case.border if one.after is None else one.after.ran) + lasting("silence_after")
    return [
        other for other in case.events
        if other.kind == "restart" and (other.bus, other.node) in case.commanders
        and one.first.ran <= other.first.ran <= until
    ]  # fmt: skip


def _felt(case: FlightCase, one: FlightEvent) -> list[FlightEvent]:
    """Return how ESCs say that they get no commands, while commands are away: several of them have to."""
    until = (case.border if one.after is None else one.after.ran) + lasting("together")
    felt = [other for other in case.events if other.sign == "uncommanded" and one.first.ran <= other.first.ran <= until]
    nodes = {(other.bus, other.node) for other in felt}
    return felt if 2 * len(nodes) >= max(len(case.esc_nodes), 2) or nodes == case.esc_nodes else []


def _thrown(case: FlightCase, one: FlightEvent) -> tuple[float, float] | None:
    """Return the commands just before all are 0, and the usual one, if the vehicle cannot have stood on the ground."""
    before = case.pulse.mean(one.first.ran - lasting("before_zero"), one.first.ran - STEP)
    usual = case.pulse.mean(case.start + lasting("take_off"), one.first.ran)
    if case.one_by_one or not len(before) or not len(usual):
        return None
    middle = float(np.median(usual))
    lowest = float(before.min())
    return (lowest, middle) if lowest >= threshold("zero_share") * middle else None


def bus_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield a bus that breaks: it is well until the first errors that are enough, closely after each other."""
    errors = [one for one in case.events if one.kind in {"errors", "bus state"} and not _got_over(case, one)]
    begun = next((run[0] for run in _runs(errors) if _breaks(run)), None)
    if begun is None:
        return
    errors = errors[errors.index(begun) :]
    reasons = [f"{_error_frames(errors)} error frames from then on"]
    gaps = [one for one in case.events if one.kind == "gap" and one.first.ran >= begun.first.ran]
    reasons += [gaps[0].text] if gaps else []
    yield made("bus", "the bus broke down", errors, 1, reasons, whole=True)


def _runs(errors: list[FlightEvent]) -> Iterator[list[FlightEvent]]:
    """Yield the errors that follow each other: a bus that was well in between has another trouble."""
    first = 0
    for k, (one, other) in enumerate(pairwise(errors), 1):
        if other.first.ran - (one.after or one.first).ran > lasting("follows"):
            yield errors[first:k]
            first = k
    if errors:
        yield errors[first:]


def _breaks(errors: list[FlightEvent]) -> bool:
    return _error_frames(errors) >= threshold("bus_errors") or any("bus-off" in one.text for one in errors)


def _error_frames(errors: list[FlightEvent]) -> int:
    return sum(int(one.values.get("count", 0)) for one in errors if one.kind == "errors")


def _got_over(case: FlightCase, one: FlightEvent) -> bool:
    """Return whether the bus was well again, with nothing missing, and the vehicle flew on."""
    until = (one.after or one.first).ran + lasting("follows")
    hole = any(other.kind == "gap" and one.first.ran <= other.first.ran <= until for other in case.events)
    return not hole and harmless(case, one)


def thrust_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield commands that are at their end, of all motors together."""
    start, stop = case.start + lasting("take_off"), case.stop
    if case.excursion is not None:
        stop = case.excursion.start
    mean = case.pulse.mean(start, 0 if case.one_by_one else stop)
    high = mean >= threshold("high_percent")
    if not len(mean) or high.sum() * STEP < lasting("high") or high[-1 - len(high) // 4 :].mean() < _NEARLY_ALL:
        return
    first = start + int(np.argmax(high)) * STEP
    apart = float(np.max(case.pulse.spread(start, stop), initial=0))
    lasted = high.sum() * STEP / SECOND
    yield Trouble("thrust", "all motors were at their limit", [], first, first + STEP, order=6, reasons=[
        f"commands of {float(np.median(mean[high])):.0f} % in the mean for {lasted:.1f} s, {apart:.0f} % apart at most",
        *case.obeyed(),
    ])  # fmt: skip
