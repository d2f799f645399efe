"""Exclusions, in numbers: commands that stop, sag, a broken bus, a hole in the recording."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from analyzer.flight.holes import DISORDER
from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.model import Excluded
from analyzer.flight.verdict.supplies import unexplained

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.supply.extents import EscExtent
    from analyzer.flight.verdict.case import FlightCase, Node
    from analyzer.flight.verdict.model import Verdict
    from analyzer.flight.witness import Witness


_LEAST = 0.5  # s


def excluded(case: FlightCase, verdict: Verdict, began: int) -> Sequence[Excluded]:
    """Return the facts that speak against other causes, up to when it began."""
    return [] if verdict.kind in {"none", "unknown"} else list(_excluded(case, verdict, began))


def _excluded(case: FlightCase, verdict: Verdict, began: int) -> Iterator[Excluded]:
    start, span = max(case.start, began - lasting("looked_back")), lasting("looked_back") / 1e9
    span = min(span, (began - start) / 1e9)
    count = case.pulse.count(case.start, case.stop)
    torn = any(one.kind == "gap" and one.first.ran <= case.stop for one in case.events)  # nobody knows what was in it
    if count and not torn and verdict.kind not in {"commands-lost", "commanded"}:
        length = max((case.stop - case.start) / 1e9, 0.001)
        longest = case.pulse.longest(case.start, case.stop)
        yield Excluded("commands stopping", f"{count / length:.0f} Hz to the end, longest pause {longest} ms")
    if verdict.kind != "battery" and (sag := _lowest(case, began)):
        yield Excluded("pack sag", sag)
    if verdict.kind == "device" and verdict.node is not None and verdict.bus is not None:
        yield from _wire(case, (verdict.bus, verdict.node))
    if span < _LEAST:  # nothing was before it
        return
    if verdict.kind != "bus":
        errors = sum(
            int(one.values.get("count", 0)) for one in case.events if one.kind == "errors" and one.first.ran < began
        )
        broken = case.losses.broken(start, began - 1)
        if not errors and not broken:
            yield Excluded("a broken bus before it", f"0 broken transfers in {span:.0f} s")
    if verdict.kind != "wiring":
        missing = case.losses.missing(start, began - 1)
        if not missing and not case.joint:
            yield Excluded("a hole in the recording", f"no transfer ID missing in the {span:.0f} s before it")


def _wire(case: FlightCase, node: Node) -> Iterator[Excluded]:
    """Yield that a node's transfers came whole, and with none left out, if that is so."""
    anew = any(one.kind == "restart" and (one.bus, one.node) == node for one in case.events)
    if case.losses.broken(case.start, case.stop, [node]) or (
        not anew and case.losses.missing(case.start, case.stop, [node])
    ):
        return
    ids = "transfer IDs from 0" if anew else "no transfer ID missing"
    yield Excluded(f"CAN wiring of node {node[1]}", f"no broken transfer, {ids}")


def _lowest(case: FlightCase, began: int) -> str:
    """Return how low voltages were before it began; empty if that excludes nothing."""
    sags = [one for one in case.events if one.kind == "sag" and (one.bus, one.node) in case.esc_nodes]
    before = [one for one in sags if one.first.ran < began]
    if sags and not before:
        return "none before it"
    if before:
        one = min(before, key=lambda one: one.values["worst_voltage"])
        if unexplained(one):
            return ""
        expected = one.values.get("expected_voltage")
        low = one.values["worst_voltage"]
        if expected is None or not isfinite(expected):
            return f"{low:.1f} V at {one.values.get('current_then', 0):.0f} A of an ESC, the load of take-off"
        return f"{low:.1f} V, where its current explains {expected:.1f} V"
    if any(one.kind == "sag" for one in case.events):
        return ""  # of a monitor, with no line of a current to hold it against
    lows = [one.ranges["voltage"] for one in case.escs if "voltage" in one.ranges]
    when = " of all flights" if case.flight.number > 1 else ""
    own = [f"none; {min(low for low, _ in lows):.1f} V at the lowest{when}"] if lows else []
    own += [
        f"{low:.1f} V at the lowest by node {node}{case.role(bus, node)}"
        for (bus, node), low in sorted(case.supply.lowest(case.start, case.stop).items())
        if (bus, node) not in case.esc_nodes
    ][:1]  # fmt: skip
    return ("" if lows else "none; ") + ", ".join(own) if own else ""


