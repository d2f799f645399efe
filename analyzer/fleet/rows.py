"""The rows of one capture for the tables of the store."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from math import isfinite
from typing import TYPE_CHECKING, Any

from analyzer.fleet.tables import TABLES
from analyzer.tables import raw_rows
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.app.run import Run
    from analyzer.fleet.jobs import Job
    from analyzer.flight.verdict.model import Triage
    from analyzer.flight.witness import Witness
    from analyzer.report.model import Finding, Report

    Rows = dict[str, list[dict[str, Any]]]


def day(t_ns: int) -> str:
    """Return the day of a time, in UTC."""
    return datetime.fromtimestamp(t_ns // SECOND, UTC).date().isoformat()


def of_job(job: Job) -> dict[str, Any]:
    """Return the columns of `captures` that are known before anything is read."""
    names = ("url", "etag", "version", "settings", "vehicle", "date")
    return {name: getattr(job, name) for name in names}


def without_result(url: str, outcome: str, reason: str) -> dict[str, Any]:
    """Return the row of `captures` of one without any."""
    empty = dict.fromkeys(TABLES["captures"].names[2:])
    texts = dict.fromkeys(("etag", "sha256", "version", "settings", "vehicle", "date", "form", "damage"), "")
    counts = dict.fromkeys(("frames", "transfers", "flights", "flight_ns", "bytes"), 0)
    return {**empty, **texts, **counts, "url": url, "outcome": outcome, "error": reason}


def of_report(report: Report, run: Run) -> Rows:
    """Return captures, findings, rules and nodes. Raises the error of a capture of which nothing could be read."""
    (capture,) = report.captures
    verdict = "fail" if report.gate.failed else "pass" if report.gate.judged else "not judged"
    return {
        "captures": [{
            **without_result(run.source.name, "", ""),
            "sha256": capture.sha256, "verdict": verdict, "form": capture.form, "start_ns": capture.start_ns,
            "end_ns": capture.end_ns, "frames": capture.frames, "transfers": capture.transfers,
            "damage": capture.damage,
        }],
        "findings": [_finding(one) for one in report.findings],
        "rules": [
            {"rule": one.rule, "verdict": one.verdict, "findings": one.findings, "reason": one.reason}
            for one in report.rules
        ],
        "nodes": [
            {
                "bus": one.bus, "node": one.node, "label": one.label, "name": one.name, "role": one.role,
                "software": one.software, "transfers": sum(one.types.values()), "hz": one.hz, "bad": one.bad,
                "first_ns": one.first_ns, "last_ns": one.last_ns,
            }
            for one in capture.nodes
        ],
    }  # fmt: skip


def _finding(one: Finding) -> dict[str, Any]:
    names = (
        "rule", "title", "severity", "category", "origin", "clause", "bus", "node", "label", "type", "cause", "text",
        "count", "fails",
    )  # fmt: skip
    return {name: getattr(one, name) for name in names} | {
        "detail": one.key,
        "t_ns": one.first.t_ns,
        "t_end_ns": one.last.t_ns,
        "frame": one.first.frame,
        "frame_end": one.last.frame,
        "waived": one.waiver is not None,
    }


def happened(witness: Witness, found: Triage, buses: Sequence[str]) -> Rows:
    """Return flights, events and triage, after the last batch."""
    flights = [
        {
            "flight": one["flight"], "t_ns": one["t"], "t_end_ns": one["t_end"], "ran_ns": one["ran"],
            "ended": one["end"], "told_by": one["by"], "chs": " ".join(map(str, one["chs"])),
        }
        for one in raw_rows(witness.flight_table())
    ]  # fmt: skip
    events = [
        {
            "event": number,
            "t_ns": None if one.before is None else one.before.t,
            "t_end_ns": one.first.t,
            "until_ns": None if one.after is None else one.after.t,
            "bus": _name(one.bus, buses),
            "node": one.node,
            "ch": one.ch,
            "kind": one.kind,
            "type": one.type,
            "text": one.text,
            "clause": one.clause,
            "values": json.dumps({name: value for name, value in one.values.items() if isfinite(value)}),
            "frame": one.first.frame + 1,
        }
        for number, one in enumerate(found.events, 1)
    ]
    verdicts = [
        {
            "place": place,
            "flight": None if found.flight is None else found.flight.number,
            "kind": one.kind,
            "title": one.title,
            "support": one.support if one.told else "",
            "bus": _name(one.bus, buses),
            "node": one.node,
            "ch": one.ch,
            "t_ns": one.t,
            "t_end_ns": one.t_end,
            "frame": None if one.frame is None else one.frame + 1,
        }
        for place, one in enumerate(found.verdicts, 1)
    ]
    return {"flights": flights, "events": events, "triage": verdicts}


def _name(bus: int | None, buses: Sequence[str]) -> str:
    return buses[bus] if bus is not None and bus < len(buses) else ""


def of_health(
    found: Sequence[Mapping[str, Any]], of: Mapping[str, list[dict[str, Any]]], buses: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the rows of ESCs with their software and restarts; `of` are the other rows of the capture."""
    software = {(one["bus"], one["node"]): one["software"] for one in of["nodes"]}
    spans = {one["flight"]: (one["t_ns"], one["t_end_ns"]) for one in of["flights"]}
    result = []
    for one in found:
        bus, node, (low, high) = _name(one["bus"], buses), one["node"], spans[one["flight"]]
        restarts = sum(
            (event["kind"], event["bus"], event["node"]) == ("restart", bus, node) and low <= event["t_end_ns"] <= high
            for event in of["events"]
        )
        result.append({**one, "bus": bus, "software": software.get((bus, node), ""), "restarts": restarts})
    return result
