"""The command check as a shell runs it: reports, exit statuses, output that fails, Ctrl-C."""

from __future__ import annotations

import json as plain_json
import os
import signal
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest
from kit.command import CAPTURES, run, start, wait_until

import analyzer
from analyzer.cli import main
from analyzer.report import json as json_report
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

HOVER, FAULTS = CAPTURES / "hover-4.log", CAPTURES / "mission-8-faults.log"
FOREIGN = "(1.000000) can0 123#1122\n"


def validated(text: str) -> Any:
    content = plain_json.loads(text)
    jsonschema.Draft202012Validator(json_report.schema()).validate(content)
    return content


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> Command:
    """As everywhere, but with what is written to the descriptor of standard output itself."""

    def call(*args: object) -> tuple[int, str, str]:
        status = main([str(arg) for arg in args])
        return status, *capfd.readouterr()

    return call


@pytest.fixture(scope="module")
def faulty() -> Any:
    done = run("check", FAULTS, "--json", "-", "--bitrate", 1_000_000)
    assert done.returncode == 1
    return validated(done.stdout.decode())


def test_a_healthy_capture(command: Command) -> None:
    status, out, err = command("check", HOVER)
    assert (status, err) == (0, "")
    assert out.startswith("PASS WITH WARNINGS  1 warning, ")
    assert out.splitlines()[0].endswith("exit 0")
    assert out.splitlines()[1].startswith("      can0: The recording ends with motors turning (")


def test_faults_are_named_with_a_command_that_shows_them(command: Command) -> None:
    status, out, _ = command("check", FAULTS)
    assert status == 1
    assert out.startswith("FAIL  ")
    assert "TRF-010" in out
    assert f"tailbyte decode {FAULTS} --around" in out


@pytest.mark.parametrize("everything", [[], ["--all"]])
def test_eighty_columns(command: Command, everything: list[str]) -> None:
    _, out, _ = command("check", FAULTS, *everything)
    free = ("tailbyte decode", "(17")  # a command, and a frame, stay whole
    long = [line for line in out.splitlines() if display_width(line) > 80 and not line.strip().startswith(free)]
    assert [line for line in long if "/" not in line] == []


@pytest.mark.slow
def test_json_is_as_documented_and_complete(faulty: Any) -> None:
    (capture,) = faulty["captures"]
    assert capture["frames"] == sum(capture["verdicts"].values()) > 0
    terms = [count for name, count in capture["accounting"].items() if name != "lines"]
    assert capture["accounting"]["lines"] == sum(terms)
    (bus,) = capture["buses"]
    assert sum(bus["rates"]) == capture["frames"]
    assert len(bus["load"]) == len(bus["rates"])
    assert 0.05 < max(bus["load"]) < 1
    assert sum(sum(node["types"].values()) for node in capture["nodes"]) == capture["transfers"]
    assert all(sum(node["rates"]) == sum(node["types"].values()) for node in capture["nodes"])
    assert {node["label"] for node in capture["nodes"]} >= {"ch1", "ch8"}
    assert faulty["settings"]["bit_rate"] == 1_000_000
    assert faulty["coverage"]["types"]["RawCommand"] > 0
    assert faulty["coverage"]["packets"]["MotorStatus"] > 0


@pytest.mark.slow
def test_findings_are_the_worst_first_and_their_frames_can_be_found(faulty: Any) -> None:
    ranks = [("error", "warning", "note").index(one["severity"]) for one in faulty["findings"]]
    assert ranks == sorted(ranks)
    (capture,) = faulty["captures"]
    lines = FAULTS.read_text().splitlines()
    for one in faulty["findings"]:
        assert one["capture"] == capture["id"]
        assert one["fails"] is ((one["category"], one["severity"]) == ("protocol", "error"))
        assert all(1 <= frame <= capture["frames"] for frame in one["frames"])
        for example in one["examples"]:
            if example["frame"] is not None and example["lines"]:
                data = lines[example["frame"] - 1].split()[-1]
                assert any(line.endswith(data) for line in example["lines"]), one["rule"]


def test_verdicts_go_with_findings(faulty: Any) -> None:
    found = {one["rule"] for one in faulty["findings"]}
    for rule in faulty["rules"]:
        assert (rule["findings"] > 0) is (rule["rule"] in found)
        if rule["verdict"] in ("NOT EXERCISED", "INCONCLUSIVE"):
            assert rule["reason"], rule["rule"]
    assert {rule["verdict"] for rule in faulty["rules"]} >= {"PASS", "FAIL", "WARN", "NOT EXERCISED", "INCONCLUSIVE"}


