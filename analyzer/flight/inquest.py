"""Triage of a capture: what a witness saw becomes an answer."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from analyzer.flight.odd.later import OddLater
from analyzer.flight.thresholds import lasting
from analyzer.flight.timeline.timeline import Drawn, time_lines
from analyzer.flight.verdict.exclusions import looked_at_rest
from analyzer.flight.verdict.judge import judge
from analyzer.flight.verdict.model import Triage, Verdict
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.flight.clock import Spot
    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.timeline.timeline import TimeLine
    from analyzer.flight.verdict.judge import Judgement
    from analyzer.flight.witness import Witness

_USUAL = frozenset({"mode", "join", "arming", "parameter", "save"})  # of a vehicle that stands
_ORDINARY = _USUAL | {"message", "health"}  # that alone are nothing wrong
NOT_SEEN = ("attitude", "GPS", "pilot", "who decided a command")
_SENT = {"attitude": "Solution", "GPS": "Fix"}  # how the types begin that tell it: ahrs.Solution, gnss.Fix


def inquest(
    witness: Witness, captures: Sequence[str], buses: Sequence[str], *, start: int | None, end: int | None,
    frames: int, commands: Callable[[Verdict, Flight | None], Sequence[str]],
) -> Triage:  # fmt: skip
    """Return what happened, after the last batch: of the last flight. `commands` are what to do next.

    What the autopilot's own log says speaks for or against it; the verdict is that of the bus.
    """
    events, flights = witness.events(), witness.flights()
    find = partial(witness.odd, flights)
    made = partial(
        Triage,
        captures,
        buses,
        start,
        end,
        frames,
        flights,
        events=events,
        more=witness.more,
        not_seen=_not_seen(witness),
        autopilot=witness.autopilot,
        odds=OddLater(find),
    )
    if not flights:
        why = _unjudged(witness, events, start, frames)
        empty = start is None or not witness.losses.transfers
        seen = [one for one in events if one.source == "bus" and one.kind not in _USUAL]
        looked = [] if empty else looked_at_rest(witness)
        still = not empty and all(one.kind in _ORDINARY for one in seen)
        verdict = Verdict("none" if still else "unknown", why, "possible", reasons=looked)
        return made(
            None, [verdict], earlier=seen, judged=why, empty=empty, looked=looked, commands=commands(verdict, None)
        )  # fmt: skip
    flight = flights[-1]
    bus, words = ([one for one in events if (one.source == "bus") == told] for told in (True, False))
    border = max([witness.clock.ran or flight.last.ran, *(one.first.ran for one in bus)])
    found = judge(witness, bus, _whole(flights, bus), border, words)
    said = [one for one in words if _belongs(one, found, flight)]
    return made(
        flight, found.verdicts, after=found.after, earlier=found.earlier, excluded=found.excluded, looked=found.looked,
        lines=found.lines, primary=found.primary, said=said, commands=commands(found.verdicts[0], flight),
        timelines=_timelines(witness, events, flights, found.verdicts[0]),
        odds=OddLater(find, found.began if found.verdicts[0].told else None),
    )  # fmt: skip


def _not_seen(witness: Witness) -> Sequence[str]:
    """Return what is never on the bus, but for what somebody sends on this one."""
    sent = {one.type.rpartition(".")[2] for one in witness.paces}
    return [what for what in NOT_SEEN if not any(name.startswith(_SENT.get(what, "-")) for name in sent)]


def _belongs(one: FlightEvent, found: Judgement, flight: Flight) -> bool:
    """Return whether a word of the autopilot belongs to an answer: said around it, of none any error in flight."""
    if abs(one.first.ran - found.began) <= lasting("said_around"):
        return True
    inside = flight.first.ran <= one.first.ran <= flight.last.ran
    return not found.verdicts[0].told and inside and one.kind in {"autopilot error", "low battery"}


def _whole(flights: Sequence[Flight], events: Sequence[FlightEvent]) -> Flight:
    """Return the last flight, with those before it that it goes on from: nobody lands and starts again at once."""
    whole, powered = flights[-1], [one.first.ran for one in events if one.kind in {"restart", "join"}]
    for one in reversed(flights[:-1]):
        apart = whole.first.ran - one.last.ran > lasting("landed")
        if apart or any(one.last.ran <= at <= whole.first.ran for at in powered):
            break
        whole = replace(whole, first=one.first, chs=tuple(sorted({*one.chs, *whole.chs})))
    return whole


def _timelines(
    witness: Witness, events: Sequence[FlightEvent], flights: Sequence[Flight], verdict: Verdict
) -> Sequence[TimeLine]:  # fmt: skip
    clock = witness.clock
    if witness.courses is None or clock.start is None or clock.ran is None:
        return ()
    last = max([clock.ran, *(one.first.ran for one in events if one.source == "bus")])
    onset = _onset(events, verdict)
    return list(time_lines(Drawn(witness.courses, events, flights, flights[-1], onset, clock.start, last)))


def _onset(events: Sequence[FlightEvent], verdict: Verdict) -> tuple[Spot, Spot] | None:
    """Return the last good report and the first bad one, where an event tells them."""
    for one in events:
        if one.source == "bus" and (one.first.t, one.first.frame) == (verdict.t_end, verdict.frame):
            return one.before or one.first, one.first
    return None


def _unjudged(witness: Witness, events: Sequence[FlightEvent], start: int | None, frames: int) -> str:
    if not frames:
        errors = any(one.kind == "errors" for one in events)
        return f"not judged: {'error frames, and no other' if errors else 'no CAN frame is in it'}"
    if start is None:
        return "not judged: the capture has no times"
    if not witness.losses.transfers:
        return "not judged: no transfer of DroneCAN"
    reports = sum(one.count for one in witness.escs)
    if witness.escs:
        nodes = len({(one.bus, one.node) for one in witness.escs})
        count = f"{reports} report{'s' * (reports != 1)} of {nodes} ESC{'s' * (nodes != 1)}"
        turned = any(one.ways for one in witness.escs)
        how = "motors turned for 0.3 s or less" if turned else "motors stopped"
        return f"not judged: {count}, {how}"
    back = "" if (witness.clock.last or 0) >= start else "; its times go backwards: are its lines in reverse order?"
    return f"not judged: no ESC reports, nobody was armed{back}"
