"""A supply that fails: all ESCs are away at once, or voltages fall that no current explains."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.trouble import made, together, within

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase
    from analyzer.flight.verdict.trouble import Trouble


def supply_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield a supply that fails: all ESCs away at once, or voltages that no current explains."""
    silent = [
        one for one in case.events if one.kind == "silence" and one.after is None and not case.in_joint_loss(one)
    ]  # fmt: skip
    going_on = [
        one
        for one in case.paces
        if (one.bus, one.node) not in case.esc_nodes and one.last >= case.border - lasting("silence_after")
    ]
    if together(case, silent) and going_on:
        nodes = sorted(case.esc_nodes)
        mine = [one for one in silent if (one.bus, one.node) in case.esc_nodes]
        yield made("battery", "all ESCs lost their supply together", mine, 0, [
            f"{len(nodes)} ESCs fall silent within {within(mine)}, and stay so",
            f"{len({(one.bus, one.node) for one in going_on})} other nodes go on",
        ], whole=True)  # fmt: skip
    sags = [
        one for one in case.events if one.kind == "sag" and (one.bus, one.node) in case.esc_nodes and _unexplained(one)
    ]  # fmt: skip
    if not sags:
        return
    chs = tuple(sorted({one.ch for one in sags if one.ch is not None}))
    part = 0 < len(chs) < len(case.escs_by_channel)
    title = f"the supply of {'channels ' + ' '.join(map(str, chs)) if part else 'all ESCs'} broke down"
    worst = min(sags, key=lambda one: one.values["worst_voltage"])
    high, low, expected = (worst.values[name] for name in ("voltage", "worst_voltage", "expected_voltage"))
    reasons = [f"{high:.1f} -> {low:.1f} V; its current explains {expected:.1f} V"]
    if part:
        if len(chs) > 1:
            reasons.append(f"channels {' '.join(map(str, chs))} share a supply: their voltages fall together")
        reasons.append(f"the other {len(case.escs_by_channel) - len(chs)} ESCs keep their voltage")
    trouble = made("battery", title, sags, 0, reasons, whole=True)
    trouble.chs = chs
    yield trouble


def _unexplained(one: FlightEvent) -> bool:
    expected = one.values.get("expected_voltage")
    if expected is None or not isfinite(expected):
        return False
    return one.values["worst_voltage"] < expected * (1 - threshold("unexplained_percent") / 100)
