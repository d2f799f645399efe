"""Conformance rules that join T-Motor's tables; what they say stands in `rules.toml` beside this folder."""

from __future__ import annotations

from dissectors.conformance import Conformance
from dissectors.tmotor.rules import (
    commands,
    motors,
    packet_dialogue,
    packet_form,
    packet_values,
    parameters,
    rates,
    reports,
    sequence,
    vehicle,
)

_MODULES = (
    commands, parameters, reports, sequence, packet_form, packet_values, packet_dialogue, rates, vehicle, motors,
)  # fmt: skip

CONFORMANCE = Conformance(
    watchers=tuple(watcher for module in _MODULES for watcher in module.WATCHERS),
    exercises=vehicle.EXERCISES,
    labels=vehicle.labels,
)
