"""Troubles of a device that is no ESC: its uptime, its own words, what it sends no more, and its supply."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.node_status import NODE_STATUS
from analyzer.flight.thresholds import lasting
from analyzer.flight.verdict.trouble import made, text
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase, Node
    from analyzer.flight.verdict.trouble import Trouble

_SAME_TIME = "voltage and device fell at about the same time: the reports are too slow to say which came first"
_WORDS = 2  # of what it says itself


def device_trouble(case: FlightCase, node: Node, title: str, mine: list[FlightEvent]) -> Trouble:
    """Return a device that fails, by its events: what speaks for it, and what fell at the same time."""
    restarts = [one for one in mine if one.kind == "restart"]
    silent = [one for one in mine if one.kind == "silence"]
    other = [one for one in mine if one.kind == "health" and not restarts and not silent]
    said = [one for one in case.events if one.kind == "message" and (one.bus, one.node) == node]
    found = made("device", title, mine, 4, [
        *(one.text for one in restarts[:1]), *(text(one) for one in other[:1]),
        *(f'own words: "{one.text}"' for one in said[:_WORDS]), *_away(silent),
    ])  # fmt: skip
    sag = _sag(case, found)
    if sag is not None:
        found.reasons.append(_fell(case, sag))
        if (sag.before or sag.first).ran <= found.high and sag.first.ran >= found.low:
            found.notes.append(("first?", _SAME_TIME))
    if restarts:
        found.against += _others(case, node)
    return found


def _away(silent: list[FlightEvent]) -> list[str]:
    """Return what it did not send, and for how long."""
    rows = []
    for one in silent:
        if one.type == NODE_STATUS:
            continue
        name, period = one.type.rpartition(".")[2], one.values.get("period_s", 0)
        often = f" {1 / period:.3g} Hz" if period > 0 else ""
        away = "never came back" if one.after is None else f"away {one.values['silent_s']:.1f} s"
        rows.append(f"{name}{often}: {away}")
    return rows


def _sag(case: FlightCase, found: Trouble) -> FlightEvent | None:
    """Return a voltage of another device that fell about when this one failed."""
    near = lasting("sag")
    return next((
        one for one in case.events
        if one.kind == "sag" and one.node != found.node
        and (one.before or one.first).ran <= found.high + near and one.first.ran >= found.low - near
    ), None)  # fmt: skip


def _fell(case: FlightCase, sag: FlightEvent) -> str:
    values = sag.values
    last = sag.after or sag.first
    lasted = f", for {(last.ran - sag.first.ran) / MILLISECOND:.0f} ms" if sag.after is not None else ""
    load = values.get("current_then")
    amperes = f", at {load:.0f} A" if load is not None and load == load else ""  # noqa: PLR0124 - NaN is not known
    volts = f"{values['voltage']:.1f} -> {values['worst_voltage']:.1f} V"
    return f"node {sag.node}{case.role(sag.bus, sag.node)}: {volts}{lasted}{amperes}"


def _others(case: FlightCase, node: Node) -> list[str]:
    """Return who did not restart on the same bus: a supply of all would have taken them along."""
    restarted = {(one.bus, one.node) for one in case.events if one.kind == "restart"}
    alive = {
        (one.bus, one.node) for one in case.paces
        if one.type == NODE_STATUS and one.bus == node[0] and one.last >= case.stop - 2 * SECOND
    } - restarted - {node}  # fmt: skip
    return [f"node{'s' * (len(alive) > 1)} {_named(case, alive)} on the same bus did not restart"] if alive else []


def _named(case: FlightCase, nodes: set[Node]) -> str:
    return ", ".join(f"{node}{case.role(bus, node)}" for bus, node in sorted(nodes)[:4])
