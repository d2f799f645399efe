"""Colour rules as files bring them: somebody's own first, then those of the dissectors, then those of the program.

[[colour]]
name = "ESC in error mode"
when = 'ESCStatus.mode == "error"'
style = "bold red"
"""

from __future__ import annotations

import os
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from analyzer.filter.compiled import compile_filter
from analyzer.filter.language.errors import FilterError, near
from analyzer.views.colours.styles import codes_of
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.filter.compiled import Filter
    from dissectors import Registry
    from dissectors.toml_table import TomlTable

FILE = "colours.toml"
OFF = "off"
MOST_RULES = 64
_KEYS = ("name", "when", "style", "enabled")


class ColourRule(NamedTuple):
    """Rows that `filter` holds for are painted with `codes`, the parameters of an escape sequence; `""` paints none."""

    name: str
    filter: Filter
    codes: str


def colour_rules(chosen: str | None, registry: Registry) -> list[ColourRule]:
    """Return the rules, the first one that holds wins; none for `off`.

    Args:
        chosen: a file, in place of the one in the user's configuration, or `off`.
        registry: the types, with the folders of their dissectors.

    Raises `ProfileError` for a wrong file, with the place in a filter or style, and `OSError`.
    """
    if chosen == OFF:
        return []
    own = Path(chosen) if chosen is not None else _configured()
    found: list[ColourRule] = []
    if own is not None:
        table = read(own)
        usual = table.flag("defaults") or "defaults" not in table.body
        found += _rules(table, registry)
        if not usual:
            return found
    for folder in chain((profile.folder for profile in registry.profiles), (Path(__file__).parent,)):
        if (folder / FILE).is_file():
            found += _rules(read(folder / FILE), registry)
    return found


def _configured() -> Path | None:
    """Return the file of the user's configuration, if there is one."""
    try:
        home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    except RuntimeError:  # no home
        return None
    path = Path(home) / "tailbyte" / FILE
    return path if path.is_file() else None


def _rules(table: TomlTable, registry: Registry) -> Iterator[ColourRule]:
    table.flag("defaults")
    rows = list(table.rows("colour"))
    for key in table.body:
        if key not in ("defaults", "colour"):
            meant = f"; did you mean {' or '.join(some)}?" if (some := near(key, ["defaults", "colour"])) else ""
            table.fail(f"unknown key{meant} (allowed: defaults, and tables [[colour]])", key)
    if len(rows) > MOST_RULES:
        table.fail(f"{len(rows)} rules, more than {MOST_RULES}", "colour")
    return iter([one for row in rows if (one := _rule(row, registry)) is not None])


def _rule(row: TomlTable, registry: Registry) -> ColourRule | None:
    for key in row.body:
        if key not in _KEYS:
            meant = near(key, list(_KEYS))
            hint = f"; did you mean {' or '.join(meant)}?" if meant else ""
            row.fail(f"unknown key{hint} (allowed: {', '.join(_KEYS)})", key)
    name, when, style = row.string("name"), row.string("when", required=True), row.string("style", required=True)
    enabled = row.flag("enabled") or "enabled" not in row.body
    key = "when"
    try:
        rule = compile_filter(when, registry)
        key = "style"
        codes = codes_of(style)
    except FilterError as error:
        row.fail_inside(error.reason, key, error.text[: error.start], error.place)
    if rule.asks_findings or rule.asks_labels:
        row.fail("a colour cannot ask for findings or labels of a vehicle", "when")
    return ColourRule(name, rule, codes) if enabled else None
