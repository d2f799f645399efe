"""When a session has had enough."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit.live import Note, Row, cut, sessions, taken
from kit.reports import change, finding
from kit.rows import Frame

from analyzer.live.autostop import Autostop, AutostopPlan, parse_autostop
from analyzer.live.patterns import FindingPattern
from analyzer.report.model import Waiver

SECOND = 1_000_000_000
RULES = ("TRF-010", "TRF-016", "CAN-004", "CAP-004")


@pytest.mark.parametrize(
    ("texts", "count", "found"),
    [
        ([], None, AutostopPlan()),
        (["duration:90"], None, AutostopPlan(duration=90 * SECOND)),
        (["packets:5"], None, AutostopPlan(frames=5)),
        (["frames:5"], 3, AutostopPlan(frames=3)),
        ([], 3, AutostopPlan(frames=3)),
        (["filesize:2", "files:3"], None, AutostopPlan(size=2000, files=3)),
        (
            ["finding:error", "finding:trf-010"],
            None,
            AutostopPlan(findings=(FindingPattern("error"), FindingPattern(rule="TRF-010"))),
        ),
        (["finding:protocol:warning"], None, AutostopPlan(findings=(FindingPattern("warning", "protocol"),))),
        (["finding:CAN"], None, AutostopPlan(findings=(FindingPattern(rule="CAN"),))),
    ],
)
def test_conditions(texts: list[str], count: int | None, found: AutostopPlan) -> None:
    assert parse_autostop(texts, count, RULES) == found


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time:3", "-a time:3: there are duration, packets, frames, filesize, files, finding"),
        ("packet:3", "-a packet:3: did you mean packets:"),
        ("packets:x", "-a packets:x: 'x' is not a whole number above 0"),
        ("finding:TRF-011", "-a finding: TRF-011: no such rule (did you mean TRF-016, TRF-010, TRF)"),
        ("finding:eror", "-a finding: eror: no such rule (did you mean error)"),
        ("finding:what", "-a finding: what: no such rule (give error, warning, note, a rule or its first letters)"),
        ("finding:car:error", "-a finding: car:error: no such rule (did you mean error)"),
    ],
)
def test_conditions_that_are_none(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        parse_autostop([text], rules=RULES)


@pytest.mark.parametrize(
    ("wanted", "met"),
    [
        (FindingPattern("error"), [True, False, True]),
        (FindingPattern("warning"), [True, True, True]),
        (FindingPattern("error", "protocol"), [True, False, False]),
        (FindingPattern(rule="TRF"), [True, True, False]),
        (FindingPattern(rule="TRF-016"), [False, True, False]),
    ],
)
def test_what_a_finding_meets(wanted: FindingPattern, met: list[bool]) -> None:
    found = [finding("TRF-010"), finding("TRF-016", severity="warning"), finding("CAP-004", category="capture")]
    assert [wanted.matches(one) for one in found] == met
    assert not any(wanted.matches(replace(one, baseline="known")) for one in found)


@example(rows=[Frame(), Note(1, "behind it")], cuts=[], most=1)
@example(rows=[Frame(), Note(1, "behind it"), Frame()], cuts=[2], most=1)
@given(rows=sessions(), cuts=st.lists(st.integers(0, 25), max_size=4), most=st.integers(1, 25))
def test_it_ends_behind_the_last_frame(rows: list[Row], cuts: list[int], most: int) -> None:
    autostop = Autostop(AutostopPlan(frames=most))
    got: list[Row] = []
    due = []
    for piece in cut(rows, cuts):
        got += taken([autostop.cut(piece)])
        due.append(autostop.due())
    frames = [at for at, row in enumerate(rows) if isinstance(row, Frame)]
    end = frames[most - 1] + 1 if len(frames) >= most else len(rows)
    assert got == rows[:end]
    assert due[-1] == (len(frames) >= most)
    assert autostop.reason == (f"{most} frames" if due[-1] else "")


def test_nothing_is_cut_without_a_number() -> None:
    piece = cut([Frame()], [])[0]
    assert Autostop(AutostopPlan()).cut(piece) is piece
    assert not Autostop(AutostopPlan()).due()


def test_it_ends_in_time() -> None:
    now = [5 * SECOND]
    autostop = Autostop(AutostopPlan(duration=2 * SECOND), clock=lambda: now[0])
    assert not autostop.due()
    now[0] += 2 * SECOND - 1
    assert not autostop.due()
    now[0] += 1
    assert autostop.due()
    assert autostop.reason == "2 s are over"


@dataclass
class Recording:
    bytes: int = 0
    full: int = 0
    gone: bool = False


def test_it_ends_with_enough_bytes_or_files() -> None:
    recording = Recording()
    by_size = Autostop(AutostopPlan(size=1000), recording)
    by_files = Autostop(AutostopPlan(files=2), recording)
    recording.bytes, recording.full = 999, 1
    assert not by_size.due()
    assert not by_files.due()
    recording.bytes, recording.full = 1001, 2
    assert by_size.due()
    assert by_files.due()
    assert (by_size.reason, by_files.reason) == ("1001 bytes recorded", "2 files")


def test_it_ends_when_nobody_reads_the_recording() -> None:
    recording = Recording()
    autostop = Autostop(AutostopPlan(), recording)
    assert not autostop.due()
    recording.gone = True
    assert autostop.due()
    assert autostop.reason == "nobody reads the recording any more"


def test_it_ends_with_a_finding() -> None:
    autostop = Autostop(AutostopPlan(findings=(FindingPattern("error"), FindingPattern(rule="TRF-016"))))
    autostop.take_findings([change("CAP-004", "note"), change(waiver=Waiver("known", "bench", "2099-01-01"))])
    assert not autostop.due()
    autostop.take_findings([change("CAP-004", "note"), change("TRF-016", "note")])
    assert autostop.due()
    assert autostop.reason == "TRF-016 (note)"
    autostop.take_findings([change()])
    assert autostop.reason == "TRF-016 (note)"
