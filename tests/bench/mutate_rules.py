"""Do the tests of a rule notice when it is broken? Each rule is silenced once, and one of its conditions negated.

    python tests/bench/mutate_rules.py [--rules TRF-010,PUSH] [--conditions 1] [--workers 2] [--seconds 60]

Without arguments this is the whole check: all rules, one condition each, as many at a time as there are processors.

Works on copies of the tree, made at the start. Of `tests/rules` and `tests/dissectors/tmotor` those files run that name
the rule, or build names of its layer, slow tests among them; the campaign does not count. They run whole, up to the
first test whose own statement fails, and the tests that name the rule go first, so that most changes are noticed at
once. The condition is the nearest one to where the rule is reported (`rule_conditions`), and `--conditions` how many,
nearest first. A line gives rule, what came of a change, seconds, the change, and the test that failed. `killed
(raised)` is a change that made the rule raise in ten tests, or wherever one failed: the next condition is tried
besides. Exit status 1 if a change survives, a rule has no test, or its tests fail unchanged.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analyzer.rules.catalogue import load, matching

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.rule_conditions import Conditions
from kit.judged import registry

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

HERE = Path(__file__).resolve().parents[2]
PARTS = ("analyzer", "dissectors", "tests", "captures", "pyproject.toml", "README.md")
RULES = ("rules", "dissectors/tmotor")  # below tests/
JUDGE = "analyzer/rules/judge.py"
GATE = "            if one.rule not in self.enabled:\n"
# Rules that a page describes as tests of fields share this module; what decides them, by kind of test.
FIELDS = "analyzer/rules/field_tests.py"
DECIDES = {"backwards": "value < last"}
DECIDES_ELSE = "_wrong(self._test.kind, field, shown)"
RAISED = "killed (raised)"
RAISING = 3  # conditions more that are tried for those that only made the rule raise
SLOWER = 5  # times what the tests took unchanged, besides --seconds, before a change counts as one that hangs
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


@dataclass(frozen=True, slots=True)
class Run:
    """What pytest said: passed, failed, raised (outside of the tests), late, or another ending; where; how long."""

    came: str
    failed: str
    seconds: float


def silenced(folder: Path, rule: str) -> Change:
    """Its occurrences vanish."""
    text = (folder / JUDGE).read_text()
    if text.count(GATE) != 1:
        raise SystemExit(f"{JUDGE} has no longer one line {GATE.strip()!r}")
    return Change(JUDGE, text.replace(GATE, GATE.replace("if ", f"if one.rule == {rule!r} or ")), "silenced")


@cache
def conditions(folder: Path) -> Conditions:
    """Those of all modules of rules: for any bus, and of vendors."""
    files = sorted([*(folder / "analyzer/rules").rglob("*.py"), *(folder / "dissectors").glob("*/rules/**/*.py")])
    return Conditions({file: ast.parse(file.read_text()) for file in files})


def negated(folder: Path, rule: str) -> Iterator[Change]:
    """One condition after the other, from the nearest to where the rule is reported."""
    tests, known = load(registry())[rule].tests, conditions(folder)
    if tests:
        yield from (_field_test(folder, rule, kind) for kind in sorted({test.string("kind") for test in tests}))
        return
    for file, node in known.of(rule):
        yield _with(folder, file, node, _opposite(node, mask=known.is_mask(node)))


def _field_test(folder: Path, rule: str, kind: str) -> Change:
    """Another outcome of the test in a page, for this rule only."""
    wanted, file = DECIDES.get(kind, DECIDES_ELSE), folder / FIELDS
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.expr) and ast.unparse(node) == wanted:
            return _with(folder, file, node, f"({wanted}) != (self._test.rule == {rule!r})")
    raise SystemExit(f"{FIELDS} has no longer {wanted!r}")


def _opposite(node: ast.expr, *, mask: bool) -> str:
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        return ast.unparse(ast.Compare(node.left, [OPPOSITE[type(node.ops[0])]()], node.comparators))
    if isinstance(node, ast.UnaryOp):
        return ast.unparse(node.operand)
    if mask:
        return f"({ast.unparse(node)}) == 0"
    return ast.unparse(ast.UnaryOp(ast.Not(), node))


def _with(folder: Path, file: Path, node: ast.expr, new: str) -> Change:
    whole = file.read_bytes()
    lines = whole.splitlines(keepends=True)
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: (node.end_lineno or 0) - 1])) + (node.end_col_offset or 0)
    name = str(file.relative_to(folder))
    what = f"{name}:{node.lineno} {' '.join(whole[start:end].decode().split())[:70]} -> {new[:74]}"
    return Change(name, (whole[:start] + f"({new})".encode() + whole[end:]).decode(), what)


@cache
def tests_of(folder: Path, rule: str) -> tuple[str, ...]:
    """Files that name the rule; if none does, those that build names of its layer."""
    tests = folder / "tests"
    files = sorted(file for room in RULES for file in (tests / room).glob("**/test_*.py"))
    texts = {str(file.relative_to(tests)): file.read_text() for file in files}
    texts.pop("rules/test_campaign.py")
    layer = rule.partition("-")[0]
    named = [name for name, text in texts.items() if rule in text]
    return tuple(named or [name for name, text in texts.items() if f'f"{layer}-{{' in text])


def copied(folder: Path) -> None:
    """What tests need of the tree, compiled as far as it can be."""
    leave = shutil.ignore_patterns("__pycache__", "target", "native", ".hypothesis")
    for part in PARTS:
        source = HERE / part
        if source.is_dir():
            shutil.copytree(source, folder / part, ignore=leave)
        else:
            shutil.copy(source, folder / part)
    compileall = [sys.executable, "-m", "compileall", "-q"]
    subprocess.run([*compileall, "analyzer", "dissectors", "tests"], cwd=folder, capture_output=True, check=False)


class Trial:
    """Copies of the tree in which tests run, one for each worker, and what the tests said unchanged."""

    def __init__(self, folder: Path, workers: int, seconds: float) -> None:
        self._seconds, self._unchanged = seconds, dict[str, Run]()
        self._times = folder / "times.json"
        self._times.write_text('{"times": {}}')
        self._free: queue.SimpleQueue[Path] = queue.SimpleQueue()
        self.source = folder / "unchanged"
        self.source.mkdir()
        copied(self.source)
        for number in range(workers):
            self._free.put(Path(shutil.copytree(self.source, folder / str(number))))

    def measure(self, files: Sequence[str], pool: ThreadPoolExecutor) -> None:
        """Runs files as they are; says which do not pass."""
        times: dict[str, float] = {}

        def run(name: str) -> tuple[Run, dict[str, float]]:
            copy = self._free.get()
            try:
                done = self._pytest(copy, [name], "", 10 * self._seconds)
                return done, json.loads((copy / "said.json").read_text())["times"]
            finally:
                self._free.put(copy)

        for name, (done, mine) in zip(files, pool.map(run, files), strict=True):
            self._unchanged[name] = done
            times |= mine
            if done.came != "passed":
                sys.stdout.write(f"{name}, unchanged: {done.came} {done.failed}\n")
        self._times.write_text(json.dumps({"times": times}))

    def of(self, rule: str, change: Change, tests: Sequence[str]) -> tuple[str, Run]:
        """What came of a change: killed (tests fail or hang), SURVIVED, or that nothing can be said."""
        before = [self._unchanged[name] for name in tests]
        broken = next((one for one in before if one.came != "passed"), None)
        if broken is not None:
            return "no result", broken
        copy = self._free.get()
        file = copy / change.file
        text, stat = file.read_bytes(), file.stat()
        try:
            file.write_text(change.text)
            # Byte code remembers size and whole seconds of a file: both may be what they were.
            os.utime(file, (stat.st_atime, stat.st_mtime + 10))
            run = self._pytest(copy, tests, rule, self._seconds + SLOWER * sum(one.seconds for one in before))
        finally:
            file.write_bytes(text)
            os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            self._free.put(copy)
        ends = {"passed": "SURVIVED", "failed": "killed"}
        return ends.get(run.came, f"killed ({run.came})"), run

    def _pytest(self, copy: Path, tests: Sequence[str], rule: str, seconds: float) -> Run:
        options = ("-q", "-p", "no:cacheprovider", "-p", "bench.mutate_order", "--numprocesses=0", "-m", "")
        command = [sys.executable, "-m", "pytest", *options, *(f"tests/{one}" for one in tests)]
        said = copy / "said.json"
        said.unlink(missing_ok=True)
        env = {**os.environ, "PYTHONPATH": os.pathsep.join((str(copy), str(copy / "tests")))}
        env |= {"PYTHONDONTWRITEBYTECODE": "1", "RULE": rule, "TIMES": str(self._times), "SAID": str(said)}
        start = time.monotonic()
        try:
            done = subprocess.run(command, cwd=copy, env=env, capture_output=True, timeout=seconds, check=False)
        except subprocess.TimeoutExpired:
            return Run("late", "", time.monotonic() - start)
        came = {0: "passed", 1: "failed"}.get(done.returncode, f"pytest ended with {done.returncode}")
        known: dict[str, Any] = json.loads(said.read_text()) if said.is_file() else {"failed": "", "raised": False}
        if came == "failed" and known["raised"]:
            came = "raised"
        return Run(came, known["failed"], time.monotonic() - start)


def tried(rule: str, trial: Trial, most: int) -> list[str]:
    """Changes of a rule one after the other; writes a line for each, and gives the ends."""
    tests = tests_of(trial.source, rule)
    if not tests:
        return [_told(rule, "SURVIVED", Run("", "", 0.0), "no test names it")]
    change = silenced(trial.source, rule)
    ends = [_told(rule, *trial.of(rule, change, tests), change.what)]
    # A change that makes the rule raise shows nothing but that it ran: the next condition is tried besides.
    for change in islice(negated(trial.source, rule), most + RAISING):
        ends.append(_told(rule, *trial.of(rule, change, tests), change.what))
        if sum(end != RAISED for end in ends) > most:
            break
    return ends if len(ends) > 1 else [*ends, _told(rule, "no result", Run("", "", 0.0), "no condition found")]


def _told(rule: str, end: str, run: Run, what: str) -> str:
    failed = f"  [{run.failed.removeprefix('tests/')}]" if run.failed else ""
    sys.stdout.write(f"{rule:9}{end:15}{run.seconds:6.1f} s  {what}{failed}\n")
    sys.stdout.flush()
    return end


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rules", default="all", help="rules or layers, with commas between them")
    parser.add_argument("--conditions", type=int, default=1, help="how many to negate for each rule")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="how many run at a time")
    parser.add_argument("--seconds", type=float, default=60.0, help="more than usual, for each run of the tests")
    args = parser.parse_args()
    pages = load(registry())
    chosen = matching(args.rules.split(","), pages)
    rules = [rule for rule in pages if rule in chosen]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(args.workers) as pool:
        trial = Trial(Path(name), args.workers, args.seconds)
        trial.measure(sorted({file for rule in rules for file in tests_of(trial.source, rule)}), pool)
        ends = [end for some in pool.map(lambda rule: tried(rule, trial, args.conditions), rules) for end in some]
    killed = sum(end.startswith("killed") for end in ends)
    sys.stdout.write(f"{len(ends)} changes, {killed} killed, {ends.count('SURVIVED')} survived\n")
    return int(killed < len(ends))


if __name__ == "__main__":
    sys.exit(main())
