"""check says what its answer rests on: rules that judged nothing, limits that let errors through, waivers, windows."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES

from analyzer.cli import main
from analyzer.rules.gate import DEFAULT, LEAST_SECONDS, LEAST_TRANSFERS
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

HOVER, FAULTS = CAPTURES / "hover-4.log", CAPTURES / "mission-8-faults.log"
WAIVER = '[[waiver]]\nrule = "{}"\nreason = "{}"\nowner = "{}"\nexpires = {}\n'


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> Command:
    def call(*args: object) -> tuple[int, str, str]:
        status = main([str(arg) for arg in args])
        return status, *capfd.readouterr()

    return call


# ---- nothing judged -------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("rule", "why"),
    [
        ("CAN-004", "CAN-004 INCONCLUSIVE (error frames not recorded)"),
        ("TRF-028", "TRF-028 NOT EXERCISED (no "),
        ("TYP-011", "TYP-011 NOT EXERCISED (no "),
        ("CAN-004,TYP-011", "CAN-004 INCONCLUSIVE (error frames not recorded), TYP-011"),
    ],
)
def test_rules_of_which_none_was_judged_are_no_pass(command: Command, rule: str, why: str) -> None:
    status, out, _ = command("check", HOVER, "--select", rule)
    assert status == 4
    assert out.startswith("NOT JUDGED")
    assert f"no selected rule could be judged: {why}" in " ".join(out.split())
    _, out, _ = command("check", HOVER, "--select", rule, "--json", "-")
    gate = json.loads(out)["gate"]
    assert (gate["judged"], gate["exit_status"]) == (False, 4)
    assert why in gate["reason"]


def test_one_rule_that_was_judged_is_enough(command: Command) -> None:
    assert command("check", HOVER, "--select", "CAN-004,CAN-002")[0] == 0


def test_help_and_manual_state_the_defaults(command: Command) -> None:
    text = " ".join(command("check", "--help")[1].split())
    assert f"(default: {DEFAULT})" in text
    assert f"transfers={LEAST_TRANSFERS}, seconds={LEAST_SECONDS:g} are the defaults" in text
    manual = " ".join(command("help", "check")[1].split())
    assert f"fewer than {LEAST_TRANSFERS} complete transfers, or of less than {LEAST_SECONDS:g} s," in manual


# ---- the headline ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_without_a_limit_there_is_no_pass(command: Command) -> None:
    status, out, _ = command("check", FAULTS, "--fail-on", "never")
    assert status == 0
    assert out.startswith("ERRORS NOT GATED  5 protocol errors")
    assert command("check", HOVER, "--fail-on", "never")[1].startswith("PASS WITH WARNINGS")


@pytest.mark.slow
def test_errors_that_a_limit_lets_through_are_named(command: Command) -> None:
    status, out, _ = command("check", FAULTS, "--fail-on", "device:error")
    assert status == 0
    assert "\n      --fail-on device:error: 5 errors not counted\n" in out
    for form in ("--markdown", "--html"):
        assert "5 errors not counted" in command("check", FAULTS, "--fail-on", "device:error", form, "-")[1]
    assert "not counted" not in command("check", FAULTS)[1]


@pytest.mark.slow
def test_what_a_baseline_knows_is_known_and_not_failed(command: Command, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    command("check", FAULTS, "--json", old)
    status, out, _ = command("check", FAULTS, "--baseline", old, "--json", "-")
    rules = json.loads(out)["rules"]
    verdicts = {one["verdict"] for one in rules}
    assert (status, verdicts) == (0, {"PASS", "KNOWN", "NOT EXERCISED", "INCONCLUSIVE"})
    assert next(one for one in rules if one["rule"] == "TRF-010")["reason"] == "1 known"
    _, out, _ = command("check", FAULTS, "--baseline", old)
    (counts,) = (line for line in out.splitlines() if line.startswith("Rules "))
    assert " known" in counts
    assert "fail" not in counts


def test_the_rule_to_read_about_is_the_worst(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("nonsense first\n" + FAULTS.read_text())
    last = command("check", path)[1].splitlines()[-1]
    assert last.startswith("See: tailbyte explain CAN-002 ")


# ---- waivers --------------------------------------------------------------------------------------------------------


@pytest.fixture
def waivers(tmp_path: Path) -> Path:
    path = tmp_path / "vehicle.toml"
    current, over = ("TRF-010", "flash wears", "bench", "9999-12-31"), ("CAN-002", "old tool", "field", "2020-01-02")
    path.write_text(WAIVER.format(*current) + WAIVER.format(*over))
    return path


def test_json_says_what_became_of_each_waiver(command: Command, waivers: Path) -> None:
    status, out, err = command("check", FAULTS, "--vehicle", waivers, "--json", "-")
    content = json.loads(out)
    assert status == 1
    assert err.count("expired on 2020-01-02") == 1
    assert [(one["rule"], one["expired"], one["findings"]) for one in content["waivers"]] == [
        ("TRF-010", False, 1), ("CAN-002", True, 1),
    ]  # fmt: skip
    assert content["waivers"][1] | {"rule": ""} == {
        "rule": "", "node": None, "type": "", "reason": "old tool", "owner": "field", "expires": "2020-01-02",
        "expired": True, "findings": 1,
    }  # fmt: skip
    verdicts = {one["rule"]: one["verdict"] for one in content["rules"]}
    assert (verdicts["TRF-010"], verdicts["CAN-002"]) == ("WAIVED", "FAIL")


@pytest.mark.slow
def test_every_report_tells_of_waivers_and_of_those_that_are_over(command: Command, waivers: Path) -> None:
    for args in ([], ["--all"], ["--markdown", "-"], ["--html", "-"], ["--junit", "-"]):
        out = " ".join(command("check", FAULTS, "--vehicle", waivers, *args)[1].split())
        plain = out.replace("`", "").replace("&#58;", ":")
        assert "waiver of CAN-002 until 2020-01-02 by field: EXPIRED, does not count, 1 finding: old tool" in plain
        assert "waiver of TRF-010 until 9999-12-31 by bench: counts, 1 finding: flash wears" in plain
    text = command("check", FAULTS, "--vehicle", waivers)[1]
    assert "1 waived" in next(line for line in text.splitlines() if line.startswith("Rules "))


def test_junit_skips_what_is_waived_and_what_is_over(command: Command, waivers: Path) -> None:
    root = ET.fromstring(command("check", FAULTS, "--vehicle", waivers, "--junit", "-")[1])
    cases = {case.get("name"): case for case in root.iter("testcase")}
    over = cases["waiver 2 CAN-002"].find("skipped")
    assert over is not None
    assert "EXPIRED" in (over.get("message") or "")
    assert cases["waiver 1 TRF-010"].find("skipped") is None


# ---- windows --------------------------------------------------------------------------------------------------------


def report(command: Command, *args: object) -> Any:
    return json.loads(command("check", *args, "--json", "-")[1])


def test_a_window_is_judged_as_a_capture_of_its_own(command: Command) -> None:
    whole, part = report(command, FAULTS), report(command, FAULTS, "--from", "2", "--to", "3")
    (capture,) = part["captures"]
    assert 0 < capture["frames"] == capture["accounting"]["lines"] < whole["captures"][0]["frames"]
    assert capture["can_judge"]["start"] == "no"
    assert part["settings"]["window"] == "--from 2 --to 3"
    assert capture["end_ns"] - capture["start_ns"] <= 1_000_000_000
    every = {(one["rule"], frame) for one in whole["findings"] for frame in one["frames"]}
    errors = {(one["rule"], frame) for one in part["findings"] if one["severity"] == "error" for frame in one["frames"]}
    assert errors
    assert errors <= every, "frames have the numbers that they have in the file"


@pytest.mark.sampled(4)
@pytest.mark.parametrize("window", [["--frames", "100-2000"], ["--last", "2s"], ["--around", "2000+-500ms"]])
def test_any_window_of_a_healthy_flight_passes(command: Command, window: list[str]) -> None:
    status, out, err = command("check", HOVER, *window)
    assert (status, err) == (0, "")
    assert f"only {' '.join(window)}" in out
    assert "start NO" in out


@pytest.mark.sampled(4)
@pytest.mark.parametrize("first", range(2400, 2408))
def test_transfers_that_the_edges_of_a_window_cut_are_no_findings(first: int, command: Command) -> None:
    """Whatever frame of a transfer it begins and ends with: the whole capture has none of that."""
    there = {one["rule"] for one in report(command, HOVER)["findings"]}
    found = report(command, HOVER, "--frames", f"{first}-{first + 1501}")["findings"]
    assert {one["rule"] for one in found} <= there
    last = report(command, HOVER, "--frames", f"-{first}")["findings"]
    assert {one["rule"] for one in last} <= there


@pytest.mark.parametrize("name", ["check", "info"])
def test_windows_that_make_no_sense(command: Command, name: str) -> None:
    status, out, err = command(name, HOVER, "--from", "soon")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "--from: 'soon' is not a time" in err
    status, out, err = command(name, HOVER, "--from", "100")
    assert (status, out, err) == (2, "", f"tailbyte: {HOVER}: nothing is inside the window: --from 100\n")
    status, out, err = command(name, HOVER, "--from", "3", "--to", "2s")
    assert (status, out, err.endswith(": --from 3 is after --to 2s\n")) == (2, "", True)


def test_info_of_a_window(command: Command) -> None:
    status, out, err = command("info", HOVER, "--frames", "101-200", "-T", "json")
    content = json.loads(out)
    assert (status, err, content["lines"]["frames"], content["balanced"]) == (0, "", 100, True)
    assert content["judge"]["start"] == "NO"


def test_a_clock_that_was_set_back_keeps_the_numbers_of_frames(command: Command, tmp_path: Path) -> None:
    path, rows = tmp_path / "a.log", FAULTS.read_text().splitlines(keepends=True)
    path.write_text("".join(rows[:6000] + rows[:2000] + rows[6000:]))
    part = report(command, path, "--from", "2", "--select", "CAN-002,TRF-010")
    assert {one["rule"]: one["frames"] for one in part["findings"]} == {"CAN-002": [4815], "TRF-010": [8680]}


# ---- width ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_columns_are_honoured_in_a_pipe(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "50")
    narrow = command("check", FAULTS)[1].splitlines()
    words = [line for line in narrow if not re.match(r" +tailbyte (decode|triage) ", line)]  # a command stays a line
    assert max(map(display_width, words)) == 50
    assert "error    TRF-003  ch2 node 12" in narrow
    monkeypatch.setenv("COLUMNS", "110")
    assert command("check", FAULTS)[1].splitlines()[0].endswith("exit 1")
    assert display_width(command("check", FAULTS)[1].splitlines()[0]) == 110
    monkeypatch.delenv("COLUMNS")
    assert display_width(command("check", FAULTS)[1].splitlines()[0]) == 80
