"""A supply that fails: all ESCs are away at once, or voltages fall that no current explains."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.outages import Outages
from analyzer.flight.verdict.trouble import made, within
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase
    from analyzer.flight.verdict.trouble import Trouble


def supply_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield a supply that fails: all ESCs away at once, or voltages that no current explains."""
    away = Outages(case)
    if away.together:
        yield _outage(case, away)
    sags = [
        one for one in case.events if one.kind == "sag" and (one.bus, one.node) in case.esc_nodes and unexplained(one)
    ]  # fmt: skip
    if not sags:
        return
    if any(one.first.ran <= sags[0].first.ran for one in case.events if _loads(one)):
        return  # it is what they draw
    chs = tuple(sorted({one.ch for one in sags if one.ch is not None}))
    worst = min(sags, key=lambda one: one.values["worst_voltage"])
    count = len(case.escs_by_channel)
    part = 0 < len(chs) < count and _others_keep(case, chs, worst.values["worst_voltage"])
    if not part and 0 < len(chs) < threshold("nearly_all") * count:
        return  # a pack that the others load
    first = sags[0]
    took = first.first.ran - (first.before or first.first).ran
    how = "sank" if took > lasting("sag") else "broke down"
    high, low, expected = (worst.values[name] for name in ("voltage", "worst_voltage", "expected_voltage"))
    reasons = [f"{high:.1f} -> {low:.1f} V; its current explains {expected:.1f} V"]
    keeping = f"the other {count - len(chs)} ESCs keep their voltage"
    if part and len(chs) == 1:
        trouble = made("wiring", f"its supply {how}: its plug, its joint or its cable", sags, 0, [*reasons, keeping])
    elif part:
        some = " ".join(map(str, chs))
        reasons += [f"channels {some} share a supply: their voltages fall together", keeping]
        trouble = made("battery", f"the supply of channels {some} {how}", sags, 0, reasons, whole=True)
    else:
        trouble = made("battery", f"the supply of all ESCs {how}", sags, 0, reasons, whole=True)
    if trouble.kind == "battery":
        trouble.chs = chs
    if how == "sank":
        trouble.possible = True
        trouble.against.append(f"it took {took / SECOND:.1f} s to be seen: a pack that is empty looks alike")
    yield trouble


def _outage(case: FlightCase, away: Outages) -> Trouble:
    """Return that ESCs were without a supply at the same time."""
    mine, anew = [one.event for one in away.all], sum(one.anew for one in away.all)
    count, every = len(mine), len(case.esc_nodes)
    some = "all ESCs" if count == every else f"{count} of {every} ESCs"
    when = f"within {within(mine)}"
    if not anew:
        title, told = "lost their supply together", f"{count} ESCs fall silent {when}, and stay so"
    elif anew == count:
        title, told = "restarted together: their supply was away", f"{count} ESCs start anew {when}"
    else:
        title = "lost their supply together"
        told = f"{count} ESCs are away {when}; {anew} of them start anew, the others stay silent"
    others = len(away.going_on)
    on = [f"{others} other node{'s' * (others != 1)} go{'es' * (others == 1)} on"] if others else []
    return made("battery", f"{some} {title}", mine, 0, [told, *on], whole=True)


def unexplained(one: FlightEvent) -> bool:
    """Return whether a voltage fell below what its current explains."""
    expected = one.values.get("expected_voltage")
    if expected is None or not isfinite(expected):
        return False
    return one.values["worst_voltage"] < expected * (1 - threshold("unexplained_percent") / 100)


def _loads(one: FlightEvent) -> bool:
    """Return whether a motor draws much more than it should: all that share its pack are low then."""
    return one.kind == "motor" and one.values["current_share"] > threshold("motor_dragged")


def _others_keep(case: FlightCase, chs: tuple[int, ...], worst: float) -> bool:
    """Return whether no other ESC was ever nearly as low: a pack that one of them loads is low for all."""
    lows = [one.ranges["voltage"][0] for one in case.escs if one.ch not in chs and "voltage" in one.ranges]
    return bool(lows) and min(lows) * (1 - threshold("unexplained_percent") / 100) > worst
