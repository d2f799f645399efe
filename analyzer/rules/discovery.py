"""The rules that run: those for any bus, those that a page describes as tests of fields, and those of vendors."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from typing import TYPE_CHECKING

from analyzer.rules import field_tests
from analyzer.rules.catalogue import layer_packages
from analyzer.rules.noted import NotedFields
from dissectors.kit import Conformance, rules_of
from dissectors.toml_table import ProfileError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path
    from types import ModuleType

    from analyzer.rules.catalogue import Page
    from dissectors import Registry
    from dissectors.kit import Rule


def conformances_of(registry: Registry) -> list[Conformance]:
    """Return what the dissectors in use bring along. Raises `ProfileError` for a module that cannot be used."""
    found = []
    for profile in registry.profiles:
        if profile.rules:
            file = str(profile.folder / "profile.toml")
            try:
                module = _module(profile.rules, profile.folder)
            except (ImportError, OSError, SyntaxError) as error:
                raise ProfileError(file, 1, f"rules: {error}") from None
            conformance = getattr(module, "CONFORMANCE", None)
            if not isinstance(conformance, Conformance):
                raise ProfileError(file, 1, f"rules: {profile.rules} has no CONFORMANCE")
            found.append(conformance)
    return found


def new_rules(registry: Registry, pages: Mapping[str, Page], vendors: Sequence[Conformance]) -> Iterator[Rule]:
    """Yield a new rule of every kind that looks for what one of the pages describes."""
    for package in layer_packages():
        yield from _made(rules_of(package.__name__), pages)
    yield from field_tests.rules_from(registry, pages)
    yield NotedFields(registry)
    for vendor in vendors:
        yield from _made(vendor.rules, pages)


def _made(kinds: Iterable[type[Rule]], pages: Mapping[str, Page]) -> Iterator[Rule]:
    for kind in kinds:
        if not pages.keys().isdisjoint(kind.rules):
            yield kind()


def _module(name: str, folder: Path) -> ModuleType:
    """Return an importable module, or a file `NAME.py` of the folder."""
    if not name.endswith(".py"):
        return importlib.import_module(name)
    path = folder / name
    spec = importlib.util.spec_from_file_location(f"rules_of_{folder.name}", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
