"""Who may know whom: the import graph, vendor names, heavy imports and `unsafe`, read from the sources."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OURS = ("analyzer", "dissectors")
SOURCES = sorted(path for package in OURS for path in (ROOT / package).rglob("*.py") if "target" not in path.parts)
RUST = sorted(ROOT.glob("analyzer/native/src/**/*.rs"))
SYSTEM = ROOT / "analyzer/native/src/receive/system.rs"  # system calls: the only I/O of the core
UNITS = {"dissectors.times", *(f"dissectors.times.{name}" for name in ("MILLISECOND", "SECOND", "NO_TIME"))}
BUFFER = ROOT / "analyzer/native/src/python/buffer.rs"  # columns that Python looks at where they lie
UNSAFE = (ROOT / "analyzer/native/src/simd.rs", SYSTEM, BUFFER)
HEAVY = (
    "numpy",
    "pyarrow",
    "can",
    "rerun",
    "mcap",
    "pandas",
    "dronecan",
    "textual",
    "distributed",
    "deltalake",
    "duckdb",
    "fsspec",
)


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), str(path))


def for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def imports(node: ast.AST, package: str, *, deep: bool = True, typing: bool = True) -> set[str]:
    """Absolute names that are imported; without `deep` only those that run with the module itself."""
    found: set[str] = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            found |= {alias.name for alias in child.names}
        elif isinstance(child, ast.ImportFrom):
            base = ".".join(package.split(".")[: -child.level or None][: None if child.level else 0])
            origin = ".".join(part for part in (base, child.module) if part)
            found |= {origin} | {f"{origin}.{alias.name}" for alias in child.names}
        elif for_types_only(child) and not typing:
            continue
        elif deep or not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            found |= imports(child, package, deep=deep, typing=typing)
    return found


def imported(path: Path, **how: bool) -> set[str]:
    name = module_name(path)
    return imports(tree(path), name if path.name == "__init__.py" else name.rpartition(".")[0] + ".", **how)


def reaches(found: set[str], *prefixes: str) -> set[str]:
    return {name for name in found for prefix in prefixes if name == prefix or name.startswith(prefix + ".")}


def under(prefix: str) -> list[Path]:
    found = [path for path in SOURCES if reaches({module_name(path)}, prefix)]
    assert found, f"no module {prefix}"
    return found


# Lowest first: a module imports its own layer and those before it, types included.
LAYERS = (
    "dissectors",
    "analyzer._native",
    "analyzer.tables",
    "analyzer.sources",
    "analyzer.decode",
    "analyzer.window",
    "analyzer.facts",
    "analyzer.devices",
    "analyzer.filter",
    "analyzer.rules",
    "analyzer.stats",
    "analyzer.flight",
    "analyzer.sinks",
    "analyzer.views",
    "analyzer.report",
    "analyzer.plot",
    "analyzer.live",
    "analyzer.board",
    "analyzer.terminal",
    "analyzer.browser",
    "analyzer.app",
    "analyzer.fleet",
    "analyzer.integrations",
    "analyzer.cli",
    "analyzer.__main__",
)
# The public interface loads its parts when they are asked for; the simulator is apart from all layers.
APART = ("analyzer", "analyzer.simulate")
# (layer, what it must not import although it stands above it)
RULES = [
    ("analyzer.views", ("analyzer.sources",)),
    ("analyzer.facts", ("analyzer.sources",)),
    ("analyzer.sources", ("dissectors",)),
    ("analyzer.decode", ("analyzer.sources",)),
    ("analyzer.devices", ("analyzer.sources",)),
    ("analyzer.board", ("analyzer.views", "analyzer.sources", "analyzer.live")),
    ("analyzer.browser", ("analyzer.sources", "analyzer.live")),
    ("analyzer.terminal", ("analyzer.sources", "analyzer.live", "analyzer.decode", "analyzer.rules")),
]


def layer_of(name: str) -> str | None:
    return next((layer for layer in LAYERS if reaches({name}, layer)), None)


@cache
def graph() -> dict[str, frozenset[str]]:
    """Modules and the modules that each imports; a package stands for what is imported from it."""
    by_name = {module_name(path): path for path in SOURCES}
    known = {*by_name, "analyzer._native"}

    def edges(name: str, path: Path) -> frozenset[str]:
        out = set()
        for node in ast.walk(tree(path)):
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                package = name if path.name == "__init__.py" else name.rpartition(".")[0] + "."
                found = imports(ast.Module([node], []), package)
                base = {n for n in found if not any(n != m and m.startswith(n + ".") and m in known for m in found)}
                out |= {n if n in known else n.rpartition(".")[0] for n in base}
        return frozenset((out & known) - {name})

    return {name: edges(name, path) for name, path in by_name.items()}


def circles(edges: dict[str, frozenset[str]]) -> set[frozenset[str]]:
    """Modules that reach themselves, together with those on the way."""
    reach: dict[str, set[str]] = {}
    for start, first in edges.items():
        seen: set[str] = set()
        todo = list(first)
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo += edges.get(name, ())
        reach[start] = seen
    return {frozenset(b for b in reach[a] if a in reach.get(b, ())) for a in edges if a in reach[a]}


@pytest.mark.slow
def test_every_module_stands_in_a_room() -> None:
    homeless = {name for name in graph() if layer_of(name) is None and name not in APART}
    assert {name for name in homeless if not reaches({name}, "analyzer.simulate")} == set()


def test_imports_go_down_only() -> None:
    upward = {
        (name, other)
        for name, others in graph().items()
        for other in others
        if (here := layer_of(name)) and (there := layer_of(other)) and LAYERS.index(there) > LAYERS.index(here)
    }
    assert upward == set()


def test_there_is_no_circle() -> None:
    assert {tuple(sorted(found)) for found in circles(graph())} == set()


def test_a_circle_would_be_seen() -> None:
    edges = {"a": frozenset({"b"}), "b": frozenset({"c"}), "c": frozenset({"b", "d"}), "d": frozenset[str]()}
    assert circles(edges) == {frozenset({"b", "c"})}


@pytest.mark.parametrize(("layer", "forbidden"), RULES, ids=lambda value: value if isinstance(value, str) else "")
def test_a_layer_knows_no_more_than_it_needs(layer: str, forbidden: tuple[str, ...]) -> None:
    wrong = {module_name(path): reaches(imported(path) - UNITS, *forbidden) for path in under(layer)}
    assert {name: found for name, found in wrong.items() if found} == {}


@pytest.mark.parametrize("path", under("analyzer.simulate"), ids=module_name)
def test_the_simulator_shares_nothing_with_the_decoder(path: Path) -> None:
    """It may know its own parts, and of the dissectors the layouts and its vehicle: what it makes is to be decoded."""
    found = imported(path)
    assert reaches(found, "analyzer") == reaches(found, "analyzer.simulate")
    allowed = [f"dissectors.{name}" for name in ("traffic", "tmotor", "times", "layout", "schema", "registry")]
    assert reaches(found, "dissectors") - {"dissectors"} == reaches(found, *allowed)
    assert reaches(found, "numpy", "pyarrow", "can", "dronecan") == set()


def test_the_rules_see_imports_of_every_form() -> None:
    code = "import a.b\nfrom c import d\nif TYPE_CHECKING:\n    import e\ndef f():\n    from . import g\n"
    assert imports(ast.parse(code), "p.q.") == {"a.b", "c", "c.d", "e", "p.q", "p.q.g"}
    assert imports(ast.parse(code), "p.q.", deep=False, typing=False) == {"a.b", "c", "c.d"}


@pytest.mark.parametrize("package", ["analyzer", "analyzer.cli", "dissectors"])
def test_a_package_imports_nothing_heavy(package: str) -> None:
    """`--help` and the first import wait for neither numpy nor pyarrow."""
    seen: set[str] = set()
    todo = [package]
    by_name = {module_name(path): path for path in SOURCES}
    while todo:
        name = todo.pop()
        if name in seen or name not in by_name:
            continue
        seen.add(name)
        found = imported(by_name[name], deep=False, typing=False)
        assert reaches(found, *HEAVY) == set(), name
        todo += found
    assert package in seen


@pytest.mark.sampled(3)
@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_no_module_knows_of_the_tests(path: Path) -> None:
    assert reaches(imported(path), "tests", "kit", "bench", "witness", "pytest", "hypothesis") == set()
    assert not any(re.search(r"\btests?/", text) for text in strings(path))


def strings(path: Path) -> list[str]:
    """String constants and identifiers of the code, docstrings left out."""
    out: list[str] = []
    docs = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                docs.add(id(first.value))
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            out.append(node.value)
        elif isinstance(node, ast.Name):
            out.append(node.id)
        elif isinstance(node, ast.Attribute):
            out.append(node.attr)
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef)):
            out.append(node.name)
        elif isinstance(node, (ast.arg, ast.keyword)) and node.arg:
            out.append(node.arg)
    return out


@cache
def vendor_words() -> frozenset[str]:
    """Names of types, packets and fields that only the T-Motor folder may know."""
    folder = ROOT / "dissectors" / "tmotor"
    words = {path.name.split(".")[-2] for path in folder.rglob("*.uavcan")}
    for path in folder.rglob("*.uavcan"):
        code = re.sub(r"#.*", "", path.read_text())
        words |= set(re.findall(r"^\s*\S+\s+(\w+)\s*$", code, re.MULTILINE))
    assert {"RawCommand", "ESCStatus", "PUSHCAN", "esc_index", "MotorStatus"} <= words
    plain = {
        "data",
        "fault",
        "position",
        "voltage",
        "current",
        "temperature",
        "header",
        "length",
        "checksum",
        "reserved",
        "speed",
    }
    standard = {"hardware_version", "software_version", "frame_id"}  # of GetNodeInfo, and of ROS headers, too
    return frozenset(word for word in words if len(word) > 4) - plain - standard


@pytest.mark.sampled(4)
@pytest.mark.parametrize("path", under("analyzer"), ids=module_name)
def test_no_vendor_fact_outside_its_folder(path: Path) -> None:
    text = "\n".join(strings(path))
    assert {word for word in vendor_words() if re.search(rf"\b{word}\b", text)} == set()
    assert not re.search(r"esc\.Status|com\.tmotor|\b(1030|1033|1034|1038|1039|1332)\b", text)
    numbers = {
        node.value for node in ast.walk(tree(path)) if isinstance(node, ast.Constant) and type(node.value) is int
    }
    assert numbers.isdisjoint({1030, 1033, 1034, 1038, 1039, 1332})


def test_the_vendor_rule_would_see_a_name() -> None:
    assert "cmd" not in vendor_words()
    assert {"RawCommand", "data_sequence", "power_rating_pct"} <= vendor_words()


@pytest.mark.parametrize("path", RUST, ids=lambda path: path.name)
def test_unsafe_stands_in_three_places(path: Path) -> None:
    code = re.sub(r"//.*", "", path.read_text())
    uses = re.search(r"\bunsafe\b(?!_)", code) is not None
    assert not uses or path in UNSAFE
    # An attribute holds for the files below, too, and the boundary cannot forbid what its macros write.
    above = path.name == "lib.rs" or path.with_suffix("") == SYSTEM.parent
    assert "#![forbid(unsafe_code)]" in code or path in UNSAFE or above or boundary(path)


def boundary(path: Path) -> bool:
    return path.name == "python.rs" or path.parent.name == "python"


def test_the_core_knows_python_in_one_place() -> None:
    users = {path for path in RUST if re.search(r"\bpyo3\b", re.sub(r"//.*", "", path.read_text()))}
    assert users == {path for path in RUST if boundary(path)} != set()


def test_the_core_does_no_io() -> None:
    core = [path for path in RUST if not boundary(path) and path != SYSTEM]
    assert core
    for path in core:
        code = re.sub(r"//.*", "", path.read_text().partition("#[cfg(test)]")[0])
        assert not re.search(r"\bstd::(fs|net|io|process|env|thread)\b|\b(e?println|dbg)!", code), path.name
