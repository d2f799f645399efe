"""Which conditions decide what a rule reports, nearest first, from the source of its module.

From where a rule is named in code, the names beside it are followed to what they were set to and to the functions that
gave it. A comparison, a mask, or the test of a branch on that way is a condition; the shorter the way, the nearer. What
only asks whether there is anything at all (`is None`, `len(rows)`, `mask.any()`) comes last, and what only asks which
rule it is does not count.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from itertools import chain, takewhile
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

RULE = re.compile(r"[A-Z]{3,4}-\d{3}")
DEPTH = 4  # steps of the way that are followed
_PASSED = 2  # more steps to a function that is handed over, and mostly makes words, or to one of another module
_BEYOND = 9  # of conditions in the same function that are not on the way
_NAMED, _TABLE, _LISTED = range(3)  # places: in a function, in a table of the module, in the list of a rule at work
_EMPTY = frozenset({".any", ".all", ".size", "len"})
_CALLED = frozenset({"feed", "finish"})
_MASKS = frozenset({".flatnonzero"})
_Place = tuple["Path", str]  # a name in a file
_Key = tuple[bool, int, int, int]  # trivial, kind of place, steps, lines


class Conditions:
    """Those of some modules, which are given by file."""

    def __init__(self, trees: Mapping[Path, ast.Module]) -> None:
        self._file = {node: file for file, tree in trees.items() for node in ast.walk(tree)}
        self._above = {child: node for node in self._file for child in ast.iter_child_nodes(node)}
        self._functions: dict[_Place, list[ast.AST]] = defaultdict(list)
        self._set: dict[_Place, list[tuple[ast.AST, ast.AST | None]]] = defaultdict(list)  # what, in which function
        for node, file in self._file.items():
            if isinstance(node, ast.FunctionDef):
                self._functions[file, node.name].append(node)
            for target, value in _bindings(node):
                for one in ast.walk(target):
                    if isinstance(one, ast.Name | ast.Attribute) and isinstance(one.ctx, ast.Store):
                        self._set[file, _name(one)].append((value, self._function(node)))
        self._imported = {
            (file, one.name): (module, one.name)
            for node, file in self._file.items()
            if isinstance(node, ast.ImportFrom) and (module := _module(node.module or "", trees)) is not None
            for one in node.names
        }
        self._places: dict[str, list[ast.AST]] = defaultdict(list)
        for node in self._file:
            self._places[self._rule(node)].append(node)

    def of(self, rule: str) -> list[tuple[Path, ast.expr]]:
        """Nearest first, each with its file."""
        found: dict[ast.expr, _Key] = {}
        for place in self._places.get(rule, ()):
            for key, node in self._from(place):
                found[node] = min(key, found.get(node, key))
        nearest: dict[tuple[Path, int, int], ast.expr] = {}
        # Of those that begin at one place, as a whole and its first part do, the nearest counts, else the longest.
        order = {node: (*key, node.lineno, node.col_offset, -len(ast.unparse(node))) for node, key in found.items()}
        for node in sorted(order, key=order.__getitem__):
            nearest.setdefault((self._file[node], node.lineno, node.col_offset), node)
        return [(file, node) for (file, *_), node in nearest.items()]

    def is_mask(self, node: ast.expr) -> bool:
        """Whether a condition holds row by row."""
        return isinstance(over := self._above[node], ast.Call) and _name(over.func) in _MASKS

    def _rule(self, node: ast.AST) -> str:
        """The rule that a constant, or a name of one, stands for; else nothing."""
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return node.value if RULE.fullmatch(node.value) else ""
        if not (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)):
            return ""
        place = self._file[node], node.id
        values = self._set.get(self._imported.get(place, place), ())
        return next((self._rule(value) for value, function in values if function is None and value is not node), "")

    def _from(self, place: ast.AST) -> Iterator[tuple[_Key, ast.expr]]:
        above = list(self._upwards(place))
        function = self._function(place)
        if function is not None and not any(place in ast.walk(one) for one in function.decorator_list):
            yield from self._keyed(_NAMED, place, [self._beside(place)], function)
            return
        scopes: list[ast.AST] = [function] if function is not None else self._classes(above)
        kind = _LISTED
        if not scopes:
            kind = _TABLE
            yield from self._keyed(kind, place, [self._beside(place)], None)
            names = [one for one in ast.walk(above[-2]) if isinstance(one, ast.Name)]
            table = {one.id for one in names if isinstance(one.ctx, ast.Store)}
            users = [one for one in ast.walk(above[-1]) if isinstance(one, ast.Name) and one.id in table]
            scopes = [user for user in map(self._function, users) if user is not None]
        for scope in scopes:
            for one in chain.from_iterable(map(ast.walk, _reporting(scope))):
                if isinstance(one, ast.Yield | ast.YieldFrom | ast.Return) and not self._of_another(one, place):
                    yield from self._keyed(kind, place, [one], self._function(one))

    def _classes(self, above: list[ast.AST]) -> list[ast.AST]:
        """The class that lists a rule, and those of this module that it is made from."""
        found: list[ast.AST] = [one for one in above if isinstance(one, ast.ClassDef)]
        for one in found:
            names = {base.id for base in getattr(one, "bases", ()) if isinstance(base, ast.Name)}
            beside = getattr(above[-1], "body", ())
            found += [other for other in beside if isinstance(other, ast.ClassDef) and other.name in names]
        return found

    def _of_another(self, node: ast.AST, place: ast.AST) -> bool:
        named = {self._rule(one) for one in ast.walk(node)} - {""}
        return bool(named) and self._rule(place) not in named

    def _keyed(
        self, kind: int, place: ast.AST, parts: list[ast.AST], function: ast.AST | None
    ) -> Iterator[tuple[_Key, ast.expr]]:
        line = getattr(place, "lineno", 0)
        for steps, node in self._way(place, parts, function):
            if self._decides(node, place) and not self._for_another(node, place):
                yield (self._trivial(node), kind, steps, abs(node.lineno - line)), node

    def _way(
        self, place: ast.AST, parts: list[ast.AST], function: ast.FunctionDef | ast.AST | None
    ) -> Iterator[tuple[int, ast.expr]]:
        """Conditions with the steps to them."""
        yield from self._around(place)
        guards = [guard for part in parts for guard in self._guards(part)]
        yield from ((0, guard) for guard in guards)
        waiting = [(0, part, function) for part in (*parts, *guards)]
        seen: set[ast.AST] = set()
        while waiting:
            steps, part, here = waiting.pop(min(range(len(waiting)), key=lambda at: waiting[at][0]))
            if part in seen or steps > DEPTH or self._for_another(part, place):
                continue
            seen.add(part)
            yield from ((steps, one) for one in _conditions(part))
            for node in ast.walk(part):
                name = _name(node)
                if not name or self._for_another(node, place):
                    continue
                passed = not (isinstance(over := self._above.get(node), ast.Call) and over.func is node)
                file = self._file[node]
                named = file, name.lstrip(".")
                there = self._imported.get(named, named)
                further = steps + 1 + _PASSED * (passed + (there is not named))
                waiting += [(further, made, self._function(made)) for made in self._functions.get(there, ())]
                for value, where in self._set.get((file, name), ()):
                    if where is None or where is here or name.startswith("."):
                        waiting.append((steps + 1, value, where))
                        yield from ((steps + 1, guard) for guard in self._guards(value))
        if function is not None:
            yield from ((_BEYOND, one) for one in _conditions(function))

    def _around(self, place: ast.AST) -> Iterator[tuple[int, ast.expr]]:
        """Comparisons and whole tests that name the rule, as they look up its limits."""
        below = place
        for one in self._upwards(place):
            if isinstance(below, ast.Compare):
                yield -1, below
            if isinstance(below, ast.BoolOp) and getattr(one, "test", None) is below:
                yield 1 if self._rules_asked(below) else -1, below
            below = one

    def _guards(self, node: ast.AST) -> Iterator[ast.expr]:
        """Tests of the branches that a node is in, and of those before it that leave its block."""
        below = node
        for one in self._upwards(node):
            if isinstance(one, ast.FunctionDef | ast.Lambda):
                return
            if isinstance(one, ast.If | ast.IfExp | ast.While) and below is not one.test:
                yield one.test
            for block in (getattr(one, name, None) for name in ("body", "orelse")):
                if isinstance(block, list) and below in block:
                    for earlier in block[: block.index(below)]:
                        if isinstance(earlier, ast.If) and isinstance(earlier.body[-1], ast.Continue | ast.Return):
                            yield earlier.test
            below = one

    def _beside(self, place: ast.AST) -> ast.AST:
        """What a rule stands with: its call, its row of a table, its value in a dictionary, else the statement."""
        over = self._above[place]
        if isinstance(over, ast.Dict) and place in over.keys:
            return over.values[over.keys.index(place)]
        while isinstance(over, ast.Compare | ast.BoolOp | ast.Attribute | ast.Subscript):
            over = self._above[over]
        return over.test if isinstance(over, ast.If | ast.While) else over

    def _upwards(self, node: ast.AST) -> Iterator[ast.AST]:
        while (over := self._above.get(node)) is not None:
            yield over
            node = over

    def _function(self, node: ast.AST) -> ast.FunctionDef | None:
        return next((one for one in chain([node], self._upwards(node)) if isinstance(one, ast.FunctionDef)), None)

    def _decides(self, node: ast.expr, place: ast.AST) -> bool:
        """Whether it asks for more than which rule it is."""
        asked = self._rules_asked(node)
        return not asked or (self._rule(place) in asked and isinstance(node, ast.BoolOp))

    def _for_another(self, node: ast.AST, place: ast.AST) -> bool:
        """Whether it is reached for other rules only: in a branch for them, or behind an `and`."""
        below = node
        for one in self._upwards(node):
            tests: list[ast.expr] = []
            if (isinstance(one, ast.If) and below in one.body) or (isinstance(one, ast.IfExp) and below is one.body):
                tests = [one.test]
            elif isinstance(one, ast.BoolOp) and isinstance(one.op, ast.And):
                tests = [value for value in one.values if value is not below]
            asked = set[str]().union(*map(self._rules_asked, tests))
            if asked and self._rule(place) not in asked:
                return True
            below = one
        return False

    def _trivial(self, node: ast.expr) -> bool:
        """Whether it asks for nothing but whether there is something, or is the mask of such a question."""
        return _empty(node) or any(isinstance(one, ast.Call) and _empty(one) for one in self._upwards(node))

    def _rules_asked(self, test: ast.expr) -> set[str]:
        """The rules that something is compared with."""
        asked = set()
        for node in ast.walk(test):
            if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Eq | ast.NotEq | ast.In | ast.NotIn):
                sides = [node.left, *node.comparators]
                asked |= {self._rule(one) for side in sides for one in (side, *getattr(side, "elts", ()))}
        return asked - {""}


def _reporting(scope: ast.AST) -> list[ast.AST]:
    """The methods of a rule that the judge calls; else all."""
    called = [one for one in getattr(scope, "body", ()) if getattr(one, "name", "") in _CALLED]
    return called or [scope]


def _module(name: str, files: Iterable[Path]) -> Path | None:
    """The file of a module: of those that are called so, the one whose folders are most like the module's packages."""
    *packages, stem = name.split(".")
    alike = [file for file in files if file.stem == stem]
    return max(alike, key=lambda file: _same_end(file.parent.parts, packages), default=None)


