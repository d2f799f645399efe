"""check with what is expected: vehicle files, older reports, and a first vehicle file from a capture."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES

from analyzer.app.check import check
from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Check = Callable[..., tuple[int, Any, str]]

HOVER, FAULTS = CAPTURES / "hover-4.log", CAPTURES / "mission-8-faults.log"
ERRORS = {"CAN-002", "CAN-005", "TRF-003", "TRF-010", "PUSH-005"}  # of FAULTS, by default
WAIVER = '[[waiver]]\nrule = "{}"\nreason = "known"\nowner = "bench"\nexpires = {}\n'


@pytest.fixture
def judged(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Check:
    """Runs check with a vehicle file of this text: exit status, the report as JSON (None without one), complaints."""

    def call(text: str, *args: object) -> tuple[int, Any, str]:
        path = tmp_path / "vehicle.toml"
        path.write_text(text)
        status = main(["check", "--vehicle", str(path), "--json", "-", *map(str, args)])
        out, err = capfd.readouterr()
        return status, json.loads(out) if out else None, err

    return call


def unmet(report: Any) -> dict[str, str]:
    return {one["what"]: one["found"] for one in report["gate"]["requirements"] if not one["met"]}


@pytest.mark.slow
def test_waivers_and_those_that_are_over(judged: Check) -> None:
    valid = "".join(WAIVER.format(rule, "9999-12-31") for rule in sorted(ERRORS))
    status, report, err = judged(valid, FAULTS)
    assert (status, err) == (0, "")
    waived = [one for one in report["findings"] if one["waiver"]]
    assert {one["rule"] for one in waived} == ERRORS
    assert waived[0]["waiver"] == {"reason": "known", "owner": "bench", "expires": "9999-12-31"}
    assert not any(one["fails"] for one in report["findings"])
    status, report, err = judged(valid.replace("9999", "2020", 1), FAULTS)  # CAN-002, the first by name
    assert status == 1
    assert {one["rule"] for one in report["findings"] if one["fails"]} == {"CAN-002"}
    assert "waiver of CAN-002 by bench expired on 2020-12-31" in err
    assert err.count("\n") == 1


def test_a_waiver_for_another_node_does_not_count(judged: Check) -> None:
    text = WAIVER.format("TRF-010", "9999-12-31")
    _, report, _ = judged(text + "node = 14\n", FAULTS)
    assert {one["node"] for one in report["findings"] if one["waiver"]} == {14}
    _, report, _ = judged(text + "node = 15\n", FAULTS)
    assert not any(one["waiver"] for one in report["findings"])


def test_numbers_severities_rules_and_labels_come_from_the_file(judged: Check) -> None:
    text = """\
name = "octo"
bit_rate = 1000000
[node.14]
label = "rear left"
[rule.TRF-010]
severity = "note"
[rule.CAN-002]
enabled = false
[rule.BUS-001]
limit_per_s = 2000
"""
    status, report, _ = judged(text, FAULTS)
    settings = report["settings"]
    assert (status, settings["profile"], settings["bit_rate"]) == (1, "octo", 1_000_000)
    assert settings["limits"]["BUS-001"]["limit_per_s"] == 2000
    assert settings["changed"] == ["BUS-001.limit_per_s"]
    assert settings["severities"] == {"TRF-010": "note"}
    (crc,) = (one for one in report["findings"] if one["rule"] == "TRF-010")
    assert (crc["severity"], crc["label"], crc["fails"]) == ("note", "rear left", False)
    assert "CAN-002" not in {one["rule"] for one in report["findings"]}
    labels = {one["node"]: one["label"] for one in report["captures"][0]["nodes"]}
    assert (labels[13], labels[14]) == ("ch3", "rear left")


def test_requirements_that_are_met(judged: Check) -> None:
    text = """\
escs = 4
[node.11]
label = "front left"
rates = { ESCStatus = 32, "uavcan.protocol.NodeStatus" = 2 }
[unit]
0xA1 = 11
[require]
types = ["RawCommand", "MotorStatus"]
rules = ["TRF-010"]
escs = 4
running_s = 1
"""
    status, report, _ = judged(text, HOVER)
    assert (status, unmet(report), len(report["gate"]["requirements"])) == (0, {}, 10)


@pytest.mark.slow
def test_what_is_expected_and_not_so_fails(judged: Check) -> None:
    text = """\
