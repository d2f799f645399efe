"""`decode --findings`: rows say which rules name them, and agree with `check`."""

from __future__ import annotations

import csv
import io
import json
import re
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES

import analyzer
from analyzer.cli import main
from analyzer.rules.named_frames import NamedFrames
from dissectors.kit import Occurrence

if TYPE_CHECKING:
    from pathlib import Path

FAULTS = CAPTURES / "faults.log"
LOGS = [FAULTS, CAPTURES / "bus-break.log", CAPTURES / "duplicate-node.log", CAPTURES / "services.log"]


def listed(capfd: pytest.CaptureFixture[str], *args: object) -> list[str]:
    assert main(["decode", *map(str, args)]) in (0, 3)
    return capfd.readouterr().out.splitlines()


def objects(capfd: pytest.CaptureFixture[str], *args: object) -> list[dict[str, Any]]:
    return [json.loads(line) for line in listed(capfd, *args, "--findings", "-T", "jsonl")]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.stem)
def test_the_first_row_of_each_finding_is_marked(capfd: pytest.CaptureFixture[str], path: Path) -> None:
    found = [one for one in analyzer.check(path).findings if one.first.frame is not None]
    marked = {row["frame"]: row["findings"] for row in objects(capfd, path, "--frame-list")}
    assert found
    assert {rule for rules in marked.values() for rule in rules} <= {one.rule for one in found}
    for one in found:
        assert one.rule in marked[one.first.frame], one


@pytest.mark.slow
def test_text_details_and_csv(capfd: pytest.CaptureFixture[str]) -> None:
    text = listed(capfd, FAULTS, "--findings")
    assert any(re.match(r"x +453 .* ESCStatus +10  \[TRF-003\] broken, 2 of 3 frames$", line) for line in text)
    assert any(re.match(r"x +1366 .* \[CAN-002\] remote frame  1F05340E#R8$", line) for line in text)
    assert "    findings: TRF-003" in listed(capfd, FAULTS, "--findings", "-V", "--frames", "453-454")
    rows = list(csv.DictReader(io.StringIO("\n".join(listed(capfd, FAULTS, "--findings", "-T", "csv")))))
    assert {row["frame"]: row["findings"] for row in rows}["453"] == "TRF-003"
    assert all("findings" not in json.loads(row) for row in listed(capfd, FAULTS, "-T", "jsonl", "-c", 3))


def test_a_window_shows_marks_of_the_whole_capture(capfd: pytest.CaptureFixture[str]) -> None:
    assert objects(capfd, FAULTS, "--frames", "453-454") == [
        row for row in objects(capfd, FAULTS) if row["frame"] == 453
    ]


@pytest.mark.parametrize(
    "args", [["-T", "fields", "-e", "frame.number"], ["-q"], ["--follow"]], ids=lambda args: args[0]
)
def test_what_does_not_go_together(capfd: pytest.CaptureFixture[str], args: list[str]) -> None:
    assert main(["decode", str(FAULTS), "--findings", *args]) == 2
    assert "--findings" in capfd.readouterr().err


def test_a_pipe_exists_only_once(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    with FAULTS.open("rb") as file:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(file))
        assert main(["decode", "-", "--findings"]) == 2
    assert "reads a capture twice" in capfd.readouterr().err


def test_only_what_is_kept_is_told() -> None:
    named = NamedFrames()
    for rule, node, frames in (("TRF-003", 11, [5, 6]), ("TRF-006", 11, [5]), ("CAP-002", None, [9])):
        named.feed(Occurrence(rule, 0, 0, node, "", frames, {}))
    named.finish([("TRF-003", 0, 11), ("CAP-002", 0, -1)])
    assert named.between(0, 100) == {5: ["TRF-003"], 6: ["TRF-003"], 9: ["CAP-002"]}
    assert named.between(6, 8) == {6: ["TRF-003"]}
