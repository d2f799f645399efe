"""Comparison with an older report: rates count, not numbers of occurrences."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES
from kit.reports import START, finding

import analyzer
from analyzer.report.baseline import Baseline, BaselineError
from analyzer.report.json import render
from analyzer.report.model import SCHEMA, BusUse, CaptureSummary, NodeUse

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.report.model import Finding


def capture(transfers: int, frames: int = 10_000) -> CaptureSummary:
    node = NodeUse("can0", 24, "", "", "ESC", "", {"ESCStatus": transfers}, 50.0, 0, None, None)
    return CaptureSummary(
        "1", "a.log", "0", "candump", START, START, frames, transfers, {}, {}, {}, {},
        (BusUse("can0", frames, 1.0, 1, None),), (node,),
    )  # fmt: skip


def broken(count: int, **more: Any) -> Finding:
    return finding("TRF-003", type="ESCStatus", count=count, **more)


def older(tmp_path: Path, findings: list[Finding], captures: list[CaptureSummary]) -> Baseline:
    path = tmp_path / "old.json"
    rows = [{name: getattr(one, name) for name in ("rule", "bus", "node", "type", "key", "count")} for one in findings]
    held = [
        {
            "buses": [{"name": bus.name, "frames": bus.frames} for bus in one.buses],
            "nodes": [{"bus": node.bus, "node": node.node, "types": node.types} for node in one.nodes],
        }
        for one in captures
    ]
    path.write_text(json.dumps({"schema": SCHEMA, "findings": rows, "captures": held}))
    return Baseline.load(path)


def marks(baseline: Baseline, findings: list[Finding], captures: list[CaptureSummary]) -> list[str]:
    return [one.baseline for one in baseline.compare(findings, captures)]


def test_the_same_capture_again_is_known(tmp_path: Path) -> None:
    for count in (1, 2, 1000):
        found, of = [broken(count)], [capture(1000)]
        assert marks(older(tmp_path, found, of), found, of) == ["known"]


def test_ten_times_as_long_may_have_ten_times_as_many(tmp_path: Path) -> None:
    old = older(tmp_path, [broken(20)], [capture(1000)])
    assert marks(old, [broken(200)], [capture(10_000)]) == ["known"]
    assert marks(old, [broken(200)], [capture(1000)]) == ["worse"]


def test_runs_of_one_trouble_are_added_up(tmp_path: Path) -> None:
    old = older(tmp_path, [broken(10), broken(10)], [capture(1000)])
    assert marks(old, [broken(20)], [capture(1000)]) == ["known"]
    assert marks(old, [broken(30), broken(30)], [capture(1000)]) == ["worse", "worse"]


@pytest.mark.parametrize("change", [{"node": 25}, {"type": "PUSHCAN"}, {"key": "cause=swapped"}, {"bus": "can1"}])
def test_another_session_or_cause_is_new(tmp_path: Path, change: dict[str, Any]) -> None:
    old = older(tmp_path, [broken(5)], [capture(1000)])
    assert marks(old, [replace(broken(5), **change)], [capture(1000)]) == ["new"]


def test_of_a_bus_frames_are_counted(tmp_path: Path) -> None:
    load = [finding("BUS-001", node=None, count=30)]
    old = older(tmp_path, load, [capture(10, frames=1000)])
    assert marks(old, load, [capture(10, frames=1000)]) == ["known"]
    assert marks(old, load, [capture(10, frames=100)]) == ["worse"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "line 1: "),
        ("[]", "no report of the form"),
        ('{"schema": "tailbyte.check/9"}', "no report of the form"),
        (f'{{"schema": "{SCHEMA}"}}', "a damaged report"),
        (f'{{"schema": "{SCHEMA}", "findings": [1], "captures": []}}', "a damaged report"),
        (f'{{"schema": "{SCHEMA}", "findings": [], "captures": [{{"buses": [], "nodes": [{{}}]}}]}}', "a damaged"),
        ("[" * 100_000, "nested too deeply"),
        ("\udcff", "no JSON text"),
    ],
)
def test_what_is_no_report_is_told(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "old.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(BaselineError) as error:
        Baseline.load(path)
    assert str(error.value).startswith(f"{path}: {reason}")


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(BaselineError, match="No such file"):
        Baseline.load(tmp_path / "none.json")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("path", sorted(CAPTURES.glob("*.log")), ids=lambda path: path.stem)
def test_no_capture_is_worse_than_itself(tmp_path: Path, path: Path) -> None:
    report = analyzer.check(path)
    old = tmp_path / "old.json"
    old.write_text(render(report))
    found = Baseline.load(old).compare(report.findings, report.captures)
    assert [one.baseline for one in found] == ["known"] * len(report.findings)


@pytest.mark.parametrize(
    "told",
    [{"type": "DeviceTemperature"}, {"node": 30}, {"node": None}, {"bus": "can7"}, {"bus": "", "node": None}],
)
def test_what_is_about_transfers_that_never_came_has_a_rate_too(tmp_path: Path, told: dict[str, Any]) -> None:
    def silent(count: int) -> list[Finding]:
        return [replace(broken(count), **told)]

    old = older(tmp_path, silent(5), [capture(1000)])
    assert marks(old, silent(5), [capture(1000)]) == ["known"]
    assert marks(old, silent(50), [capture(10_000, frames=100_000)]) == ["known"]
    assert marks(old, silent(50), [capture(1000)]) == ["worse"]


def test_a_capture_without_frames_compares_counts(tmp_path: Path) -> None:
    of = [replace(capture(0), buses=(), nodes=())]
    old = older(tmp_path, [broken(2)], of)
    assert marks(old, [broken(2)], of) == ["known"]
    assert marks(old, [broken(20)], of) == ["worse"]
