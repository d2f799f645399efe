"""Which condition of a rule the mutation check negates."""

from __future__ import annotations

import ast
from pathlib import Path
from textwrap import dedent

import pytest
from bench.rule_conditions import Conditions

RULE = "XYZ-001"


def conditions(**modules: str) -> list[str]:
    """The source of each condition of the rule, nearest first."""
    trees = {Path(f"{name}.py"): ast.parse(dedent(text)) for name, text in modules.items()}
    return [ast.unparse(node) for _, node in Conditions(trees).of(RULE)]


@pytest.mark.parametrize(
    ("text", "nearest"),
    [
        (
            """
            def feed(view):
                far = view.b > 2
                rows = np.flatnonzero(good & (view.a > 1))
                yield view.among("XYZ-001", rows)
            """,
            ["good & (view.a > 1)", "view.a > 1", "view.b > 2"],
        ),
        (
            """
            def feed(view, table):
                if table is None or (table.b == 0).all():
                    return
                for row in table:
                    if row.near < 5:
                        continue
                    if row.value > 7:
                        yield say("XYZ-001", row)
            """,
            ["row.value > 7", "row.near < 5", "table is None or (table.b == 0).all()", "table.b == 0"],
        ),
        (
            """
            def feed(view):
                a = view.a > 3
                b = view.b > view.number("XYZ-001", "most")
                yield a & b
            """,
            ["view.b > view.number('XYZ-001', 'most')", "view.a > 3"],
        ),
        (
            """
            def feed(view, kinds):
                for kind in kinds:
                    if kind.rule == "XYZ-002":
                        yield say(kind, view.c > 2)
                    if kind.rule == "XYZ-001":
                        yield say(kind, view.d > 1)
            """,
            ["view.d > 1"],
        ),
        (
            """
            def _late(row):
                return row.t > 9

            _TABLE = (("XYZ-002", _other), ("XYZ-001", _late))

            def feed(view):
                for rule, picks in _TABLE:
                    if view.some < 3:
                        yield rule, picks(view)
            """,
            ["view.some < 3", "row.t > 9"],
        ),
        (
            """
            class _Base:
                def finish(self, view):
                    for one in self.held:
                        if one.t < view.end:
                            yield one

            class Special(_Base):
                rules = ("XYZ-001",)
            """,
            ["one.t < view.end"],
        ),
    ],
)
def test_the_shortest_way_from_the_report(text: str, nearest: list[str]) -> None:
    assert conditions(one=text) == nearest


def test_a_name_that_stands_for_a_rule_in_another_module() -> None:
    text = """
    from folder.names import LATE, SOON

    def feed(view):
        yield from {SOON: view.a < 1, LATE: view.a > 2}
    """
    assert conditions(one=text, names="SOON, LATE = 'XYZ-002', 'XYZ-001'")[0] == "view.a > 2"


def test_a_function_of_another_module() -> None:
    text = """
    from folder.helpers import rows_of

    def feed(view):
        yield view.among("XYZ-001", rows_of(view))
    """
    helper = """
    def rows_of(view):
        return [row for row in view if row.size > 8]
    """
    assert conditions(one=text, helpers=helper) == ["row.size > 8"]
