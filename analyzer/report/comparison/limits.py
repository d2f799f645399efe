"""The numbers that say what a difference is, from `limits.toml` beside this file, where each has its origin."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

FILE = "limits.toml"


@cache
def table() -> dict[str, dict[str, Any]]:
    """Return every limit with its `value`, what it is `about` and its `origin`."""
    return tomllib.loads(files(__package__).joinpath(FILE).read_text("utf-8"))


@cache
def limits() -> dict[str, float]:
    """Return the values by name."""
    return {name: float(one["value"]) for name, one in table().items()}
