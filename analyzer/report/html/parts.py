"""Shared by all HTML pages: templates that escape every text, filters, and the policy that names style and script."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from analyzer.report.moments import clock, moment
from analyzer.views.terminal import ELLIPSIS, escape

LONGEST_TEXT = 400  # characters
LONGEST_NAME = 60
STYLE = "report.css"


def visible(value: Any) -> Any:
    r"""Return what a template prints: text without anything invisible or misleading (`\x1b`), of bounded length."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return _cut(value, LONGEST_TEXT)


def _name(value: object) -> str:
    """Filter what should be short."""
    return _cut(str(value), LONGEST_NAME)


def _cut(text: str, limit: int) -> str:
    printable = escape(text[: limit + 1])
    return printable if len(printable) <= limit else printable[: limit - 1] + ELLIPSIS


def _count(number: int) -> str:
    return f"{number:,}"


@cache
def environment(package: str) -> Environment:
    """Return the templates of a package, and behind them those of the report: its style is that of every page."""
    found = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader(__package__)]),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {"name": _name, "count": _count, "moment": moment, "clock": clock}
    return found


def policy(templates: Environment, script: str = "") -> str:
    """Return a policy: nothing may be loaded, sent or run but the style and the script of this file."""
    hashes = {}
    for kind, source in (("style-src", STYLE), ("script-src", script)):
        if source:
            digest = hashlib.sha256(templates.get_template(source).render().encode()).digest()
            hashes[kind] = base64.b64encode(digest).decode()
    allowed = "; ".join(f"{kind} 'sha256-{digest}'" for kind, digest in hashes.items())
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"
