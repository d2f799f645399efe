"""The faults of T-Motor devices, in the order of the catalogue of rules."""

from __future__ import annotations

from dissectors.traffic import Fault

FAULTS: tuple[Fault, ...] = ()
