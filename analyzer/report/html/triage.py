"""Triage as the first section of a page: the verdict and why, time lines, flights, and their events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.report.html.timeline import draw
from analyzer.report.moments import MISSING, clock, moment
from analyzer.report.triage.words import TriageWords, together, who
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.model import Triage

ROWS = 500  # of a table
_AFTER = 12
_CALM = frozenset({"mode", "join", "arming", "parameter", "save"})


def section(found: Triage, number: int = 1) -> dict[str, Any]:
    """Return what the template `triage.html.j2` shows; `number` is that of the section on its page."""
    words, one = TriageWords(found), found.first
    styles = _styles(found)
    shown, left = _rows(found, styles)
    prefix = f"t{number}-event-"
    return {
        "of": found,
        "prefix": prefix,
        "first": one,
        "captures": list(found.captures),
        "span": words.span(found),
        "tone": "bad" if one.told else "good" if found.well else "open",
        "support": one.support if one.told else "",
        "when": words.when(one),
        "parts": [(label, texts) for label, texts in _parts(found, words) if texts],
        "after": _told(found.after, words),
        "said": _told(found.said, words),
        "figures": [draw(line, words, styles, prefix, found.ending) for line in found.timelines],
        "flights": [_flight(flight, found.ending(flight)) for flight in found.flights[:ROWS]],
        "more_flights": max(len(found.flights) - ROWS, 0),
        "events": shown,
        "left": left + found.more,
        "values": any(row["values"] for row in shown),
    }


def _parts(found: Triage, words: TriageWords) -> Iterator[tuple[str, Sequence[str]]]:
    """Yield what speaks for and against the verdict, by label."""
    one = found.first
    yield "Recording", [f"{label}: {text}" for label, text in found.lines]
    for label, text in one.notes:
        yield label.capitalize(), [text]
    if one.told:
        yield "For", one.reasons
        yield "Against", one.against or ["nothing found"]
    yield "Then, or", [
        f"{words.time(other.t_end)} {other.title} ({other.support})" for other in found.verdicts[1:3]
    ]  # fmt: skip
    yield "Ruled out", [f"{excluded.fact}: {excluded.seen}" for excluded in found.excluded]
    if not one.told:
        yield "Looked at", found.looked
    log = found.autopilot
    if log is not None and log["parts"] and not found.said:
        yield "Autopilot", ["its log says nothing within 5 s of it"]
    yield "Not on CAN", [", ".join(found.not_seen)] if found.not_seen else []


def _told(events: Sequence[FlightEvent], words: TriageWords) -> dict[str, Any]:
    """Return events in lines, what befell several together in one, and how many more there are."""
    told = [
        (words.time(one.first.t), whose, f"{one.kind}: {one.text}") for one, whose in together(events)
    ]  # fmt: skip
    return {"lines": told[:_AFTER], "more": max(len(told) - _AFTER, 0)}


def _styles(found: Triage) -> Mapping[int, str]:
    """Return the class of each event: that it began with, what came after it, or what is calm."""
    after = {id(one) for one in found.after}
    first = {id(one) for one in found.primary}
    verdict = found.first
    return {
        id(one): "onset" if id(one) in first or _is_told(one, verdict)
        else "calm" if one.kind in _CALM else "after" if id(one) in after else "before"
        for one in found.events
    }  # fmt: skip


def _is_told(one: FlightEvent, verdict: Any) -> bool:
    """Return whether a verdict names the frame of an event, whichever finder it is of."""
    return bool(verdict.told and (one.first.t, one.first.frame) == (verdict.t_end, verdict.frame))


def _flight(one: Any, how: str) -> dict[str, Any]:
    return {
        "number": one.number,
        "start": moment(one.first.t)[:-3],
        "end": clock(one.last.t),
        "seconds": f"{(one.last.ran - one.first.ran) / SECOND:.1f}",
        "how": how,
        "chs": ", ".join(f"ch{ch}" for ch in one.chs) or MISSING,
        "by": one.by,
    }


def _rows(found: Triage, styles: Mapping[int, str]) -> tuple[list[dict[str, Any]], int]:
    """Return the events as rows, and how many are left out: of more than fit those that matter are kept."""
    numbered = list(enumerate(found.events, 1))
    if len(numbered) > ROWS:
        drawn = {mark.number for line in found.timelines for lane in line.lanes for mark in lane.marks}
        rank = {"onset": 0, "after": 1, "before": 2, "calm": 3}
        numbered.sort(key=lambda pair: (pair[0] not in drawn, rank[styles[id(pair[1])]], pair[0]))
        numbered = sorted(numbered[:ROWS])
    buses = found.buses
    rows = [
        {
            "number": number,
            "style": styles[id(one)],
            "time": clock(one.first.t),
            "within": _within(one),
            "until": MISSING if one.after is None else clock(one.after.t),
            "bus": buses[one.bus] if one.bus is not None and one.bus < len(buses) and len(buses) > 1 else "",
            "who": who(one) if one.source == "bus" else one.source,
            "node": "" if one.node is None or one.ch is None else f"node {one.node}",
            "kind": one.kind,
            "text": one.text,
            "values": ", ".join(f"{name} {value:.4g}" for name, value in list(one.values.items())[:8]),
            "clause": one.clause,
            "frame": one.first.frame + 1 if one.first.frame >= 0 else None,
        }
        for number, one in numbered
    ]
    return rows, len(found.events) - len(rows)


def _within(one: FlightEvent) -> str:
    """Return how long before that the last report came which was otherwise."""
    if one.before is None:
        return "from the start"
    apart = one.first.t - one.before.t
    return "" if apart <= 0 else f"{apart / MILLISECOND:,.0f} ms" if apart < 10 * SECOND else f"{apart / SECOND:,.0f} s"
