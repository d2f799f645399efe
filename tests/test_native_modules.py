"""The modules of the core know each other in one direction: no circle of `use` lines, read from the sources."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[1] / "analyzer/native/src"
Module = tuple[str, ...]


def names(path: Path) -> Module:
    """Return the module path of a file, empty for the root."""
    found = path.relative_to(SRC).with_suffix("").parts
    return () if found == ("lib",) else found


def expand(tree: str) -> list[str]:
    """Return the paths of one `use` tree: `a::{b, c::{d}}` is `a::b` and `a::c::d`."""
    head, brace, rest = tree.partition("{")
    if not brace:
        return [tree]
    out, depth, start = [], 0, 0
    inside = rest.rpartition("}")[0] + ","
    for at, letter in enumerate(inside):
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == "," and not depth:
            out += [head + path for path in expand(inside[start:at].strip()) if path]
            start = at + 1
    return out


def used(code: str, module: Module, modules: set[Module]) -> set[Module]:
    """Return the modules that this code names with `crate::` or `super::`."""
    code = re.sub(r"//.*", "", code.partition("#[cfg(test)]")[0])
    trees = re.findall(r"\b(?:crate|super|self)::[\w:]*\{[^;]*\}(?=;)|\b(?:crate|super|self)(?:::\w+)+", code)
    found = set()
    for path in (path for tree in trees for path in expand(tree)):
        at = [] if path.startswith("crate") else list(module)
        for part in re.findall(r"\w+", path):
            at = at[:-1] if part == "super" else at if part in ("crate", "self") else [*at, part]
        while tuple(at) not in modules:
            at.pop()
        found.add(tuple(at))
    # What a parent and the modules below it know of each other is one thing in several files.
    return {other for other in found if other[: len(module)] != module and module[: len(other)] != other}


def graph(sources: dict[Module, str]) -> dict[Module, set[Module]]:
    return {module: used(code, module, set(sources)) for module, code in sources.items()}


def test_no_circle_of_modules() -> None:
    files = {names(path): path.read_text() for path in SRC.rglob("*.rs")}
    found = graph(files)
    assert found["frame_batch",] >= {("frames",), ("events",)}
    assert ("mcap", "bytes") in found["mcap", "found"]
    TopologicalSorter(found).prepare()


@pytest.mark.parametrize(
    "back",
    ["use crate::a;", "use crate::{b, a::{self, X}};", "use super::a::X as Y;", "fn f() -> crate::a::X {}"],
)
def test_a_circle_would_be_seen(back: str) -> None:
    sources = {(): "", ("a",): "use crate::b::Z;", ("b",): "", ("b", "c"): "use super::Z;"}
    TopologicalSorter(graph(sources)).prepare()
    with pytest.raises(CycleError):
        TopologicalSorter(graph(sources | {("b",): back})).prepare()
    TopologicalSorter(graph(sources | {("b",): f"// {back}\n#[cfg(test)]\n{back}"})).prepare()
