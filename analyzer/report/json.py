"""The report as JSON, for programs: the names of `model`, as the schema beside this file documents them."""

from __future__ import annotations

import json
import math
from dataclasses import fields, is_dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from analyzer.report.model import NOT_IN_JSON

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.model import Finding, Report

_SURROGATE = "\\ud"  # as JSON writes one in ASCII


def render(report: Report) -> str:
    """Write one JSON object; each capture, finding and rule is one line, to be compared by line."""
    return written(report.schema, report)


def written(form: str, record: Any) -> str:
    r"""Write a record as a JSON object of the schema `form`, in ASCII; each item of its lists is one line.

    Numbers that are not finite become null, bytes of names that are not UTF-8 become `\xNN`.
    """
    content = {name: value for name, value in _fields(record).items() if name not in NOT_IN_JSON}
    return "\n".join(_lines({"schema": form} | content)) + "\n"


def render_finding(finding: Finding) -> str:
    """Write a finding as it stands in a report, as one line."""
    return _text(finding)


def schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of `render`."""
    text = files(__package__).joinpath("schema.json").read_text("utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def _lines(content: dict[str, Any]) -> Iterator[str]:
    yield "{"
    for k, (name, value) in enumerate(content.items()):
        comma = "," if k < len(content) - 1 else ""
        if isinstance(value, tuple) and value:
            yield f' "{name}": ['
            for at, item in enumerate(value):
                yield f"  {_text(item)}{',' if at < len(value) - 1 else ''}"
            yield f" ]{comma}"
        else:
            yield f' "{name}": {_text(value)}{comma}'
    yield "}"


def _text(value: Any) -> str:
    """Write a part of the report in one line; what JSON does not take is looked for only where there is some."""
    try:
        text = json.dumps(value, allow_nan=False, default=_fields)
    except ValueError:  # a number that is not finite
        text = _SURROGATE
    return json.dumps(_plain(value), allow_nan=False) if _SURROGATE in text else text


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {_plain(str(name)): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if is_dataclass(value):
        return _plain(_fields(value))
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return _readable(value) if isinstance(value, str) else value


def _readable(text: str) -> str:
    """Remove lone surrogates: they are no characters, and many readers of JSON refuse them."""
    if text.isascii() or not any("\ud800" <= c <= "\udfff" for c in text):
        return text
    return "".join(
        f"\\x{ord(c) & 0xFF:02x}" if "\udc80" <= c <= "\udcff" else c if not "\ud800" <= c <= "\udfff"
        else f"\\u{ord(c):04x}"
        for c in text
    )  # fmt: skip
