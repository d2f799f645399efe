"""Numbers as JSON can hold them."""

from __future__ import annotations

import math
from typing import Any


def number(value: Any) -> Any:
    """Return a number as JSON can hold it: what is not finite becomes "NaN", "Infinity" or "-Infinity"."""
    if value is None or math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