def looked_at(case: FlightCase) -> Sequence[str]:
    """Return what was looked at, in numbers."""
    parts = _measured(case.escs)
    if parts and case.flight.number > 1:
        parts = [f"in all flights {', '.join(parts)}"]
    parts.insert(0, f"{(case.stop - case.start) / 1e9:.0f} s {'armed' if case.flight.by == 'arming' else 'turning'}")
    count = case.pulse.count(case.start, case.stop)
    if count:
        rate = f"commands {count / max((case.stop - case.start) / 1e9, 0.001):.0f} Hz"
        several = sorted(node for _, node in case.commanders)
        rate += f" of nodes {' and '.join(map(str, several))}" if len(set(several)) > 1 else ""
        parts.insert(min(2, len(parts)), rate)
    if case.esc_nodes:
        parts.append(f"{case.losses.missing(case.start, case.stop, case.esc_nodes)} transfer IDs of ESCs missing")
    parts.append(f"{case.losses.broken(case.start, case.border)} broken of {case.losses.transfers} transfers")
    return parts


def looked_at_rest(witness: Witness) -> Sequence[str]:
    """Return what was looked at in a recording without a flight, in numbers."""
    start, stop = witness.clock.start or 0, witness.clock.ran or 0
    return [*_measured(witness.escs), f"{witness.losses.broken(start, stop)} broken transfers"]


def _measured(escs: Sequence[EscExtent]) -> list[str]:
    """Return how many ESCs reported how often, and between which voltages and temperatures."""
    parts = []
    if escs:
        places = {(one.bus, one.node) for one in escs}
        buses, nodes = {bus for bus, _ in places}, {node for _, node in places}
        twice = len(buses) > 1 and len(places) == len(buses) * len(nodes)  # as interfaces of one bus see them
        count = len(nodes) if twice else len(places)
        reports = sum(one.count for one in escs)
        on_each = f" on each of {len(buses)} interfaces" if twice else ""
        parts.append(f"{count} ESC{'s' * (count != 1)}{on_each}, {reports} report{'s' * (reports != 1)}")
    for name, unit in (("voltage", "V"), ("temperature", "C")):
        ranges = [one.ranges[name] for one in escs if name in one.ranges]
        if ranges:
            digits = 1 if unit == "V" else 0
            low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
            parts.append(f"{low:.{digits}f}-{high:.{digits}f} {unit}")
    return parts


def could_not_see(case: FlightCase) -> list[tuple[str, str]]:
    """Return what this recording does not tell, with a label: it is neither fault nor health."""
    parts = []
    if not any(one.kind in {"errors", "bus state", "loss"} for one in (*case.before, *case.events)):
        parts.append("error frames and drops: none recorded (candump -e -d)")
    silent = case.bitless()
    if silent and None not in silent:
        which = (
            "all ESCs" if len(silent) == len(case.escs_by_channel) else f"ESC {' '.join(f'ch{ch}' for ch in silent)}"
        )
        parts.append(f"fault bits: not told by these ESCs ({which})")
    worst = case.losses.most_broken(case.start, case.border)
    if worst is not None and worst[1] >= threshold("broken_many"):
        parts.append(f"{worst[1]} broken transfers of {case.name(worst[0])}: what they said")
    if case.esc_nodes and case.unheard:
        parts.append(f"{' '.join(f'ch{ch}' for ch in case.unheard)}: commanded, and nobody reports as that")
    if case.esc_nodes and not case.commanded:
        parts.append("commands: none recorded")
    return [("unseen", "; ".join(parts))] if parts else []


def recorder_lines(case: FlightCase) -> Sequence[tuple[str, str]]:
    """Return what has to be known of clock and recorder before anything else, with a label each."""
    lines = []
    for one in case.events:
        if one.kind == "clock":
            lines.append(("Clock", one.text if one.sign == DISORDER else f"{one.text}; one flight, no gap"))
        elif one.kind == "loss":
            lines.append(("Recorder", one.text))
    if case.joint:
        times = "once" if len(case.joint) == 1 else f"{len(case.joint)} times"
        lines.append(("Recorder", f"lost frames of several senders together, {times}: nothing in there is evidence"))
    return lines