escs = 5
[node.11]
rates = { ESCStatus = 35, ParamCfg = 1 }
[node.19]
label = "spare"
[unit]
0xA1 = 12
0xA7 = 11
"""
    status, report, _ = judged(text, HOVER)
    gate = report["gate"]
    assert (status, gate["judged"], gate["failed"]) == (1, True, True)
    assert (
        "expected but not met: ESCStatus of node 11 at 35/s, ParamCfg of node 11 at 1/s, node 19 (spare) and 3"
        in (gate["reason"])
    )
    assert unmet(report) == {
        "5 ESCs": "4",
        "node 19 (spare)": "0 transfers",
        "ESCStatus of node 11 at 35/s": "30/s",
        "ParamCfg of node 11 at 1/s": "0 transfers in 5 s",
        "power unit 0xA1 at node 12": "node 11",
        "power unit 0xA7 at node 11": "no status of it",
    }
    assert judged(text, HOVER, "--fail-on", "never")[0] == 0
    assert judged(text, HOVER, "--fail-on", "device:error")[0] == 1
    assert judged(text + "[require]\nescs = 5\n", HOVER)[0] == 1  # what is unlike the vehicle goes before


def test_what_is_expected_is_told_in_the_first_line(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text("escs = 5\n[node.19]\n[node.11]\n")
    assert main(["check", "--vehicle", str(path), str(HOVER)]) == 1
    out = capfd.readouterr().out
    assert out.startswith("FAIL  2 expectations not met, ")
    assert out.count("NOT MET, found ") == 2


def test_nothing_is_expected_of_what_cannot_be_judged(judged: Check, tmp_path: Path) -> None:
    foreign, timeless = tmp_path / "foreign.log", tmp_path / "timeless.log"
    foreign.write_text("(1.000000) can0 123#1122\n")
    status, report, _ = judged("[node.11]\n", foreign)
    assert (status, report["gate"]["requirements"]) == (4, [])
    lines = HOVER.read_text().splitlines()
    timeless.write_text("".join(f"{line.split(' ', 1)[1].replace(' ', '  ')}\n" for line in lines[:2000]))
    status, report, _ = judged("[node.11]\nrates = { ESCStatus = 30 }\n", timeless)
    assert (status, unmet(report)) == (4, {"ESCStatus of node 11 at 30/s": "no rate"})


def test_requirements_that_are_not_met_leave_it_unjudged(judged: Check) -> None:
    text = """\
