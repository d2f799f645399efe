"""Troubles of one ESC alone: it fails, its load is gone, its wire or its power is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.motors.events import UNDRIVEN, UNLOADED
from analyzer.flight.pulse import STEP
from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.outages import Outages, began_anew
from analyzer.flight.verdict.trouble import by_node, counts, harmless, made, text, together
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase, Node
    from analyzer.flight.verdict.trouble import Trouble

_FAILS = ("motor", "electronics", "failed")  # signs by which an ESC says so
_WARNINGS = ("heat", "current", "supply")  # signs that speak for a failure, and are none
_AWAY = frozenset({"silence", "restart", "power-up"})
_PAUSE_MS = 100  # in commands, that an ESC does not mind


def esc_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield what one ESC alone shows."""
    doubtful = _many_blades(case)
    telling = [
        one for one in case.events
        if (one.kind in {"fault", "motor"} or (one.kind == "mode" and one.sign)) and counts(case, one)
        and not (doubtful and _partly(one))
    ]  # fmt: skip
    if case.tips:  # what an ESC says since before take-off is why it tips over
        telling += [one for one in case.standing if one.kind == "fault" and one.sign in {*_FAILS, "uncommanded"}]
    quiet = [one for one in case.events if one.kind in _AWAY and not case.in_joint_loss(one)]
    everybody = together(case, [one for one in telling if one.sign == "uncommanded"])
    outages = Outages(case)
    swept = outages.together
    gone = swept or together(case, [one for one in quiet if one.kind != "power-up"])
    for node, events in by_node(sorted((*telling, *quiet), key=lambda one: one.first.ran)).items():
        if node not in case.esc_nodes:
            continue
        signs = [one for one in events if one.kind in {"fault", "motor", "mode"}]
        lost = [one for one in signs if one.sign == "uncommanded"]
        own = [one for one in signs if one.sign in _FAILS or one.kind == "motor"]
        off = [one for one in events if one.kind in _AWAY]
        if lost and not everybody and _commanded(case, lost[0]):
            yield made("wiring", "says that it got no commands, though the bus carried them", lost + own, 1, [
                f"{text(lost[0])}; commands at {_rate(case, lost[0]):.0f}/s all the time",
                "the others say nothing of that: its wire, its receive filter or its firmware",
            ])  # fmt: skip
            own = [one for one in own if one.first.ran < lost[0].first.ran - lasting("together")]
        if swept:
            since = min((one.low for one in outages.all if one.node == node), default=case.border)
            own = [
                one for one in own
                if one.first.ran < outages.all[0].high and (one.sign != UNDRIVEN or one.first.ran <= since)
            ]  # fmt: skip
        away = _quiet(case, node, off, own) if off and not gone else None
        if away is not None:
            yield away
            own = [one for one in own if one.first.ran < away.high and one not in away.events]
        if own and not everybody:
            warned = [one for one in signs if one.sign in _WARNINGS and one.first.ran <= own[0].first.ran]
            now = [one for one in own if one.first.ran - own[0].first.ran <= lasting("together")]
            yield _cut_off(case, node, now) or _own(case, now, warned)


