"""Triage for programs: one JSON object, as `schema.json` describes it."""

from __future__ import annotations

import json
from importlib.resources import files
from math import isfinite
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.odd.judge import OddEsc
    from analyzer.flight.verdict.model import Triage, Verdict

SCHEMA = "tailbyte.triage/1"


def render(found: Triage) -> str:
    """Return it as text."""
    return json.dumps(plain(found), indent=2, allow_nan=False) + "\n"


def schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of `render`."""
    found: dict[str, Any] = json.loads(files(__package__).joinpath("schema.json").read_text("utf-8"))
    return found


def plain(found: Triage) -> Mapping[str, Any]:
    """Return it; times are nanoseconds of the capture's clock, frames count from 1, channels as people count them."""
    buses = list(found.buses)
    return {
        "schema": SCHEMA,
        "capture": list(found.captures),
        "buses": buses,
        "start_ns": found.start,
        "end_ns": found.end,
        "frames": found.frames,
        "judged": not found.judged,
        "why_not": found.judged or None,
        "flight": None if found.flight is None else found.flight.number,
        "flights": [_flight(one) for one in found.flights],
        "verdicts": [_verdict(one, buses) for one in found.verdicts],
        "after": [_event(one, buses) for one in found.after],
        "earlier": [_event(one, buses) for one in found.earlier],
        "odd": [_odd(one, buses) for one in found.odd],
        "facts": list(found.facts),
        "excluded": [{"fact": one.fact, "seen": one.seen} for one in found.excluded],
        "looked_at": list(found.looked),
        "not_seen": list(found.not_seen),
        "recording": [{"label": label, "text": text} for label, text in found.lines],
        "events": [_event(one, buses) for one in found.events],
        "more_events": found.more,
        "said": [_event(one, buses) for one in found.said],
        "autopilot": None if found.autopilot is None else dict(found.autopilot),
        "next": list(found.commands),
    }


def _flight(one: Flight) -> Mapping[str, Any]:
    return {
        "number": one.number, "start_ns": one.first.t, "end_ns": one.last.t, "end": one.end, "chs": list(one.chs),
        "by": one.by,
    }  # fmt: skip


def _verdict(one: Verdict, buses: list[str]) -> Mapping[str, Any]:
    return {
        "kind": one.kind,
        "title": one.title,
        "bus": None if one.bus is None else buses[one.bus] if one.bus < len(buses) else None,
        "node": one.node,
        "ch": one.ch,
        "chs": list(one.chs),
        "support": one.support,
        "t_ns": one.t,
        "t_end_ns": one.t_end,
        "frame": None if one.frame is None else one.frame + 1,
        "for": list(one.reasons),
        "against": list(one.against),
        "notes": [{"label": label, "text": text} for label, text in one.notes],
    }


def _odd(one: OddEsc, buses: list[str]) -> Mapping[str, Any]:
    return {
        "bus": buses[one.bus] if one.bus < len(buses) else None,
        "node": one.node,
        "ch": one.ch,
        "quantity": one.quantity,
        "z": one.z,
        "difference": one.difference,
        "unit": one.unit,
        "since_ns": one.since,
        "against": one.against,
        "text": one.text,
    }


def _event(one: FlightEvent, buses: list[str]) -> Mapping[str, Any]:
    return {
        "t_ns": None if one.before is None else one.before.t,
        "t_end_ns": one.first.t,
        "until_ns": None if one.after is None else one.after.t,
        "frame": one.first.frame + 1 if one.first.frame >= 0 else None,
        "kind": one.kind,
        "source": one.source,
        "bus": None if one.bus is None else buses[one.bus] if one.bus < len(buses) else None,
        "node": one.node,
        "ch": one.ch,
        "text": one.text,
        "sign": one.sign,
        "type": one.type,
        "clause": one.clause,
        "values": {name: value for name, value in one.values.items() if isfinite(value)},
    }
