"""Which trouble began it: order by intervals, commands as the sensor of attitude, consequences never as causes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.holes import DISORDER
from analyzer.flight.pulse import STEP
from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.case import FlightCase
from analyzer.flight.verdict.control import lost_control
from analyzer.flight.verdict.escs import got_over
from analyzer.flight.verdict.exchanged import exchanged
from analyzer.flight.verdict.exclusions import could_not_see, excluded, looked_at, recorder_lines
from analyzer.flight.verdict.logged import Logged
from analyzer.flight.verdict.model import SUPPORTS, Verdict
from analyzer.flight.verdict.outages import Outages
from analyzer.flight.verdict.said import Onset
from analyzer.flight.verdict.troubles import troubles
from dissectors.records import dataclass, replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import Excursion
    from analyzer.flight.verdict.model import Excluded
    from analyzer.flight.verdict.trouble import Trouble
    from analyzer.flight.witness import Witness

_WELL, _LIKELY, _POSSIBLE = SUPPORTS
_LOSSY = "the recorder lost frames; nothing wrong seen besides, and the recording ends in flight"
_FITS = (
    "the vehicle flew on; or power was lost: the vehicle's, the recorder's, or the autopilot's if that is the "
    "recorder; or the recorder's plug, disk or wire: nothing tells which"
)
_DISORDER = "cannot tell: parts of the recording are in the wrong order"
_IN_ORDER = "the parts as files of their own: several are read in the order of their times (tailbyte a.log b.log)"
_NO_BITS = ("not told", "fault bits: not told by these ESCs")
_NO_ESC = ("No ESC", "on this bus: motors, propellers and thrust are not judged")
_STOOD = ("fits", "it hit something; or what these motors share failed: an arm, a wire, a supply")
_BENCH = ("bench", "motors are driven one by one: nothing flew, so commands tell nothing of an attitude")
_STATES = frozenset({"thrust", "address"})  # are so all the time
_WHOLE = frozenset({"commands-lost", "commanded", "bus"})  # after which commands say nothing any more
_NEED_CALM = frozenset({"esc", "propulsion", "wiring", "bus", "battery"})  # commands until it began
_SIGNS = frozenset({"fault", "motor", "sag", "spread", "silence", "errors"})
_WITHOUT_POWER = frozenset({"silence", "restart", "power-up"})
_ORDINARY = frozenset({"mode", "join", "arming", "parameter", "save"})


@dataclass(frozen=True, slots=True)
class Judgement:
    """Verdicts on one flight, what came after the first, and what was over before; `began` is a recorded time."""

    verdicts: Sequence[Verdict]
    primary: Sequence[FlightEvent]
    after: Sequence[FlightEvent]
    earlier: Sequence[FlightEvent]
    excluded: Sequence[Excluded]
    looked: Sequence[str]
    lines: Sequence[tuple[str, str]]
    began: int


def judge(
    witness: Witness, events: Sequence[FlightEvent], flight: Flight, border: int, words: Sequence[FlightEvent] = ()
) -> Judgement:
    """Judge a flight; `border` is where the next one begins, or the recording ends (recorded time).

    `words` are those of the autopilot's own log: they speak for or against what the bus tells, and tell no cause.
    """
    case = FlightCase(witness, events, flight, border)
    found = [one for one in troubles(case) if _matters(case, one)]
    if not found and case.excursion is None:
        found = sorted(got_over(case), key=lambda one: one.high)
    verdicts = _verdicts(case, found)
    if verdicts[0].kind == "setup":
        more = tuple(exchanged(case, witness.flights()))
        verdicts = [replace(verdicts[0], reasons=(*verdicts[0].reasons, *more)), *verdicts[1:]]
    shown = verdicts[1] if not verdicts[0].told and len(verdicts) > 1 else verdicts[0]
    first = next((one for one in found if one.kind == shown.kind and one.node == shown.node), None)
    began = _began(case, verdicts[0], first)
    hit = _impact(found) if verdicts[0].kind == "none" else None
    if hit is not None:
        began = hit
    primary = [] if first is None else first.events
    if first is None and case.excursion is not None and shown.frame == case.excursion.event.first.frame:
        primary = [case.excursion.event]
    after = [
        one for one in case.events
        if one not in primary and one.first.ran >= began and one.kind not in _ORDINARY
        and (verdicts[0].kind != "none" or hit is not None)
    ]  # fmt: skip
    earlier = [one for one in case.events if one not in primary and one.first.ran < began and one.kind not in _ORDINARY]
    facts = list(excluded(case, verdicts[0], began))
    if words or witness.side is not None:
        log, onset = Logged(case, witness.side, words), _onset(case, shown, first)
        facts += log.excluded(verdicts[0], onset)
        heard = {id(one): log.heard(one, onset) for one in (verdicts[0], shown)}
        verdicts = [heard.get(id(one), one) for one in verdicts]
    return Judgement(verdicts, primary, after, earlier, facts, looked_at(case), recorder_lines(case), began)


def _onset(case: FlightCase, shown: Verdict, first: Trouble | None) -> Onset:
    """Return between which times a verdict began; what is so all the time, and nothing, are told by the end."""
    if first is not None and first.kind not in _STATES:
        return Onset(first.low, first.high)
    if shown.kind in {"control", "setup"} and case.excursion is not None:
        return Onset(case.excursion.start, case.excursion.stop)
    return Onset(case.stop, case.stop)


def _began(case: FlightCase, verdict: Verdict, first: Trouble | None) -> int:
    if first is not None:
        return first.high
    if verdict.kind in {"control", "setup", "unknown"} and case.excursion is not None:
        return case.excursion.start
    return case.stop + STEP


def _matters(case: FlightCase, one: Trouble) -> bool:
    """Return whether a trouble can have mattered: it began in flight, or has been there all the time."""
    return one.low <= case.stop + lasting("lost") if one.events else True


def _verdicts(case: FlightCase, found: list[Trouble]) -> list[Verdict]:
    """Return the causes in order; what came after control was lost is none of them."""
    lost = case.excursion
    if any(one.sign == DISORDER for one in case.events):
        return [Verdict("unknown", _DISORDER, _POSSIBLE, notes=[("would tell", _IN_ORDER)])]
    if lost is not None and case.in_hole(lost.start):
        return [_missed(lost)]
    hit = _impact(found)
    if hit is not None and (lost is None or hit <= lost.start):
        lost = None  # what goes apart behind it is thrown about
        stood = [one for one in found if one.stands]
        found = [one for one in found if one.high < hit or one.kind in _STATES]
        if not found:
            return [_until(case, next(one for one in stood if one.high >= hit))]
    before = [one for one in found if one.kind in _STATES or lost is None or _may_be_first(case, lost, one)]
    if lost is not None and not [one for one in before if one.kind != "thrust"]:
        return [lost_control(case, lost, found), *(_verdict(case, one) for one in before)]
    if before:
        return _ordered(case, before)
    return [_nothing(case, "nothing wrong seen on this bus") if case.flight.end == "landed" else _end(case)]


def _ordered(case: FlightCase, before: list[Trouble]) -> list[Verdict]:
    """Return troubles as verdicts, behind `unknown` if nobody can tell whether it flew calmly until the first one."""
    first, lost = before[0], case.excursion
    if first.kind in _WHOLE:  # what comes after it comes of it
        before = [one for one in before if one is first or one.kind in _STATES or one.low < first.high]
    shown = [_verdict(case, one) for one in before]
    if first.kind in _NEED_CALM and not case.commanded:
        return [_unordered(case, first), *shown]
    if _powerless(first) and (count := Outages(case).soon_after(first.high)):
        return [_swept(shown[0], count), *shown]
    unrest = case.unrest(first.low) if first.kind in _WHOLE else None
    slack = min(2 * case.period(first.bus, first.node), lasting("seen_with"))
    late = lost is not None and first.high > lost.stop + slack
    if lost is not None and late and first.kind not in _STATES:
        unrest = lost.start, lost.most
    return shown if unrest is None else [_either(shown[0], first, *unrest), *shown]


def _nothing(case: FlightCase, title: str, notes: Sequence[tuple[str, str]] = ()) -> Verdict:
    bench, bare = [_BENCH] if case.one_by_one else [], [] if case.esc_nodes else [_NO_ESC]
    told = [*notes, *bench, *could_not_see(case), *bare]
    return Verdict("none", title, _LIKELY, reasons=looked_at(case), notes=told)


def _until(case: FlightCase, first: Trouble) -> Verdict:
    """Return that nothing was wrong until several rotors stood at once, the `first` of them."""
    found = _nothing(case, "nothing wrong seen on this bus until several rotors stood at once", [_STOOD])
    t, t_end, frame = first.seen
    return replace(found, t=t, t_end=t_end, frame=frame)


def _impact(found: list[Trouble]) -> int | None:
    """Return from when on everything is that of an impact: rotors of several ESCs stand within a moment."""
    stand = [one for one in found if one.kind == "esc" and one.stands]
    for one in stand:
        others = [
            other for other in stand if other.node != one.node and abs(other.high - one.high) <= lasting("impact")
        ]
        if others:
            return min(one.high, *(other.high for other in others)) - lasting("impact")
    return None


def _missed(lost: Excursion) -> Verdict:
    """Return that the recorder lost the moment that matters."""
    event = lost.event
    return Verdict(
        "unknown", "cannot tell: the recorder lost frames when it began", _POSSIBLE, t=(event.before or event.first).t,
        t_end=event.first.t, frame=event.first.frame, notes=(
            ("seen", "calm commands before the hole, commands apart behind it"),
            ("would tell", "the autopilot's own log; a recorder that keeps up (candump -d tells what it loses)"),
        ),
    )  # fmt: skip


def _may_be_first(case: FlightCase, lost: Excursion, one: Trouble) -> bool:
    """Return whether a trouble came before control was lost, or may have: reports are late by their period."""
    if one.high <= lost.stop:
        return True
    return one.low <= lost.start + case.period(one.bus, one.node) and not _lowered(lost, one)


def _lowered(lost: Excursion, one: Trouble) -> bool:
    """Return whether a motor that lifts less was commanded down when control was lost: what fails is commanded up."""
    return one.weak and one.ch in lost.event.lowered


def _either(shown: Verdict, one: Trouble, since: int, spread: float) -> Verdict:
    """Return that nobody can tell: the commands were not calm any more when it happened."""
    return Verdict(
        "unknown", "cannot tell: commands went apart before it, or because of it", _POSSIBLE, one.bus, one.node, one.ch,
        one.chs, shown.t, shown.t_end, shown.frame, notes=(
            ("seen", f"{shown.title} ({shown.kind})"),
            ("but", f"commands went {spread:.0f} % apart, {abs(one.high - since) / SECOND:.2f} s before it is seen"),
            ("would tell", "the autopilot's own log: attitude, and what it says of itself"),
        ),
    )  # fmt: skip


def _powerless(one: Trouble) -> bool:
    """Return whether an ESC alone may have been without power."""
    return one.kind == "wiring" and one.first is not None and one.first.kind in _WITHOUT_POWER


def _swept(shown: Verdict, count: int) -> Verdict:
    """Return that nobody can tell: one ESC was without power, and nearly all others so soon after it."""
    return Verdict(
        "unknown", "cannot tell: one ESC was without power first, and soon nearly all of them", _POSSIBLE, shown.bus,
        None, None, (), shown.t, shown.t_end, shown.frame, notes=(
            ("seen", f"{shown.title} ({shown.kind})"),
            ("but", f"{count} ESCs are so within {lasting('follows') / SECOND:.1f} s, one after the other"),
            ("fits", "the supply of all of them; or that one alone, and a vehicle that came down with it"),
            ("would tell", "a power module on the bus; the autopilot's own log: voltage, height and attitude"),
        ),
    )  # fmt: skip


def _unordered(case: FlightCase, one: Trouble) -> Verdict:
    """Return that nobody can tell: commands are the sensor of attitude, and none are recorded."""
    shown = _verdict(case, one)
    return Verdict(
        "unknown", "cannot tell: no commands are recorded, so nobody knows whether it flew calmly until then",
        _POSSIBLE, one.bus, one.node, one.ch, one.chs, shown.t, shown.t_end, shown.frame, notes=(
            ("seen", f"{shown.title} ({shown.kind})"),
            *(("", reason) for reason in one.reasons),
            ("would tell", "a recording with the commands; the autopilot's own log"),
        ),
    )  # fmt: skip


def _verdict(case: FlightCase, one: Trouble) -> Verdict:
    """Return a trouble as a verdict: how well it is supported is counted from what speaks for and against it."""
    reasons, against = list(one.reasons), list(one.against)
    lost = case.excursion
    support = _POSSIBLE if one.possible else _WELL if len(one.reasons) > 1 else _LIKELY
    if one.kind in _NEED_CALM and not case.commanded:
        support = _POSSIBLE
        against.append("no commands are recorded: whether it flew calmly until then is not known")
    elif one.kind not in _STATES:
        if lost is not None and one.high > lost.start:
            against.append("the reports are too slow to say whether it came before the commands went apart")
            support = _LIKELY if support == _WELL else _POSSIBLE
        elif lost is not None:
            apart = next((swing.start for swing in case.swings if swing.start >= one.high), lost.start)
            reasons.append(f"commands were calm until then, and went apart {(apart - one.high) / SECOND:.2f} s later")
        elif case.commanded and case.unrest(one.low) is None:
            reasons.append("commands were calm until then")
    return Verdict(
        one.kind, f"{_who(case, one)}{one.title}", support, one.bus, one.node, one.ch, one.chs, *one.seen,
        tuple(reasons), tuple(against),
        (*one.notes, *([] if case.esc_nodes else [_NO_ESC]), *([_NO_BITS] if one.ch in case.bitless() else [])),
    )  # fmt: skip


def _who(case: FlightCase, one: Trouble) -> str:
    if one.node is None or one.kind == "address":
        return ""
    if one.ch is not None:
        return f"ESC ch{one.ch} (node {one.node}): "
    if (one.bus, one.node) in case.esc_nodes:
        return f"ESC node {one.node}: "
    return "" if one.kind in {"commands-lost", "commanded"} else f"node {one.node}{case.role(one.bus, one.node)}: "


def _end(case: FlightCase) -> Verdict:
    """Return what can be said of a flight that just ends."""
    flight = case.flight
    turning = f"{len(case.esc_nodes)} ESCs reporting, " if case.esc_nodes else ""
    calm = case.pulse.spread(case.stop - lasting("calm_again"), case.stop)
    commands = "commands apart" if len(calm) and float(calm.max()) > case.calm_limit else "commands calm"
    if not case.commanded:
        commands = "no commands recorded"
    over = any(one.kind in _SIGNS for one in case.events)
    lowest, highest = case.volts()
    sunk = lowest < highest * (1 - threshold("sink_percent") / 100)
    wrong = f"{highest:.1f} V at first, {lowest:.1f} V at the lowest" if sunk else "nothing wrong until then"
    seen = f"{turning}{commands}, {'nothing wrong that lasted' if over else wrong}"
    if flight.end == "cut" and len(case.joint) >= threshold("joint_often"):
        holes = f"{len(case.joint)} times several senders are silent together, and their transfer IDs run on"
        return Verdict("recorder", _LOSSY, _LIKELY, reasons=(holes, f"{seen}, as far as it was recorded"))
    if (
        not over
        and not sunk
        and case.measured
        and (slowest := max((case.period(*node) for node in case.esc_nodes), default=0))
    ):
        before = f"an ESC or motor that failed more than {slowest / SECOND:.2f} s before; a sag of the pack before"
    else:
        before = ""
    would = ("would tell", "the autopilot's own log; a recorder with a battery of its own; error frames (candump -e)")
    at_once = ", for every sender at once" if _at_once(case) else ""
    then = f"the recording ends{at_once}" if flight.end == "cut" else "the reports end, and others go on"
    notes = [("last seen", f"{seen}; then {then}"), *([("fits", _FITS)] if flight.end == "cut" else [])]
    notes += [("does not", before)] if before and flight.end == "cut" else []
    notes += [*could_not_see(case), would]
    return Verdict(
        "unknown", "cannot tell: the recording ends in flight" if flight.end == "cut" else "cannot tell",
        _POSSIBLE, t=flight.last.t, t_end=flight.last.t, frame=flight.frame_end, notes=notes,
    )  # fmt: skip


def _at_once(case: FlightCase) -> bool:
    """Return whether every sender went on to the end, as far as its own period tells."""
    told = [one for one in case.paces if one.usual]
    return len(told) > 1 and all(case.border - one.last <= 2 * one.usual + STEP for one in told)