@pytest.mark.slow
def test_every_report_at_once_and_twice_the_same(tmp_path: Path) -> None:
    names = ("a.json", "b.html", "c.xml", "d.md", "e.txt")
    outputs = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        done = run("check", FAULTS, *(word for name in names for word in ("-o", folder / name)))
        assert (done.returncode, done.stderr) == (1, b"")
        outputs.append([(folder / name).read_bytes() for name in names] + [done.stdout])
    assert outputs[0] == outputs[1]
    json, html, xml, markdown, text, _ = outputs[0]
    validated(json.decode())
    assert html.lower().startswith(b"<!doctype html>")
    assert ET.fromstring(xml).get("failures") != "0"
    assert b"TRF-010" in markdown
    assert text.startswith(b"FAIL")


def test_a_report_on_standard_output_leaves_the_text_out(command: Command) -> None:
    _, out, _ = command("check", HOVER, "--json", "-")
    validated(out)
    _, out, _ = command("check", HOVER, "--junit", "-")
    assert out.startswith("<?xml")


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("fail_on", "status"),
    [("protocol:error", 1), ("device:error", 0), ("device:warning", 1), ("never", 0), ("any:note", 1)],
)
def test_what_fails_is_a_choice(command: Command, fail_on: str, status: int) -> None:
    assert command("check", FAULTS, "--fail-on", fail_on)[0] == status


@pytest.mark.slow
def test_rules_are_a_choice(command: Command) -> None:
    def rules(*args: str) -> set[str]:
        _, out, _ = command("check", FAULTS, "--json", "-", *args)
        return {one["rule"] for one in plain_json.loads(out)["findings"]}

    assert rules("--select", "TRF-010") == {"TRF-010"}
    assert rules("--select", "trf,PUSH-005", "--ignore", "TRF-003,TRF-006") >= {"TRF-010", "PUSH-005"}
    assert "TRF-003" not in rules("--ignore", "TRF-003")
    assert {rule.partition("-")[0] for rule in rules("--select", "TRF")} == {"TRF"}
    stated = rules("--origin", "document")
    pages = {one.rule: one.origin for one in analyzer.check(FAULTS).rules}
    assert stated == {rule for rule in rules() if pages[rule] == "document"}


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["--select", "XYZ"], "no rule is called 'XYZ'"),
        (["--select", "TRF-999"], "near: TRF-0"),
        (["--select", "TRF", "--ignore", "TRF"], "no rule is left"),
        (["--origin", "hearsay"], "document, implied, dronecan, heuristic"),
        (["--fail-on", "error"], "CATEGORY:SEVERITY"),
        (["-o", "report.pdf"], ".html"),
        (["-o", "-"], "says no format"),
        (["--json", "-", "--html", "-"], "two reports"),
        (["--json", "a", "--html", "./a"], "two reports"),
        (["--json", ""], "no name"),
        (["--json", HOVER], "is the capture"),
        (["--dissector", "/nowhere"], "/nowhere"),
        (["--dialect", "x"], "NODE=CHOICE"),
        (["--dialect", "11=foo"], "'foo' (one of: tm, dronecan, degC, K, little-endian, big-endian)"),
    ],
)
def test_arguments_that_make_no_sense(command: Command, args: list[object], reason: str) -> None:
    status, out, err = command("check", HOVER, *args)
    assert (status, out) == (2, "")
    assert reason in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_captures_are_judged_one_by_one(command: Command) -> None:
    _, out, _ = command("check", HOVER, FAULTS, "--json", "-")
    content = validated(out)
    assert [one["id"] for one in content["captures"]] == [HOVER.name, FAULTS.name]
    alone = plain_json.loads(command("check", FAULTS, "--json", "-")[1])
    assert [one for one in content["findings"] if one["capture"] == FAULTS.name] == alone["findings"]


def test_one_name_twice_still_gives_two_captures(command: Command) -> None:
    content = validated(command("check", HOVER, HOVER, "--json", "-")[1])
    assert len({one["id"] for one in content["captures"]}) == 2


def test_recordings_of_one_bus_are_merged_on_demand(command: Command) -> None:
    content = validated(command("check", HOVER, HOVER, "--same-bus", "--json", "-")[1])
    (capture,) = content["captures"]
    assert capture["accounting"]["repeated"] == capture["frames"]
    assert capture["arguments"] == [str(HOVER), "--same-bus"]


