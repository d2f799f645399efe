"""The rules of a package, so that a new one needs to be listed nowhere."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import walk_packages

from dissectors.kit.rule import Rule


def rules_of(package: str) -> tuple[type[Rule], ...]:
    """Return the rules that stand in the modules below a package: by module, and as they follow each other there.

    A rule is a class made from `Rule`, or by `rule`, that names rules and has no underscore in front. The modules are
    looked for once.
    """
    return _found(package)


@cache
def _found(package: str) -> tuple[type[Rule], ...]:
    names = (one.name for one in walk_packages(import_module(package).__path__, f"{package}."))
    modules = [import_module(name) for name in sorted(names)]
    return tuple(
        one
        for module in modules
        for name, one in vars(module).items()
        if isinstance(one, type)
        and issubclass(one, Rule)
        and one.rules
        and one.__module__ == module.__name__
        and not name.startswith("_")
    )