[require]
types = ["BatteryInfo"]
rules = ["UNJUDGED"]
escs = 5
running_s = 60
"""
    status, report, _ = judged(text.replace("UNJUDGED", _unjudged(judged)), HOVER)
    assert (status, report["gate"]["judged"], report["gate"]["failed"]) == (4, False, False)
    missing = unmet(report)
    assert missing["at least 5 ESCs"] == "4"
    assert missing["type BatteryInfo"] == "0 transfers"
    assert 0 < float(missing["motors turning for 60 s"].removesuffix(" s")) < 5
    assert any(what.startswith("rule ") and "NOT EXERCISED" in found for what, found in missing.items())


def _unjudged(judged: Check) -> str:
    _, report, _ = judged("", HOVER)
    return next(str(one["rule"]) for one in report["rules"] if one["verdict"] == "NOT EXERCISED")


def test_each_of_several_captures_has_requirements_of_its_own(judged: Check) -> None:
    status, report, _ = judged("escs = 4\n", HOVER, FAULTS)
    assert status == 1  # findings go before
    assert unmet(report) == {f"4 ESCs in {FAULTS.name}": "8"}


@pytest.mark.slow
def test_an_older_report_makes_its_findings_known(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    assert main(["check", str(FAULTS), "--json", str(old)]) == 1
    capfd.readouterr()
    assert main(["check", str(FAULTS), "--baseline", str(old), "--json", "-"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert {one["baseline"] for one in report["findings"]} == {"known"}
    assert report["settings"]["baseline"] == str(old)
    assert main(["check", str(HOVER), "--json", str(old)]) == 0
    capfd.readouterr()
    assert main(["check", str(FAULTS), "--baseline", str(old), "--json", "-"]) == 1
    report = json.loads(capfd.readouterr().out)
    assert {one["baseline"] for one in report["findings"] if one["rule"] in ERRORS} == {"new"}


@pytest.mark.parametrize(
    ("option", "text", "said"),
    [
        ("--vehicle", "name = 'x'\nspeed = 3\n", ":2: speed: unknown key"),
        ("--vehicle", "[require\n", ":1: "),
        ("--baseline", "{}", "no report of the form"),
        ("--baseline", "{", "line 1"),
    ],
)
def test_mistakes_in_the_files_are_wrong_usage(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, option: str, text: str, said: str
) -> None:
    path = tmp_path / "given"
    path.write_text(text)
    for name in (path, tmp_path / "absent"):
        assert main(["check", option, str(name), str(HOVER)]) == 2
        out, err = capfd.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert str(name) in err
        assert said in err or name != path


@pytest.mark.slow
def test_a_first_vehicle_file_describes_its_capture(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    assert main(["check", "--init", str(HOVER), "--bitrate", "1000000", "-o", str(path)]) == 0
    assert capfd.readouterr() == ("", "")
    made = tomllib.loads(path.read_text())
    assert (made["bit_rate"], made["escs"]) == (1_000_000, 4)
    assert made["unit"] == {"0xA1": 11, "0xA2": 12, "0xA3": 13, "0xA4": 14}
    assert made["node"]["11"] == {"label": "ch1", "rates": {"NodeStatus": 2, "ESCStatus": 30}}
    assert made["node"]["10"]["rates"]["RawCommand"] == 400
    assert main(["check", "--init", str(HOVER), "--bitrate", "1000000"]) == 0
    assert capfd.readouterr().out == path.read_text()
    assert "# [[waiver]]" in path.read_text()
    report = check(HOVER, vehicle=path)
    assert report.gate.exit_status == 0
    assert report.gate.requirements
    assert check(FAULTS, vehicle=path).gate.requirements[-5].what == "4 ESCs"


@pytest.mark.sampled(4)
@pytest.mark.parametrize("capture", ["startup.log", "duplicate-node.log", "hover.log"])
def test_occasional_types_are_not_demanded(capture: str, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """What is asked and answered now and then has a rate, too, but none that another flight would have."""
    path = tmp_path / "vehicle.toml"
    assert main(["check", "--init", "--force", str(CAPTURES / capture), "-o", str(path)]) == 0
    text = path.read_text()
    assert "ParamGet" not in text
    assert "ParamCfg" not in text
    capfd.readouterr()


@pytest.mark.slow
def test_any_part_of_the_same_flight_passes_the_file(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    assert main(["check", "--init", str(HOVER), "-o", str(path)]) == 0
    for window in ([], ["--from", "2"], ["--to", "3"], ["--last", "1100ms"], ["--last", "1500ms"]):
        assert main(["check", str(HOVER), "--vehicle", str(path), *window]) == 0, window
        assert "expects " in capfd.readouterr().out


@pytest.mark.sampled(4)
@pytest.mark.parametrize("last", ["300ms", "700ms", "1500ms"])
def test_few_transfers_are_counted_against_those_that_are_due(judged: Check, last: str) -> None:
    """A rate of its own takes four: in a part of 700 ms one status is right for 2/s, and far too few for 20/s."""
    _, right, _ = judged("[node.11]\nrates = { NodeStatus = 2 }\n", HOVER, "--last", last)
    assert unmet(right) == {}
    _, wrong, _ = judged("[node.11]\nrates = { NodeStatus = 20 }\n", HOVER, "--last", last)
    assert list(unmet(wrong)) == ["NodeStatus of node 11 at 20/s"]


def test_a_file_is_not_written_over(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text("name = 'mine'\n")
    assert main(["check", "--init", str(HOVER), "-o", str(path)]) == 2
    out, err = capfd.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert f"{path}: exists" in err
    assert "--force" in err
    assert path.read_text() == "name = 'mine'\n"
    assert main(["check", "--init", "--force", str(HOVER), "-o", str(path)]) == 0
    assert tomllib.loads(path.read_text())["escs"] == 4


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("capture", "rules"), [("mission-8-faults.log", ERRORS), ("esc-failure.mcap", {"TYP-306"})])
def test_a_faulty_capture_is_no_model(
    capture: str, rules: set[str], capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "vehicle.toml"
    assert main(["check", "--init", str(CAPTURES / capture), "-o", str(path)]) == 1
    out, err = capfd.readouterr()
    assert (out, path.exists()) == ("", False)
    assert "no healthy capture, findings of " in err
    assert all(rule in err for rule in rules)
    assert main(["check", "--init", "--force", str(CAPTURES / capture), "-o", str(path)]) == 0
    assert "no healthy capture" in capfd.readouterr().err
    assert "# WARNING: " in path.read_text()
    tomllib.loads(path.read_text())


@pytest.mark.parametrize(
    "args",
    [[HOVER, FAULTS], [HOVER, "--html", "x.html"], [HOVER, "--vehicle", "x.toml"], [HOVER, "-o", "a", "-o", "b"]],
)
def test_init_does_not_go_with_everything(capfd: pytest.CaptureFixture[str], args: list[object]) -> None:
    assert main(["check", "--init", *map(str, args)]) == 2
    out, err = capfd.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "--init" in err


def test_no_vehicle_file_without_a_node(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    capture, path = tmp_path / "foreign.log", tmp_path / "vehicle.toml"
    capture.write_text("(1.000000) can0 123#1122\n")
    assert main(["check", "--init", str(capture), "-o", str(path)]) == 4
    assert "no node speaks DroneCAN" in capfd.readouterr().err
    assert main(["check", "--init", str(tmp_path / "absent.log"), "-o", str(path)]) == 3
    assert capfd.readouterr().err.count("\n") == 1
    assert not path.exists()


def test_names_of_a_capture_cannot_break_out_of_the_file(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    capture = tmp_path / 'a"\n[x]\x1b.log'
    capture.write_bytes(HOVER.read_bytes())
    assert main(["check", "--init", str(capture)]) == 0
    out = capfd.readouterr().out
    assert "x" not in tomllib.loads(out)
    assert "\x1b" not in out


OPTIONS = ("--vehicle", "--profile")


@pytest.mark.slow
def test_the_old_name_of_the_option_works_and_says_so(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text("escs = 6\n")
    outputs = [(main(["check", option, str(path), str(HOVER)]), *capfd.readouterr()) for option in OPTIONS]
    (status, out, err), (old_status, old_out, old_err) = outputs
    assert (old_status, old_out) == (status, out)
    assert old_err == f"tailbyte check: --profile is deprecated: the option is called --vehicle now\n{err}"