@pytest.mark.sampled(3)
@pytest.mark.parametrize("content", ["", "\n\n", FOREIGN])
def test_nothing_to_judge(command: Command, tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.log"
    path.write_text(content)
    status, out, _ = command("check", path)
    assert status == 4
    assert out.startswith("NOT JUDGED")
    assert command("check", path, FAULTS)[0] == 1
    assert command("check", path, HOVER)[0] == 4


@pytest.mark.slow
def test_damage_is_stated_and_what_was_readable_is_judged(command: Command, tmp_path: Path) -> None:
    whole = (CAPTURES / "esc-failure.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: len(whole) * 9 // 10])
    status, out, err = command("check", path, "--json", "-", "--fail-on", "protocol:error")
    capture = validated(out)["captures"][0]
    assert capture["damage"]
    assert str(path) in err
    assert status == (3 if capture["transfers"] else 4)
    path = tmp_path / "dirty.log"
    path.write_text(HOVER.read_text() + "(1773475400.0) can0 nonsense\n")
    status, out, err = command("check", path)
    assert status == 3
    assert "DAMAGED: 1 of" in out
    assert command("check", path, FAULTS)[0] == 1


@pytest.mark.parametrize("name", ["missing.log", "."])
def test_a_capture_that_cannot_be_opened_is_in_the_report(command: Command, tmp_path: Path, name: str) -> None:
    status, out, err = command("check", tmp_path / name, "--json", "-")
    content = validated(out)
    assert (status, content["gate"]["exit_status"]) == (3, 3)
    assert content["captures"][0]["damage"]
    assert err.startswith("tailbyte: ")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text(FOREIGN)
    path.chmod(0)
    assert command("check", path)[0] == 3


@pytest.mark.slow
def test_a_pipe(tmp_path: Path) -> None:
    with HOVER.open("rb") as file:
        done = run("check", "-", "--json", tmp_path / "a.json", stdin=file)
    assert done.returncode == 0
    assert validated((tmp_path / "a.json").read_text())["captures"][0]["path"] == "-"


@pytest.mark.slow
def test_output_that_cannot_be_written(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        assert run("check", HOVER, stdout=full).returncode == 3
    done = run("check", HOVER, "--json", "/dev/full")
    assert (done.returncode, done.stderr) == (3, b"tailbyte: /dev/full: No space left on device\n")
    assert done.stdout.startswith(b"PASS")
    assert run("check", FAULTS, "--json", "/dev/full").returncode == 1
    done = run("check", HOVER, "--json", tmp_path / "no" / "a.json")
    assert (done.returncode, done.stdout) == (3, b"")


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_does_not_change_the_verdict() -> None:
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as closed:
        assert run("check", FAULTS, stdout=closed).returncode == 1
        assert run("check", FAULTS, "--json", "-", stdout=closed).returncode == 1


@pytest.mark.slow
def test_ctrl_c_writes_nothing(tmp_path: Path) -> None:
    capture, report = tmp_path / "long.fifo", tmp_path / "a.json"
    os.mkfifo(capture)
    process = start("check", capture, "--json", report, stdout=-1, stderr=-1)
    with capture.open("wb") as pipe:  # opens once the process reads
        pipe.write(HOVER.read_bytes())
        pipe.flush()
        wait_until(lambda: bool(list(tmp_path.glob("a.json.*.part"))))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 130
    assert list(tmp_path.glob("*.part")) == []


@pytest.mark.slow
def test_github(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    summary = tmp_path / "summary.md"
    summary.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    status, out, _ = command("check", FAULTS, "--github")
    assert status == 1
    assert out.startswith("FAIL")
    assert "\n::error title=" in out
    assert summary.read_text().startswith("before\n")
    assert "TRF-010" in summary.read_text()
    status, out, err = command("check", FAULTS, "--github", "--json", "-")
    validated(out)
    assert "::error title=" in err
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path))
    assert command("check", HOVER, "--github")[0] == 3


def test_python_gives_the_same_report(faulty: Any) -> None:
    report = analyzer.check(FAULTS, bit_rate=1_000_000)
    assert plain_json.loads(json_report.render(report)) == faulty
    with pytest.raises(LookupError, match="TRF"):
        analyzer.check(FAULTS, select=["TRF-999"])
    with pytest.raises(ValueError, match="one of: tm, dronecan"):
        analyzer.check(FAULTS, dialects={11: ["tm", "foo"]})
    with pytest.raises(ValueError, match="no capture"):
        analyzer.check([])
