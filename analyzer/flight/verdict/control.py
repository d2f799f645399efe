"""Control that is lost first: commands go apart while every device is healthy and obeys."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.thresholds import threshold
from analyzer.flight.verdict.model import Verdict
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.verdict.case import Excursion, FlightCase
    from analyzer.flight.verdict.trouble import Trouble

_TIPPED = "it tipped over at take-off, and no ESC says why: a motor, propeller, index or setting is wrong"


def lost_control(case: FlightCase, lost: Excursion, found: Sequence[Trouble]) -> Verdict:
    """Return that control was lost before anything else, or was never there.

    An ESC that is commanded and reports nothing may have failed first: then nobody can tell.
    """
    event = lost.event
    took = max(0, event.first.ran - lost.start) / SECOND
    wide = min(threshold("spread_percent"), lost.most)
    later_apart = f"{wide:.0f} % {took:.2f} s later, {lost.most:.0f} % in the end"
    reasons = [f"commands {case.calm_limit:.0f} % apart at most until then, {later_apart}"]
    later = next((one for one in found if one.events), None)
    healthy = f"until {(later.high - lost.start) / SECOND:.1f} s later" if later is not None else "to the end"
    escs = len(case.esc_nodes)
    told = any(one.kind == "fault" and one.first.ran < lost.start for one in case.events)
    without = "" if case.bitless() or told else "without a fault bit "
    fine = "go on reporting" if case.tips else "obey"
    reasons.append(f"{'all ' * (escs > 1)}{escs} ESCs {fine} {without}{healthy}" if escs else "no ESC reports")
    t = event.first.t - max(0, event.first.ran - lost.start)
    gone = [case.name(node) for node in case.gone(lost.stop)]
    if case.tips and not case.unheard and not gone:
        esc = case.esc_of(int(event.values.get("highest_ch", 0)))
        took = max(0.1, (lost.start - case.start) / SECOND)
        reasons.append(f"it tips over within {took:.1f} s of the motors turning")
        if esc is not None:
            reasons.append(f"ch{esc.ch} is commanded up most, in vain: it lifts least, or the wrong way")
        reasons += [*case.changed(), *case.turning()]
        node, ch = (None, None) if esc is None else (esc.node, esc.ch)
        return Verdict(
            "setup", _TIPPED, "possible", event.bus, node, ch, (), t, event.first.t, event.first.frame, tuple(reasons),
            ("no report says so; a broken airframe or sensor looks alike",),
        )  # fmt: skip
    if case.unheard or gone:
        which = _commanded(case.unheard) if escs else "no ESC reports"
        if gone:
            which = f"{' '.join(gone)} report{'s' * (len(gone) == 1)} nothing any more"
        return Verdict(
            "unknown", f"cannot tell: control was lost, and {which}", "possible", event.bus, None, None, (), t,
            event.first.t, event.first.frame, notes=(
                ("seen", reasons[0]),
                ("fits", "a motor, propeller or ESC that is not heard here; or airframe, sensors, filter, pilot"),
                ("would tell", "a recording of all buses with the reports of all ESCs; the autopilot's own log"),
            ),
        )  # fmt: skip
    if unlearned := case.unlearned(lost.start):
        return _unseen(case, lost, reasons[0], [case.name(node) for node in unlearned])
    return Verdict(
        "control", "not an ESC: control was lost first", "likely", event.bus, None, None, (), t, event.first.t,
        event.first.frame, tuple(reasons), (),
    )  # fmt: skip


def _unseen(case: FlightCase, lost: Excursion, seen: str, escs: Sequence[str]) -> Verdict:
    """Return that control was lost before anybody could know whether the ESCs obey."""
    event = lost.event
    if case.takes_off:
        title = "cannot tell: control was lost before each motor had shown what it does at a command"
    else:
        title = "cannot tell: the recording begins in flight, and control was lost before motors can be compared"
    return Verdict(
        "unknown", title, "possible", event.bus, None, None, (), event.first.t - max(0, event.first.ran - lost.start),
        event.first.t, event.first.frame, notes=(
            ("seen", seen),
            ("unknown", f"whether {' '.join(escs)} obeyed: too few calm reports before, or off since then"),
            ("fits", "a motor, propeller or ESC whose report says nothing; or airframe, sensors, filter, pilot"),
            ("would tell", "reports more often, or from before; the autopilot's own log"),
        ),
    )  # fmt: skip


def _commanded(chs: Sequence[int]) -> str:
    names, one = " ".join(f"ch{ch}" for ch in chs), len(chs) == 1
    return f"{names} {'is' if one else 'are'} commanded, and nobody reports as {'that' if one else 'these'}"