def _same_end(one: Sequence[str], other: Sequence[str]) -> int:
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(reversed(one), reversed(other), strict=False)))


def _bindings(node: ast.AST) -> Iterator[tuple[ast.AST, ast.AST]]:
    if isinstance(node, ast.Assign):
        pairs = zip(node.targets, [node.value] * len(node.targets), strict=True)
        for target, value in pairs:
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
                yield from zip(target.elts, value.elts, strict=True)
            else:
                yield target, value
    elif isinstance(node, ast.AugAssign | ast.NamedExpr | ast.AnnAssign):
        if node.value is not None:
            yield node.target, node.value
    elif isinstance(node, ast.For | ast.comprehension):
        yield node.target, node.iter
        for test in getattr(node, "ifs", ()):
            yield node.target, test


def _name(node: ast.AST) -> str:
    """Of a variable, or of an attribute with a dot before it."""
    if isinstance(node, ast.Name):
        return node.id
    return f".{node.attr}" if isinstance(node, ast.Attribute) else ""


def _conditions(part: ast.AST) -> Iterator[ast.expr]:
    for node in ast.walk(part):
        if isinstance(node, ast.Compare) or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Invert)):
            yield node
        elif isinstance(node, ast.If | ast.IfExp):
            yield node.test
        elif isinstance(node, ast.comprehension):
            yield from node.ifs
        elif isinstance(node, ast.Call) and _name(node.func) in _MASKS:
            yield from node.args[:1]


def _empty(test: ast.AST) -> bool:
    """Whether it asks for nothing but whether there is something."""
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        return _empty(test.operand)
    if isinstance(test, ast.BoolOp):
        return all(map(_empty, test.values))
    if isinstance(test, ast.Compare):
        return isinstance(test.ops[0], ast.Is | ast.IsNot) or _name(test.comparators[0]) == "NO_TIME"
    if isinstance(test, ast.Call):
        return _name(test.func) in _EMPTY
    return isinstance(test, ast.Name) or _name(test) in _EMPTY
