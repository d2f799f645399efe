"""The numbers that decide what is a flight or an event: those of `thresholds.toml`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.keys import parsed
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.picture import Plot

FILE = Path(__file__).with_name("thresholds.toml")


@cache
def _all() -> Mapping[str, float]:
    text = FILE.read_bytes()
    content = parsed.known(text)
    if content is None:
        import tomllib  # noqa: PLC0415 - only for a file that was changed after it was shipped

        content = tomllib.loads(text.decode())
    return {name: float(entry["value"]) for name, entry in content.items()}


def threshold(name: str) -> float:
    """Return a number by its name."""
    return _all()[name]


def lasting(name: str) -> int:
    """Return a duration by its name without `_s`, in nanoseconds."""
    return round(_all()[f"{name}_s"] * SECOND)


def idle_rpm(plot: Plot) -> float:
    """Return up to which speed a motor is not driven."""
    return plot.idle_rpm or threshold("idle_rpm")
