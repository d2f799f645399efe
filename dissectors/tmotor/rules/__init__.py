"""Conformance rules that join T-Motor's tables; what each says stands in the TOML file beside its module."""

from __future__ import annotations

from dissectors.kit import Conformance, rules_of
from dissectors.tmotor.rules.unit_map import UnitMap
from dissectors.tmotor.rules.vehicle import VehicleExercise, labels

CONFORMANCE = Conformance(rules=rules_of(__name__), exercises=(VehicleExercise, UnitMap), labels=labels)
