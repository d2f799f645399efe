"""Do the tests of a rule notice when it is broken? Each rule is silenced once, and one of its conditions negated.

    python tests/mutate_rules.py [--rules TRF-010,PUSH] [--seconds 120] [--conditions 1]

Works on a copy of the tree. Of `tests/test_rules_*.py` those run that name the rule, or build names of its layer; the
campaign does not count. The condition is the `if` around the report of the rule, else the comparison nearest to it, and
`--conditions` how many of them, nearest first. Exit status 1 if a change survives or a rule has no test.
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from judged import registry

from analyzer.rules.catalogue import load, matching

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

HERE = Path(__file__).resolve().parents[1]
PARTS = ("analyzer", "dissectors", "tests", "captures", "pyproject.toml", "README.md")
JUDGE = "analyzer/rules/judge.py"
GATE = "            if one.rule not in self.enabled:\n"
# Rules that a page describes as tests of fields share this module.
FIELDS = "analyzer/rules/fields.py"
OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Change:
    """One file as it is to read, and what is different in it."""

    file: str
    text: str
    what: str


def silenced(folder: Path, rule: str) -> Change:
    """Its occurrences vanish."""
    text = (folder / JUDGE).read_text()
    if text.count(GATE) != 1:
        raise SystemExit(f"{JUDGE} has no longer one line {GATE.strip()!r}")
    return Change(JUDGE, text.replace(GATE, GATE.replace("if ", f"if one.rule == {rule!r} or ")), "silenced")


def sources(folder: Path) -> list[Path]:
    """Modules of rules: those for any bus, those of vendors."""
    return sorted([*(folder / "analyzer/rules").glob("*.py"), *(folder / "dissectors").glob("*/rules/*.py")])


def negated(folder: Path, rule: str, most: int) -> Iterator[Change]:
    """Each of the conditions nearest to where the rule is reported."""
    made = 0
    for file in sources(folder):
        text = file.read_text()
        if f'"{rule}"' not in text:
            continue
        for node in _conditions(ast.parse(text), rule):
            if made < most:
                made += 1
                yield _without(folder, file, text, node)
    if not made and load(registry())[rule].tests:
        text = (folder / FIELDS).read_text()
        nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Compare)]
        for node in nodes[:most]:
            yield _without(folder, folder / FIELDS, text, node)


def _conditions(tree: ast.Module, rule: str) -> list[ast.expr]:
    """Of the functions that report the rule, else of those of the class that lists it; nearest first."""
    parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    found: list[tuple[int, int, int, ast.expr]] = []
    for place in ast.walk(tree):
        if not (isinstance(place, ast.Constant) and place.value == rule):
            continue
        above: list[ast.AST] = []
        node: ast.AST | None = place
        while (node := parents.get(node) if node is not None else None) is not None:
            above.append(node)
        guards = [one for one in above if isinstance(one, ast.If | ast.IfExp)]
        functions = [one for one in above if isinstance(one, ast.FunctionDef)]
        scopes: list[ast.AST] = [*functions[:1]] or [one for one in above if isinstance(one, ast.ClassDef)]
        if not scopes:
            table = _made(above)
            scopes = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef) and table & _names(one)]
        listed = not functions
        found += [(listed, 0, depth, one.test) for depth, one in enumerate(guards)]
        for one in (inner for scope in scopes for inner in ast.walk(scope)):
            if isinstance(one, ast.Compare):
                found.append((listed, 1, abs(one.lineno - place.lineno), one))
            elif isinstance(one, ast.If):
                found.append((listed, 2, abs(one.lineno - place.lineno), one.test))
    nearest: dict[tuple[int, int], ast.expr] = {}
    for *_, one in sorted(found, key=lambda entry: entry[:3]):
        nearest.setdefault((one.lineno, one.col_offset), one)
    return list(nearest.values())


def _made(above: list[ast.AST]) -> set[str]:
    """Names that the statement of a module assigns to; `above` ends with it and the module."""
    inside = ast.walk(above[-2])
    return {one.id for one in inside if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}


def _names(tree: ast.AST) -> set[str]:
    return {one.id for one in ast.walk(tree) if isinstance(one, ast.Name)}


def _without(folder: Path, file: Path, text: str, node: ast.expr) -> Change:
    old = ast.get_source_segment(text, node) or ""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        new = ast.unparse(ast.Compare(node.left, [OPPOSITE[type(node.ops[0])]()], node.comparators))
    else:
        new = ast.unparse(ast.UnaryOp(ast.Not(), node))
    lines = text.encode().splitlines(keepends=True)
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: (node.end_lineno or 0) - 1])) + (node.end_col_offset or 0)
    whole = text.encode()
    name = str(file.relative_to(folder))
    what = f"{name}:{node.lineno} {' '.join(old.split())[:70]} -> {new[:74]}"
    return Change(name, (whole[:start] + f"({new})".encode() + whole[end:]).decode(), what)


def tests_of(folder: Path, rule: str) -> list[str]:
    """Files that name the rule; if none does, those that build names of its layer."""
    texts = {file.name: file.read_text() for file in sorted((folder / "tests").glob("test_rules_*.py"))}
    texts.pop("test_rules_campaign.py", None)
    layer = rule.partition("-")[0]
    named = [name for name, text in texts.items() if rule in text]
    return named or [name for name, text in texts.items() if f'f"{layer}-{{' in text]


def copied(folder: Path) -> None:
    """What tests need of the tree."""
    leave = shutil.ignore_patterns("__pycache__", "target", "native", ".hypothesis")
    for part in PARTS:
        source = HERE / part
        if source.is_dir():
            shutil.copytree(source, folder / part, ignore=leave)
        else:
            shutil.copy(source, folder / part)


def passes(folder: Path, tests: Sequence[str], seconds: float) -> str:
    """What pytest says of the copy: passed, failed, or late after so many seconds."""
    options = ("-q", "-x", "-p", "no:cacheprovider", "--numprocesses=0")
    command = [sys.executable, "-m", "pytest", *options, *(f"tests/{one}" for one in tests)]
    # Some changes do not alter a file's size, nor its time as far as byte code remembers it.
    env = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return "late"
    return {0: "passed", 1: "failed"}.get(done.returncode, f"pytest ended with {done.returncode}")


def tried(rule: str, folder: Path, seconds: float, most: int) -> Iterator[tuple[str, str]]:
    """What was done, and what came of it: killed (tests fail or hang), SURVIVED, or why nothing can be said."""
    tests = tests_of(folder, rule)
    if not tests:
        yield "no test names it", "SURVIVED"
        return
    whole = sound(folder, tuple(tests), seconds)
    if whole != "passed":
        yield f"unchanged: {whole}", "no result"
        return
    changes = [silenced(folder, rule), *negated(folder, rule, most)]
    if len(changes) == 1:
        yield "no condition found", "no result"
    for change in changes:
        file = folder / change.file
        before = file.read_text()
        file.write_text(change.text)
        came = passes(folder, tests, seconds)
        file.write_text(before)
        ends = {"passed": "SURVIVED", "failed": "killed", "late": "killed (late)"}
        yield change.what, ends.get(came, f"killed ({came})")


@cache
def sound(folder: Path, tests: tuple[str, ...], seconds: float) -> str:
    """Whether the tests pass in the unchanged copy."""
    return passes(folder, tests, seconds)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rules", default="all", help="rules or layers, with commas between them")
    parser.add_argument("--seconds", type=float, default=120.0, help="at most, for each run of the tests")
    parser.add_argument("--conditions", type=int, default=1, help="how many to negate for each rule")
    args = parser.parse_args()
    pages = load(registry())
    chosen = matching(args.rules.split(","), pages)
    ends: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copied(folder)
        for rule in (rule for rule in pages if rule in chosen):
            for what, end in tried(rule, folder, args.seconds, args.conditions):
                ends.append(end)
                sys.stdout.write(f"{rule:9}{end:14}{what}\n")
                sys.stdout.flush()
    killed = sum(end.startswith("killed") for end in ends)
    sys.stdout.write(f"{len(ends)} changes, {killed} killed, {ends.count('SURVIVED')} survived\n")
    return int(killed < len(ends))


if __name__ == "__main__":
    sys.exit(main())
