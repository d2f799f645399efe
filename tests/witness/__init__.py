"""A witness for simulated traffic: a small reader of its own, and for every rule the proof that the bytes breach it.

`finder` gives the proof of a rule by its name; it owes nothing to the analyzer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from witness import can, push_form, push_values, trf, trf_series, typ_layout, typ_values

if TYPE_CHECKING:
    from witness.views import Finder

# Of values and packets, in the order of the catalogue.
VALUES: dict[str, Finder] = {**typ_layout.FINDERS, **typ_values.FINDERS, **push_form.FINDERS, **push_values.FINDERS}


def finder(rule: str) -> Finder:
    """What finds breaches of a rule: sets of frame numbers, or of the lines of error frames."""
    if rule in VALUES:
        return VALUES[rule]
    name = "find_" + rule.lower().replace("-", "_")
    return next(getattr(module, name) for module in (can, push_values, trf, trf_series) if hasattr(module, name))
