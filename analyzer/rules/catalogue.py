"""The pages of all rules: those for any bus beside this file, those of a vendor's types in the folder of its dissector.

A page says what a rule checks, how severe that is, and the numbers that nobody prescribes (`settings`). Mistakes in a
file are `ProfileError` with file and line.
"""

from __future__ import annotations

import string
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from dissectors.conformance import Severity
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dissectors import Registry
    from dissectors.conformance import Values
    from dissectors.toml_table import Table

LAYERS = ("CAN", "TRF", "TYP", "PUSH", "BUS", "CAP")
CATEGORIES = ("protocol", "device", "capture")
ORIGINS = ("document", "implied", "dronecan", "heuristic")
# What a capture may or may not record; words of `inconclusive`.
PROOFS = ("times", "drops", "errors", "bit rate", "hardware times")
FILE = "rules.toml"

_TEXTS = ("title", "checks", "matters", "example", "next", "text")
_FORMAT = string.Formatter()


@dataclass(frozen=True, slots=True)
class Page:
    """One rule.

    `text` is the line of a finding, filled from the values of an occurrence, of which `key` keeps findings apart.
    `tests` are checks of single fields that need no code of their own. `drops`: its breaches are notes where the
    recorder lost frames, which may be why. `body` is the page as it was read.
    """

    rule: str
    title: str
    severity: Severity
    category: str
    origin: str
    clause: str
    enabled: bool
    text: str
    key: tuple[str, ...]
    settings: Mapping[str, float]
    exercised: str
    inconclusive: tuple[str, ...]
    tests: tuple[Table, ...]
    body: Mapping[str, Any]
    drops: bool = False
    explained: tuple[str, ...] = ()

    def say(self, values: Values) -> str:
        """What is wrong, in a line."""
        return _FORMAT.vformat(self.text, (), values)

    def key_of(self, values: Values) -> str:
        """What keeps this finding apart from others of the same rule, node and type."""
        return ", ".join(f"{name}={values[name]}" for name in self.key if values[name] != "")


@lru_cache(maxsize=1)
def load(registry: Registry) -> Mapping[str, Page]:
    """Every page by rule, in the order of layers and numbers; a vendor's page goes before a general one."""
    files = [Path(__file__).with_name("catalogue.toml")]
    files += [profile.folder / FILE for profile in registry.profiles]
    pages: dict[str, Page] = {}
    for file in files:
        if file.is_file():
            table = read(file)
            pages |= {rule: page(rule, table.table(rule)) for rule in table.body}
            table.finish()
    return {rule: pages[rule] for rule in sorted(pages, key=_order)}


def page(rule: str, table: Table) -> Page:
    """One page, checked."""
    texts = {key: table.string(key, required=True) for key in _TEXTS}
    severity = cast("Severity", table.one_of("severity", get_args(Severity)) or "error")
    for key, allowed in (("category", CATEGORIES), ("origin", ORIGINS)):
        table.one_of(key, allowed)
        table.string(key, required=True)
    table.string("severity", required=True)
    values = table.strings("values")
    names = {name for _, name, _, _ in _FORMAT.parse(texts["text"]) if name}
    keys = table.strings("key")
    if not names <= {*values} or not {*keys} <= {*values}:
        table.fail(f"not among the values: {', '.join(sorted((names | {*keys}) - {*values}))}", "text")
    settings = table.table("settings")
    proofs = table.strings("inconclusive")
    if not {*proofs} <= {*PROOFS}:
        table.fail(f"unknown word (allowed: {', '.join(PROOFS)})", "inconclusive")
    tests = tuple(table.rows("tests"))
    for key in ("dronecan", "note"):
        table.string(key)
    table.strings("also")
    table.flag("fault")
    drops = table.flag("drops")
    made = Page(
        rule=rule,
        title=texts["title"],
        severity=severity,
        category=str(table.body["category"]),
        origin=str(table.body["origin"]),
        clause=table.string("clause"),
        enabled=table.flag("enabled"),
        text=texts["text"],
        key=keys,
        settings={name: _number(settings, name) for name in settings.body},
        exercised=table.string("exercised", required=True),
        inconclusive=proofs,
        tests=tests,
        body=table.body,
        drops=drops,
        explained=table.strings("explained"),
    )
    table.finish()
    return made


def matching(patterns: Iterable[str], pages: Mapping[str, Page]) -> set[str]:
    """The rules that `TRF-010`, a layer like `TRF`, or `all` mean. Raises `LookupError` with near names."""
    found: set[str] = set()
    for pattern in patterns:
        wanted = pattern.strip().upper()
        here = {rule for rule in pages if wanted in (rule, rule.partition("-")[0], "ALL")}
        if not here:
            import difflib  # noqa: PLC0415 - only a mistyped name is worth it

            near = difflib.get_close_matches(wanted, [*LAYERS, *pages], n=3)
            hint = f" (near: {', '.join(near)})" if near else ""
            raise LookupError(f"no rule is called {pattern.strip()[:40]!r}{hint}")
        found |= here
    return found


def _number(table: Table, name: str) -> float:
    value = table.fraction(name)
    if value is None:
        table.fail("a number is expected", name)
    raw: float = table.body[name]
    return raw


def _order(rule: str) -> tuple[int, str]:
    layer = rule.partition("-")[0]
    return (LAYERS.index(layer) if layer in LAYERS else len(LAYERS), rule)
