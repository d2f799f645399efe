"""Times that are too coarse for rules about time: what is found with them is a note and proves nothing."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES
from kit.judged import registry

import analyzer
from analyzer.cli import main
from analyzer.decode.engine import Engine
from analyzer.facts.clock import TimeResolution

if TYPE_CHECKING:
    from pathlib import Path

HOVER = CAPTURES / "hover-4.log"
FRAME = "can0 1F040A0B#9E720010361D4480\n"


def rounded(path: Path, step_us: int, to: Path) -> Path:
    """The capture as a recorder writes it that knows the time to `step_us` only."""

    def time(found: re.Match[str]) -> str:
        us = (int(found[1]) * 1_000_000 + int(found[2])) // step_us * step_us
        return f"({us // 1_000_000}.{us % 1_000_000:06d})"

    to.write_text(re.sub(r"\((\d+)\.(\d{6})\)", time, path.read_text()))
    return to


def coarse(text: str, cut: int) -> bool:
    """What the clock says of candump text in batches of so many lines."""
    engine, clock, lines = Engine(registry()), TimeResolution(), text.encode().splitlines(keepends=True)
    for at in range(0, len(lines), cut):
        batches = [*engine.feed(b"".join(lines[at : at + cut])), engine.flush()]
        for batch in batches:
            clock.feed(batch)
    return clock.coarse


@pytest.mark.parametrize("cut", [1, 7, 1000])
@pytest.mark.parametrize(
    ("times_us", "expected"),
    [
        ([0, 0, 0, 1_000_000, 1_000_000, 1_000_000, 2_000_000, 2_000_000], True),
        ([0, 0, 0, 15_625, 15_625, 15_625, 31_250, 31_250], True),
        ([0, 0, 0, 1_000_000, 1_000_000, 1_000_000, 2_000_000, 2_000_100], False),
        ([0, 0, 0, 10_000, 10_000, 10_000, 20_000, 20_000], False),
        ([0, 1_000_000, 2_000_000, 3_000_000], False),  # nothing shares a time: it may be so
        ([1_000_000, 1_000_000, 1_000_000, 1_000_000, 0, 0, 0, 0], False),  # one step says nothing
        ([0], False),
        ([], False),
    ],
)
def test_frames_that_share_times_far_apart_are_coarse(times_us: list[int], expected: bool, cut: int) -> None:
    text = "".join(f"({t // 1_000_000 + 1}.{t % 1_000_000:06d}) {FRAME}" for t in times_us)
    assert coarse(text, cut) is expected


def test_a_recording_in_whole_seconds_does_not_fail_rules_about_time(tmp_path: Path) -> None:
    report = analyzer.check(rounded(HOVER, 1_000_000, tmp_path / "coarse.log"))
    assert report.captures[0].can_judge["timing"] == "coarse"
    found = [one for one in report.findings if one.rule == "BUS-007"]
    assert found
    assert {one.severity for one in report.findings} == {"note"}
    assert {one.cause for one in found} == {"times too coarse"}
    verdicts = {one.rule: (one.verdict, one.reason) for one in report.rules}
    assert verdicts["BUS-007"] == verdicts["BUS-006"] == ("INCONCLUSIVE", "times too coarse")
    assert verdicts["TRF-003"][0] == "PASS"


def test_what_needs_no_times_is_judged_all_the_same(tmp_path: Path) -> None:
    faults = CAPTURES / "mission-8-faults.log"
    errors = [one.rule for one in analyzer.check(faults).findings if one.severity == "error"]
    again = analyzer.check(rounded(faults, 100_000, tmp_path / "coarse.log"))
    assert sorted(one.rule for one in again.findings if one.severity == "error") == sorted(errors)
    assert again.gate.exit_status == 1


def test_a_severity_that_somebody_gave_stays(tmp_path: Path) -> None:
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text('[rule.BUS-007]\nseverity = "error"\n')
    report = analyzer.check(rounded(HOVER, 1_000_000, tmp_path / "coarse.log"), vehicle=vehicle)
    assert {one.severity for one in report.findings if one.rule == "BUS-007"} == {"error"}


@pytest.mark.slow
def test_usual_recordings_tell_time_well_enough(tmp_path: Path) -> None:
    for path in (HOVER, rounded(HOVER, 1000, tmp_path / "ms.log"), rounded(HOVER, 10_000, tmp_path / "10ms.log")):
        assert analyzer.check(path).captures[0].can_judge["timing"] == "yes"


@pytest.mark.slow
def test_parts_that_show_doubtful_findings_are_found(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    capture, folder = rounded(HOVER, 1_000_000, tmp_path / "coarse.log"), tmp_path / "parts"
    assert main(["check", str(capture), "--select", "BUS-007", "--extract", str(folder)]) == 4
    assert "no part" not in capfd.readouterr().err
    assert list(folder.glob("BUS-007-*.log"))
