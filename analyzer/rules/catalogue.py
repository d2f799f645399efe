"""The pages of all rules: each stands beside the code that finds it, here or in the folder of a dissector.

A page says what a rule checks, how severe that is, and the numbers that nobody prescribes (`settings`). Mistakes in a
file are `ProfileError` with file and line.
"""

from __future__ import annotations

import re
import string
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, cast

from dissectors.frame_text import filled
from dissectors.keys.pages import CATEGORIES, PAGE, PAGES
from dissectors.pages import files_in, page_files, read_pages
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path
    from types import ModuleType

    from dissectors import Registry
    from dissectors.kit import Severity, Values
    from dissectors.profile import Profile
    from dissectors.toml_table import TomlTable

# By the letters that codes begin with: the package that holds such rules, here and in a dissector's folder.
LAYERS = {
    "CAN": "frames", "TRF": "transfers", "TYP": "values", "PUSH": "packets", "BUS": "bus", "CAP": "capture",
}  # fmt: skip

OWN = "vehicle"  # the origin of rules that a vehicle file brings

_TEXTS = ("title", "checks", "matters", "example", "next", "text")
_FORMAT = string.Formatter()
_OF_EPISODE = re.compile("lasted|worst_.*").fullmatch


@dataclass(frozen=True, slots=True)
class Page:
    """One rule.

    `text` is the line of a finding, filled from the values of an occurrence, of which `key` keeps findings apart.
    `tests` are checks of single fields that need no code of their own; `judged` are the fields that they or the rule's
    code judge. `event`: what it finds is no breach. `drops`: its breaches are notes where the recorder lost frames,
    which may be why. `episode` is the line of a finding that tells a state that lasted. `values` are those that an
    occurrence has to have. `body` is the page as it was read, with what stands for keys that it leaves out.
    """

    rule: str
    title: str
    severity: Severity
    category: str
    origin: str
    clause: str
    enabled: bool
    text: str
    values: tuple[str, ...]
    key: tuple[str, ...]
    settings: Mapping[str, float]
    exercised: str
    inconclusive: tuple[str, ...]
    tests: tuple[TomlTable, ...]
    body: Mapping[str, Any]
    drops: bool = False
    explained: tuple[str, ...] = ()
    judged: frozenset[str] = frozenset()
    episode: str = ""
    event: bool = False

    def say(self, values: Values) -> str:
        """Say what is wrong, in a line."""
        return filled(self.text, values)

    def say_episode(self, values: Values) -> str:
        """Say in a line what lasted, with its onset and what was worst; only what it was if neither is of interest."""
        if "lasted}" not in self.episode and all(
            values.get(name.removeprefix("worst_")) == value for name, value in values.items() if name[:6] == "worst_"
        ):
            return self.say(values)
        return filled(self.episode or self.text, values)

    def key_of(self, values: Values) -> str:
        """Return what keeps this finding apart from others of the same rule, node and type."""
        return ", ".join(f"{name}={values[name]}" for name in self.key if values[name] != "")


@lru_cache(maxsize=1)
def load(registry: Registry) -> Mapping[str, Page]:
    """Return every page by rule, in the order of layers and numbers; a vendor's page goes before a general one."""
    pages = dict(_general(tuple(file for package in layer_packages() for file in files_in(package.__path__))))
    for profile in registry.profiles:
        pages |= _of(profile)
    return {rule: pages[rule] for rule in sorted(pages, key=_order)}


@lru_cache(maxsize=1)
def _general(files: tuple[Path, ...]) -> Mapping[str, Page]:
    return _pages(files)


@lru_cache(maxsize=8)
def _of(profile: Profile) -> Mapping[str, Page]:
    found = _pages(page_files(profile.folder, profile.code))
    if profile.muted:  # what needs its Python cannot be judged
        return {rule: page for rule, page in found.items() if page.tests}
    return found


def layer_packages() -> Iterator[ModuleType]:
    """Yield the packages of rules for any bus."""
    here = import_module(__package__)
    for found in iter_modules(here.__path__):
        if found.name in LAYERS.values():
            yield import_module(f"{here.__name__}.{found.name}")


def _pages(files: Iterable[Path]) -> dict[str, Page]:
    """Return the pages of one dissector; a rule has one."""
    pages: dict[str, Page] = {}
    for file in files:
        table = read_pages(file).of(PAGES)
        for rule in table.body:
            if rule in pages:
                table.fail("another file has a page of this rule, too", rule)
            pages[rule] = page(rule, table.table(rule))
        table.finish()
    return pages


def page(rule: str, table: TomlTable) -> Page:
    """Check a page."""
    table = table.of(PAGE)
    texts = {key: table.string(key) for key in _TEXTS}
    severity = cast("Severity", table.one_of("severity", required=False))
    category = table.one_of("category") or CATEGORIES[0]
    origin = table.one_of("origin", required=False)
    for key in ("severity", "origin"):
        table.string(key)
    keys, given = table.strings("key"), table.strings("values")
    episode = table.string("episode")
    named = [name for text in (texts["text"], episode) for _, name, _, _ in _FORMAT.parse(text) if name]
    names = dict.fromkeys([*(name for name in named if not _OF_EPISODE(name)), *keys])
    if given and not names.keys() <= {*given}:
        table.fail(f"not among the values: {', '.join(sorted({*names} - {*given}))}", "text")
    settings = table.table("settings")
    proofs = table.words("inconclusive")
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
        category=category,
        origin=origin,
        clause=table.string("clause") or "-",
        enabled=table.flag("enabled") or "enabled" not in table.body,
        text=texts["text"],
        values=given or tuple(names),
        key=keys,
        settings={name: _number(settings, name) for name in settings.body},
        exercised=table.string("exercised"),
        inconclusive=proofs,
        tests=tests,
        body={"category": category, "clause": "-", **table.body},
        drops=drops,
        explained=table.strings("explained"),
        judged=frozenset((*table.strings("judges"), *_tested(tests))),
        episode=episode,
        event=table.flag("event"),
    )
    table.finish()
    return made


def _tested(tests: Iterable[TomlTable]) -> Iterator[str]:
    """Yield the fields whose limits or codes these tests judge."""
    for test in tests:
        if test.one_of("kind") in ("range", "enum", "zero"):
            yield from test.strings("fields")


def matching(patterns: Iterable[str], pages: Mapping[str, Page]) -> set[str]:
    """Return the rules that `TRF-010`, a layer like `TRF`, or `all` mean. Raises `LookupError` with near names."""
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


def _number(table: TomlTable, name: str) -> float:
    value = table.fraction(name)
    if value is None:
        table.fail("a number is expected", name)
    raw: float = table.body[name]
    return raw


def _order(rule: str) -> tuple[int, str]:
    layer = rule.partition("-")[0]
    return ([*LAYERS].index(layer) if layer in LAYERS else len(LAYERS), rule)
