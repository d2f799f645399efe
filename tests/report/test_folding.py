"""One lost frame is one finding in the report, and only where both are about the same transfers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES
from kit.reports import finding

import analyzer
from analyzer.report.folding import breaches, fold
from analyzer.report.model import SEVERITIES, Example, Finding, Place, Waiver
from analyzer.report.wording import verdict_counts

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.report.model import Report, RuleVerdict

FAULTS = CAPTURES / "mission-8-faults.log"
SURE = {"error": (5, 20), "note": (9,)}


def about(rule: str, *frames: int, count: int = 0, **more: Any) -> Finding:
    one = finding("TRF-003", type="ESCStatus", **more)
    return replace(
        one, rule=rule, count=count or len(frames), first=Place(frames[0], None), last=Place(frames[-1], None),
        frames=frames, examples=tuple(Example(frame, None, "") for frame in frames),
    )  # fmt: skip


def test_a_broken_transfer_is_one_finding() -> None:
    report = analyzer.check(FAULTS, select=["TRF-003", "TRF-006"])
    assert [one.rule for one in report.findings] == ["TRF-003"]
    assert report.findings[0].text == "wrong toggle bit at the sender, before frame 5712"
    (verdict,) = [one for one in report.rules if one.rule == "TRF-006"]
    assert (verdict.verdict, verdict.findings, verdict.reason) == ("FAIL", 0, "see TRF-003")
    (alone,) = analyzer.check(FAULTS, select=["TRF-006"]).findings
    assert alone.frames == report.findings[0].frames


def test_causes_that_differ_are_folded_together() -> None:
    lost, swapped, ended = about("TRF-003", 5, 9), about("TRF-003", 7), about("TRF-006", 5, 7, 9)
    assert fold([ended, lost, swapped]) == ((lost, swapped), (ended,))


@pytest.mark.parametrize(
    "ended",
    [
        about("TRF-006", 6), about("TRF-006", 5, 6), about("TRF-006", 5, count=2), about("TRF-006", 5, node=25),
        about("TRF-006", 5, bus="can1"), about("TRF-006", 5, capture="2"), about("TRF-007", 5),
    ],
)  # fmt: skip
def test_others_stay(ended: Finding) -> None:
    lost = about("TRF-003", 5)
    assert fold([lost, ended]) == ((lost, ended), ())


def test_a_severity_that_somebody_gave_changes_nothing() -> None:
    for lost, ended in (("note", "error"), ("error", "note"), ("warning", "error")):
        cause, end = about("TRF-003", 5, severity=lost), about("TRF-006", 5, severity=ended)
        assert fold([cause, end]) == ((cause,), (end,))
        assert [one.severity for one in breaches("1", [cause], [end])] == [lost, max(lost, ended, key=SEVERITIES.index)]


def test_the_transfers_of_one_severity_are_told_with_it() -> None:
    """Others between them, of which less is sure."""
    found = [about(rule, *at, severity=severity) for rule in ("TRF-003", "TRF-006") for severity, at in SURE.items()]
    assert fold(found) == (tuple(found[:2]), tuple(found[2:]))


@pytest.mark.slow
def test_the_report_follows_what_is_said_of_the_cause(tmp_path: Path) -> None:
    vehicle = tmp_path / "vehicle.toml"
    waiver = '[[waiver]]\nrule = "TRF-003"\nreason = "known"\nowner = "me"\nexpires = 9999-12-31\n'
    for text, verdict, counted in (
        ('[rule.TRF-003]\nseverity = "note"\n', "PASS", None),
        ('[rule.TRF-003]\nseverity = "warning"\n', "WARN", "1 warn"),
        (waiver, "WAIVED", "1 waived"),
    ):
        vehicle.write_text(text)
        report = analyzer.check(FAULTS, vehicle=vehicle)
        assert [one.rule for one in report.findings if one.rule in ("TRF-003", "TRF-006")] == ["TRF-003"]
        assert {one.verdict for one in report.rules if one.rule in ("TRF-003", "TRF-006")} == {verdict}
        assert counted is None or counted in verdict_counts(replace(report, rules=_of(report, "TRF-003", "TRF-006")))
    ended = analyzer.check(FAULTS, select=["TRF-006"]).findings[0]
    assert ended.text.endswith("bytes received, never complete: broken sequence (TRF-003)")


def _of(report: Report, *rules: str) -> tuple[RuleVerdict, ...]:
    return tuple(one for one in report.rules if one.rule in rules)


def test_what_another_rule_tells_is_counted_once() -> None:
    report = analyzer.check(FAULTS, select=["TRF-003", "TRF-006"])
    assert verdict_counts(replace(report, rules=_of(report, "TRF-003", "TRF-006"))) == ["1 fail", "1 told elsewhere"]


def gap(*places: tuple[int, int], count: int = 0, lost: int = 1, **more: Any) -> Finding:
    """Transfers missing before frames: (frame, the ID that is missing)."""
    one = about("TRF-016", *(frame for frame, _ in places), count=count, **more)
    texts = (f"expected {number}, got {(number + lost) % 32}: {lost} missing" for _, number in places)
    examples = zip(one.examples, texts, strict=True)
    return replace(one, examples=tuple(replace(example, text=text) for example, text in examples))


def headless(*places: tuple[int, int], count: int = 0) -> Finding:
    """Remainders without a start: (frame, transfer ID)."""
    one = about("TRF-005", *(frame for frame, _ in places), count=count)
    texts = (f"transfer ID {number}, first frame lost (of 3)" for _, number in places)
    examples = zip(one.examples, texts, strict=True)
    return replace(one, examples=tuple(replace(example, text=text) for example, text in examples))


def test_a_transfer_without_its_start_is_the_one_that_is_missing() -> None:
    for cut, missing in (
        (headless((5, 31)), gap((9, 31))),
        (headless((5, 31)), gap((9, 31), severity="note")),
        (headless((5, 3), (40, 7)), gap((9, 3), (44, 7))),
        (headless((5, 3), (20, 4), (40, 7)), gap((9, 3), (44, 7))),
        (headless((5, 3), count=30), gap((9, 3), count=30)),
    ):
        assert fold([cut, missing]) == ((cut,), (missing,))


@pytest.mark.parametrize(
    ("cut", "missing"),
    [
        (headless((5, 31)), gap((9, 30))), (headless((5, 31)), gap((4, 31))), (headless((5, 31)), gap((9, 31), lost=2)),
        (headless((5, 31)), gap((9, 31), node=25)), (headless((5, 3)), gap((9, 3), (44, 7))),
        (headless((5, 3)), gap((9, 3), count=2)), (headless((5, 3)), gap((9, 3), (44, 3))),
    ],
)  # fmt: skip
def test_other_gaps_stay(cut: Finding, missing: Finding) -> None:
    assert fold([cut, missing]) == ((cut, missing), ())


def test_what_is_folded_is_waived_with_what_says_it() -> None:
    lost, ended = about("TRF-003", 5), about("TRF-006", 5)
    waived = replace(lost, waiver=Waiver("known", "me", "2030-01-01"))
    for shown, excused in ((lost, ""), (waived, "waived")):
        assert [(one.rule, one.excused) for one in breaches("1", [shown], [ended])] == [
            ("TRF-003", excused), ("TRF-006", excused),
        ]  # fmt: skip
    assert breaches("2", [lost], [ended]) == []


def stopped(rule: str, t: int, name: str = "ESCStatus", **more: Any) -> Finding:
    """A silence of node 13 from so many ms on, behind a frame of that number."""
    one = about(rule, t, **{"severity": "warning", **more})
    return replace(one, type=name, examples=(Example(t, t * 10**6, ""),))


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        (stopped("BUS-035", 9000), stopped("BUS-025", 9000), True),
        (stopped("BUS-035", 9000, ""), stopped("BUS-025", 8000), True),
        (stopped("BUS-035", 9000, "RawCommand"), stopped("BUS-007", 9000, "RawCommand", severity="note"), True),
        (stopped("BUS-035", 9000, ""), stopped("BUS-007", 8990, "RawCommand", severity="note"), False),
        (stopped("BUS-035", 9000, "PUSHCAN"), stopped("BUS-025", 9000), False),
        (stopped("BUS-035", 9000), stopped("BUS-025", 7000), False),
        (stopped("BUS-035", 9000, ""), stopped("BUS-025", 5000), False),
        (stopped("BUS-035", 9000, ""), stopped("BUS-025", 9100), False),
        (stopped("BUS-035", 9000, "", node=12), stopped("BUS-025", 9000), False),
    ],
)  # fmt: skip
def test_a_silence_is_told_by_the_rule_that_knows_the_type(one: Finding, other: Finding, told: bool) -> None:
    assert fold([one, other]) == (((other,), (one,)) if told else ((one, other), ()))
