"""Verdicts of rules, the gate and coverage, from sessions made by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from kit.judged import registry

from analyzer.report.build import build
from analyzer.report.draft import JudgedCapture, ReportOptions
from analyzer.rules import verdicts
from analyzer.rules.catalogue import load
from analyzer.rules.exercised import coverage
from analyzer.rules.gate import FailOn, passage
from analyzer.rules.verdicts import RatedCapture, RatedFinding, Ruling
from dissectors.keys.pages import ORIGINS

PAGES = load(registry())
ALL = frozenset(PAGES)


def ruling(rule: str, *sessions: RatedCapture, enabled: bool = True, **page: Any) -> Ruling:
    pages = {rule: replace(PAGES[rule], **page)}
    return verdicts.rulings(pages, {rule} if enabled else (), sessions)[rule]


def session(*breaches: RatedFinding, words: str = "frames", proofs: str = "", lossy: bool = False) -> RatedCapture:
    return RatedCapture(breaches, words.split("+"), [proof for proof in proofs.split("+") if proof], lossy)


@pytest.mark.parametrize(
    ("expression", "words", "expected"),
    [
        ("a", "a", True), ("a", "b", False), ("a, b", "a", False), ("a, b", "a b", True), ("a|b", "b", True),
        ("a, b|c", "c", True), ("a, b|c", "a", False), ("a, b|c", "a b", True), ("type:X|pair:A>B", "pair:A>B", True),
    ],
)  # fmt: skip
def test_and_binds_closer_than_or(expression: str, words: str, expected: bool) -> None:
    assert verdicts.met(expression, words.split()) is expected


@pytest.mark.parametrize(
    ("severities", "expected"),
    [(["error", "note"], "FAIL"), (["note", "warning"], "WARN"), (["note"], "PASS"), ([], "PASS")],
)
def test_the_worst_finding_decides(severities: list[str], expected: str) -> None:
    found = ruling("CAN-002", session(*(RatedFinding("CAN-002", severity) for severity in severities)))
    assert (found.verdict, found.findings) == (expected, len(severities))


def test_findings_count_even_if_the_words_do_not_say_that_the_rule_was_exercised() -> None:
    assert ruling("TRF-003", session(RatedFinding("TRF-003", "error"), words="")).verdict == "FAIL"


@pytest.mark.parametrize(("excused", "verdict"), [("waived", "WAIVED"), ("known", "KNOWN")])
def test_what_is_excused_is_not_passed_either(excused: Any, verdict: str) -> None:
    one = RatedFinding("CAN-002", "error", excused)
    assert ruling("CAN-002", session(one)) == Ruling(verdict, 1, f"1 {excused}")
    assert ruling("CAN-002", session(one, RatedFinding("CAN-002", "note"))) == Ruling(verdict, 2, f"1 {excused}")
    assert ruling("CAN-002", session(one, RatedFinding("CAN-002", "error"))) == Ruling("FAIL", 2, f"1 {excused}")


def test_a_waiver_is_told_of_notes_too_but_known_notes_are_notes() -> None:
    assert ruling("CAN-002", session(RatedFinding("CAN-002", "note", "waived"))).verdict == "WAIVED"
    assert ruling("CAN-002", session(RatedFinding("CAN-002", "note", "known"))) == Ruling("PASS", 1, "notes only")


def test_frames_that_the_recorder_lost_prove_nothing() -> None:
    noted = RatedFinding("TRF-003", "note")
    assert ruling("TRF-003", session(noted, lossy=True)).verdict == "INCONCLUSIVE"
    assert ruling("TRF-003", session(noted)).verdict == "PASS"
    assert ruling("TRF-003", session(noted, RatedFinding("TRF-003", "error"), lossy=True)).verdict == "FAIL"
    assert ruling("CAN-002", session(RatedFinding("CAN-002", "note"), lossy=True)).verdict == "PASS"


def test_the_pages_say_for_which_rules() -> None:
    expected = {
        "TRF-003", "TRF-005", "TRF-006", "TRF-016", "TRF-018", "TRF-019", "TRF-021", "TRF-022", "TYP-501", "PUSH-009",
        "BUS-007", "BUS-011", "BUS-012", "BUS-014", "BUS-017", "BUS-025", "BUS-035", "BUS-038", "TRF-007", "TRF-010",
        "BUS-020", "TRF-004", "TRF-009", "TRF-026",
    }  # fmt: skip
    assert {rule for rule, page in PAGES.items() if page.drops} == expected


def test_what_did_not_occur_is_not_passed() -> None:
    assert ruling("TRF-003", session(words="frames")) == Ruling("NOT EXERCISED", needs=PAGES["TRF-003"].exercised)
    assert ruling("CAN-002", session(), enabled=False).reason == "not selected"
    assert ruling("CAN-010", session(), enabled=False).reason == "off unless selected"


def test_what_is_not_recorded_is_inconclusive() -> None:
    assert ruling("CAN-004", session()) == Ruling("INCONCLUSIVE", reason="error frames not recorded")
    assert ruling("CAN-004", session(proofs="errors")) == Ruling("PASS")
    assert ruling("CAN-004", session(RatedFinding("CAN-004", "warning"))).verdict == "WARN"
    assert ruling("CAN-004", session(words="")).verdict == "NOT EXERCISED"


def test_one_capture_can_prove_what_another_one_cannot() -> None:
    found = ruling("CAN-004", session(), session(proofs="errors"), session(words=""))
    assert found == Ruling("PASS", reason="inconclusive in 1 of 2 captures")


@pytest.mark.parametrize(
    ("proofs", "expected"),
    [("", "INCONCLUSIVE"), ("bit rate", "PASS"), ("hardware times", "PASS"), ("times", "INCONCLUSIVE")],
)
def test_a_bit_rate_or_hardware_times_are_enough(proofs: str, expected: str) -> None:
    page = {"inconclusive": ("bit rate", "hardware times"), "exercised": "frames"}
    assert ruling("BUS-019", session(proofs=proofs), **page).verdict == expected


def test_all_other_proofs_are_needed_together() -> None:
    page = {"inconclusive": ("bit rate", "times"), "exercised": "frames"}
    assert ruling("BUS-004", session(proofs="times+bit rate"), **page).verdict == "PASS"
    assert ruling("BUS-004", session(proofs="hardware times+times"), **page).verdict == "INCONCLUSIVE"
    assert ruling("BUS-004", session(), **page).reason == "bit rate not given (--bitrate), times not recorded"


def test_every_page_can_be_judged() -> None:
    found = verdicts.rulings(PAGES, ALL, [session(words="", proofs="")])
    assert list(found) == list(PAGES)
    assert {one.verdict for one in found.values()} == {"NOT EXERCISED"}


# ---- the gate -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("protocol:error", ("protocol:error",)),
        ("Protocol:Warning, device:error", ("device:error", "protocol:warning")),
        ("any:note", ("capture:note", "device:note", "protocol:note")),
        ("any:error,device:warning", ("capture:error", "device:warning", "protocol:error")),
        ("never", ("never",)),
    ],
)
def test_fail_on(text: str, names: tuple[str, ...]) -> None:
    assert FailOn.parse([text]).names == names


@pytest.mark.parametrize("text", ["", "error", "protocol", "protocol:", "bus:error", "protocol:bad", "never,any:note"])
def test_fail_on_says_what_is_allowed(text: str) -> None:
    with pytest.raises(ValueError, match="CATEGORY:SEVERITY"):
        FailOn.parse([text])


def test_at_or_above() -> None:
    gate = FailOn.parse(["protocol:warning"])
    assert [gate.fails("protocol", severity) for severity in ("error", "warning", "note")] == [True, True, False]
    assert not gate.fails("device", "error")


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        ((0, [], [], []), 0), ((2, ["a"], ["b"], ["c"]), 1), ((0, ["a"], [], ["c"]), 4), ((0, [], ["b"], ["c"]), 4),
        ((0, [], [], ["c"]), 3), ((0, [], [], ["c"], ["d"]), 4), ((1, [], [], [], ["d"]), 1),
    ],
)  # fmt: skip
def test_findings_win_over_no_judgement_and_that_over_damage(arguments: Any, status: int) -> None:
    found = passage(*arguments)
    assert (found.exit_status, found.failed) == (status, status == 1)
    assert bool(found.reason) is bool(status)
    assert all(name in found.reason for names in arguments[1:] for name in names)


# ---- coverage -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4.1.3 Transfer ID", ["4.1.3"]), ("-", []), ("checksum rows", []), ("6 (V2.2)", ["6"]),
        ("4.4.1 expl. 2, 5b", ["4.4.1"]), ("5.3 (struct len), 4.3.1 (36/74/260)", ["5.3", "4.3.1"]),
        ("4.4.2 no 21, 4.4.6 no 35", ["4.4.2", "4.4.6"]), ("4.4.4/4.4.5", ["4.4.4", "4.4.5"]),
    ],
)  # fmt: skip
def test_the_numbers_of_clauses(text: str, expected: list[str]) -> None:
    assert coverage.clauses_of(text) == expected


def test_a_clause_is_as_bad_as_its_worst_rule() -> None:
    rulings = dict.fromkeys(PAGES, Ruling("NOT EXERCISED"))
    assert set(coverage.clauses(PAGES, rulings).values()) == {"NOT EXERCISED"}
    rulings |= {"CAN-002": Ruling("FAIL"), "CAN-006": Ruling("PASS"), "TRF-001": Ruling("PASS")}
    found = coverage.clauses(PAGES, rulings)
    assert (found["4.1.2"], found["4.1.3"], found["4.4.1"]) == ("FAIL", "PASS", "NOT EXERCISED")
    assert list(found) == sorted(found, key=lambda clause: [int(part) for part in clause.split(".")])


def test_what_no_capture_can_show_is_listed_with_its_reason() -> None:
    found = coverage.never(registry())
    assert len(found) >= 5
    assert all("(" in text for text in found)
    assert any(text.startswith("4.1 bit timing") for text in found)


def test_counts_of_captures_add_up() -> None:
    one = coverage.Seen({"A": 1, "B": 0}, {"P": 2}, {"A.mode": {"on": 1, "off": 0}})
    other = coverage.Seen({"A": 2, "C": 1}, {"P": 0}, {"A.mode": {"on": 0, "off": 3}})
    total = coverage.added([one, other])
    assert total.types == {"A": 3, "B": 0, "C": 1}
    assert total.packets == {"P": 2}
    assert total.values == {"A.mode": {"on": 1, "off": 3}}


@pytest.mark.slow
def test_nothing_makes_a_report_too() -> None:
    from analyzer.rules.settings import Settings  # noqa: PLC0415

    taken: list[JudgedCapture] = []
    report = build(taken, registry(), PAGES, Settings(), ReportOptions("tailbyte", FailOn.parse(["never"])))
    assert {rule.origin for rule in report.rules} <= set(ORIGINS)
    assert (report.captures, report.findings, report.gate.exit_status) == ((), (), 0)