def _many_blades(case: FlightCase) -> bool:
    """Return whether several ESCs ever tell that a part of their load is gone: not each of them loses a blade."""
    nodes = {one.node for one in case.events if _partly(one)}
    return len(nodes) > max(1, len(case.esc_nodes) // 4)


def _partly(one: FlightEvent) -> bool:
    """Return whether a motor's load is a little off, as by a blade, or by a law of currents that is not its own."""
    return one.kind == "motor" and one.sign == UNLOADED and one.values["current_share"] > threshold("motor_bare")


def got_over(case: FlightCase) -> Iterator[Trouble]:
    """Yield motors that lost their speed in the air and found it again, after which the vehicle flew on calmly."""
    broken = [
        one for one in case.events
        if one.kind == "motor" and one.values["speed_share"] < threshold("motor_once_slow")
        and one.after is not None and not case.in_joint_loss(one) and not counts(case, one)
    ]  # fmt: skip
    for events in by_node(() if case.one_by_one else broken).values():
        found = _own(case, events, [])
        calm = (case.stop - events[-1].after.ran) / SECOND if events[-1].after is not None else 0.0
        found.against.append(f"it was over, and the vehicle flew on calmly for {calm:.1f} s")
        yield found


def _cut_off(case: FlightCase, node: Node, own: list[FlightEvent]) -> Trouble | None:
    """Return an ESC that is not driven while its transfers get lost: its wire carries neither way."""
    if own[0].kind != "motor" or own[0].sign != UNDRIVEN:
        return None
    missing = case.losses.missing(case.start, own[0].first.ran, [node])
    others = case.losses.missing(case.start, own[0].first.ran, case.esc_nodes - {node})
    if missing < threshold("cut_off_missing") or others:
        return None
    found = made("wiring", "lost contact again and again, and its motor with it: its plug or its wire", own, 2, [
        text(own[0]), f"{missing} of its transfer IDs are missing, none of the other ESCs'",
    ])  # fmt: skip
    found.begin(case.losses.since(node, own[0].first), case.period(*node))
    return found


def _own(case: FlightCase, own: list[FlightEvent], warned: list[FlightEvent]) -> Trouble:
    """Return what an ESC's own signs say: its load is gone, or it does not drive its motor."""
    motor = next((one for one in own if one.kind == "motor"), None)
    told = [one for one in own if one.kind != "motor" and one.sign in _FAILS]
    if not told and motor is not None and motor.sign == UNLOADED:
        bits = [] if own[0].ch in case.bitless() else ["no fault bit of it"]
        bare = motor.values["current_share"] <= threshold("motor_bare")
        lost = "the load of its motor: propeller" if bare else "a part of the load of its motor: a damaged blade"
        return made("propulsion", f"lost {lost}", own, 2, [text(motor), *bits])
    reasons = [*(text(one) for one in warned[:1]), *(text(one) for one in own[:3])]
    if told or motor is None:
        return made("esc", "stopped driving its motor as it should", own, 2, reasons)
    hotter, heat = _heat(case, own[0])
    given = motor.values.get("reported_share")
    limited = (
        motor.values["speed_share"] >= threshold("limited_least") and hotter
        if given is None
        else (given >= threshold("limited_least"))
    )
    if motor.sign == UNDRIVEN and limited:
        found = made("esc", "limits itself: it gives less than is commanded", own, 2, reasons)
        found.possible = not warned
        (found.reasons if hotter else found.against).extend(heat)
        return found
    if motor.sign == UNDRIVEN:
        return made("esc", "does not drive its motor as commanded", own, 2, reasons)
    last = case.stop if motor.after is None else motor.after.ran
    time = f" for {(last - motor.first.ran) / SECOND:.1f} s" if motor.after is not None else ""
    return made("esc", f"lost its motor{time} (desync or blocked: the bus cannot tell)", own, 2, reasons)


def _heat(case: FlightCase, one: FlightEvent) -> tuple[bool, list[str]]:
    """Return whether an ESC was hotter than all others, and how hot they were."""
    hot = {esc.ch: esc.ranges["temperature"][1] for esc in case.escs if "temperature" in esc.ranges}
    mine = hot.pop(one.ch, None)
    if mine is None or not hot:
        return False, []
    hotter = mine - max(hot.values()) >= threshold("hotter_c")
    word = "hotter" if hotter else "no hotter"
    return hotter, [f"{word} than the others: {mine:.0f} C at most, they {max(hot.values()):.0f} C"]


def _quiet(case: FlightCase, node: Node, off: list[FlightEvent], own: list[FlightEvent]) -> Trouble | None:
    """Return an ESC that stops reporting: for good, with holes, or to start anew; `own` is what its motor did."""
    restarts = [one for one in off if one.kind == "restart"]
    silent = [
        one for one in off if one.kind == "silence" and (one.after is None or not case.others_lost(node, one))
    ]  # fmt: skip
    if not silent and not restarts:
        return None
    lasting_ = [one for one in silent if one.after is None]
    others = [esc for esc in case.esc_nodes if esc != node]
    begin = silent or restarts
    reasons, kind = [], "wiring"
    if restarts and any(one.first.ran >= begin[0].first.ran for one in restarts):
        title = "restarted in flight: its power was away"
        reasons.append(restarts[0].text)
    elif lasting_:
        title = "stopped reporting: its power, its wire or its transmitter"
        reasons.append(text(lasting_[0]))
        if case.commanded and case.excursion is None:
            reasons.append("the commands did not shift to the others: whether its motor stopped is not known")
    elif all(harmless(case, one) for one in silent) and len(silent) < 2:
        return None
    else:
        jumps = sum(one.values.get("missing", 0) > 0 for one in silent)
        times = "once" if len(silent) == 1 else f"{len(silent)} times"
        lengths = sorted(one.values["silent_s"] for one in silent)
        span = f"{1000 * lengths[0]:.0f} ms" + (f" to {1000 * lengths[-1]:.0f} ms" if len(silent) > 1 else "")
        end = silent[-1].after or silent[-1].first
        torn = case.losses.broken(case.span(silent[0])[0], end.ran, [node])
        torn = torn if torn >= threshold("cut_off_missing") else 0
        if jumps or torn:
            title = f"stopped reporting {times}: its plug or its wire"
            sent = [f"behind {jumps} of them its transfer IDs jump"] if jumps else []
            sent += [f"{torn} broken transfers of it about then"] if torn else []
            reasons.append(f"silent {times}, {span}; {', '.join(sent)}: it went on sending")
        else:
            title = f"stopped reporting {times}: it did not send"
            reasons.append(f"silent {times}, {span}; its transfer IDs run on: it did not send, so it was not the wire")
            kind = "esc"
    low, high = begin[0].first.ran - lasting("looked_back"), begin[-1].first.ran
    found = made(kind, title, sorted((*silent, *restarts), key=lambda one: one.first.ran), 3, reasons)
    if kind == "wiring" and not restarts:
        found.begin(case.losses.since(node, begin[0].first), case.period(*node))
    if restarts and (restarts[0].before or restarts[0].first).ran <= found.high:
        # What is not driven for a moment because its ESC starts anew tells that moment, and nothing else.
        same = [one for one in off if one.kind == "power-up"] + [one for one in own if one.sign == UNDRIVEN]
        since, first = began_anew(case, restarts[0], [*silent, *same])
        found.events += [one for one in same if since <= one.first.ran and case.span(one)[0] <= restarts[0].first.ran]
        found.begin(first.first, first.first.ran - since)
    if others:
        missing = case.losses.missing(low, high, others)
        line = f"the others: {missing} transfer IDs missing in that time"
        (found.against if missing else found.reasons).append(line)
    return found


def _commanded(case: FlightCase, one: FlightEvent) -> bool:
    """Return whether the bus carried commands before an ESC said that it got none; what was in a hole nobody knows."""
    start = (one.before or one.first).ran - lasting("together")
    if any(other.kind == "gap" and start <= other.first.ran <= one.first.ran for other in case.events):
        return False
    return case.pulse.count(start, one.first.ran) > 0 and case.pulse.longest(start, one.first.ran) < _PAUSE_MS


def _rate(case: FlightCase, one: FlightEvent) -> float:
    return case.pulse.rate(one.first.ran - lasting("together"), one.first.ran - STEP)
