"""Conformance rules that join T-Motor's tables; what they say stands in `rules.toml` beside this folder."""

from __future__ import annotations

from dissectors.conformance import Conformance
from dissectors.tmotor.rules import (
    bus_rates,
    commands,
    habits,
    identity,
    motors,
    packet_agreement,
    packet_counts,
    packet_dialogue,
    packet_form,
    packet_life,
    packet_reading,
    packet_values,
    parameters,
    parameters_dialogue,
    positions,
    rates,
    report_rates,
    reports,
    sequence,
    throttle_loss,
    unit_map,
    vehicle,
)

_MODULES = (
    commands, parameters, identity, reports, habits, sequence, packet_form, packet_counts, packet_reading,
    packet_values, packet_life, packet_dialogue, packet_agreement, rates,
    report_rates, bus_rates, vehicle, motors, positions, throttle_loss, parameters_dialogue,
)  # fmt: skip

CONFORMANCE = Conformance(
    watchers=tuple(watcher for module in _MODULES for watcher in module.WATCHERS),
    exercises=(*vehicle.EXERCISES, *unit_map.EXERCISES),
    labels=vehicle.labels,
)
