"""Rules that were written for `dissectors.conformance` still run, and are told what its names have become."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import pytest

import dissectors
from analyzer.decode.engine import Engine
from analyzer.rules.judge import Judge
from dissectors import conformance, kit

if TYPE_CHECKING:
    from pathlib import Path

OLD = {
    "Events": kit.EventTable, "Found": kit.Occurrences, "Frames": kit.FrameTable, "Look": kit.Feed,
    "Table": kit.DecodedTable, "Transfers": kit.TransferTable, "Words": kit.Array, "watches": kit.rule,
}  # fmt: skip
SAME = ("MILLISECOND", "NO_TIME", "SECOND", "Exercise", "Kept", "Measures", "Occurrence", "Severity", "Types", "Values")


@pytest.mark.parametrize("name", [*OLD, *SAME, "View"])
def test_an_old_name_warns_and_gives_the_new_one(name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"dissectors\.conformance\.{name} is now dissectors\.kit\.\w+$"):
        found = getattr(conformance, name)
    assert found is OLD.get(name, getattr(kit, name, None))


def test_a_name_that_never_was() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Nonsense'"):
        _ = conformance.Nonsense


def test_importing_it_alone_does_not_warn() -> None:
    importlib.reload(conformance)


RULES_TOML = """\
[OLD-001]
title = "An old rule"
severity = "note"
category = "device"
origin = "heuristic"
clause = ""
enabled = true
text = "{sum} rows"
values = ["sum"]
key = ["sum"]
checks = "it runs"
matters = "it must"
example = "any"
next = "nothing"
exercised = "old rows"
"""
RULES = """\
from dissectors.conformance import Conformance, Occurrence, Watcher, watches

class Sum(Watcher):
    rules = ("OLD-001",)

    def __init__(self):
        self.rows = 0

    def look(self, view):
        self.rows += len(view.frames)
        return ()

    def settle(self, view):
        yield Occurrence("OLD-001", 0, 0, None, "", (), {"sum": self.rows})

@watches("OLD-001")
def first(view):
    if view.frames.first == 0 and len(view.frames):
        yield Occurrence("OLD-001", 0, 0, None, "", (), {"sum": "some"})

class Seen:
    def __init__(self):
        self.found = []

    def look(self, view):
        if len(view.frames):
            self.found = ["old rows"]

    def words(self):
        return self.found

CONFORMANCE = Conformance(watchers=(Sum, first), exercises=(Seen,))
"""


def test_old_rules_run(tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text('name = "Old"\nversion = "1"\ntree = "."\nrules = "rules.py"\n')
    (tmp_path / "rules.toml").write_text(RULES_TOML)
    (tmp_path / "rules.py").write_text(RULES)
    registry = dissectors.load([tmp_path], [tmp_path])
    with pytest.warns(DeprecationWarning, match="dissectors.conformance"):
        judge = Judge(registry)
    lines = [f"({k}.0) can0 18040A0A#00000000000000C0" for k in range(3)]
    for batch in Engine(registry).run(["\n".join(lines).encode() + b"\n"]):
        judge.feed(batch)
    outcome = judge.finish()
    assert [run.examples[0].text for key, run in outcome.runs if key.rule == "OLD-001"] == ["3 rows", "some rows"]
    assert "old rows" in outcome.words
