"""What a recorder says of itself in a comment: that no loss is in it then means that there was none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES

import analyzer
from analyzer.facts.recorder import statement

if TYPE_CHECKING:
    from pathlib import Path

HOVER = (CAPTURES / "hover-4.log").read_text()


def verdicts(path: Path, text: str) -> tuple[dict[str, object], dict[str, str]]:
    path.write_text(text)
    report = analyzer.check(path)
    return dict(report.captures[0].can_judge), {one.rule: one.verdict for one in report.rules}


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("drops", "errors", "can", "proven"),
    [
        (True, True, ("yes", "yes"), {"CAP-004": "PASS", "CAN-004": "PASS"}),
        (True, False, ("yes", "no"), {"CAP-004": "PASS", "CAN-004": "INCONCLUSIVE"}),
        (False, True, ("unknown", "yes"), {"CAP-004": "INCONCLUSIVE", "CAN-004": "PASS"}),
        (False, False, ("unknown", "no"), {"CAP-004": "INCONCLUSIVE", "CAN-004": "INCONCLUSIVE"}),
    ],
)
def test_what_it_says_is_proof(
    tmp_path: Path, drops: bool, errors: bool, can: tuple[str, str], proven: dict[str, str]
) -> None:
    said = statement(drops=drops, errors=errors)
    judge, rules = verdicts(tmp_path / "a.log", (f"# {said}\n" if said else "") + HOVER)
    assert (judge["drops"], judge["errors"]) == can
    assert {rule: rules[rule] for rule in proven} == proven


@pytest.mark.sampled(4)
@pytest.mark.parametrize("text", ["recorded with care", "recorded with drops and luck", "not recorded with drops"])
def test_other_comments_prove_nothing(tmp_path: Path, text: str) -> None:
    judge, _ = verdicts(tmp_path / "a.log", f"# {text}\n{HOVER}")
    assert (judge["drops"], judge["errors"]) == ("unknown", "no")


def test_a_recorder_that_would_count_drops_has_not_lost_any(tmp_path: Path) -> None:
    """Rules are as sure as they are without the statement; a drop makes them less so."""
    said = f"# {statement(drops=True, errors=True)}\n"
    lines = HOVER.splitlines(keepends=True)
    _, sure = verdicts(tmp_path / "a.log", said + HOVER)
    _, lossy = verdicts(
        tmp_path / "b.log",
        said
        + "".join([*lines[:900], "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n", *lines[903:]]),
    )
    assert (sure["TRF-016"], sure["CAP-004"]) == ("PASS", "PASS")
    assert (lossy["TRF-016"], lossy["CAP-004"]) == ("INCONCLUSIVE", "WARN")
