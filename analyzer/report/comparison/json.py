"""The differences as JSON, for programs: the names of `model`, as the schema beside this file documents them."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from analyzer.report.json import written

if TYPE_CHECKING:
    from analyzer.report.comparison.model import CaptureDiff


def render(of: CaptureDiff) -> str:
    """Write one JSON object in ASCII; each difference is one line."""
    return written(of.schema, of)


def schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of `render`."""
    found: dict[str, Any] = json.loads(files(__package__).joinpath("schema.json").read_text("utf-8"))
    return found
