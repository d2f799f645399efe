"""The command diff: what it prints and writes, exit statuses, and captures that are not as they should be."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest
from kit.simulated import flown

from analyzer.report.comparison.json import schema

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]
    Differ = Callable[..., tuple[int, dict[str, Any]]]

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
HOVER, FAILURE, SAG = (CAPTURES / name for name in ("hover-4.log", "esc-failure.mcap", "pack-sag.log"))
EVERY = sorted(path for path in CAPTURES.iterdir() if path.suffix in (".log", ".mcap", ".txt"))


@pytest.fixture
def differ(command: Command, tmp_path: Path) -> Callable[..., tuple[int, dict[str, Any]]]:
    """Runs the command; exit status and JSON."""

    def run(*arguments: object) -> tuple[int, dict[str, Any]]:
        path = tmp_path / "differences.json"
        status, _, err = command("diff", *arguments, "--json", path)
        assert "Traceback" not in err
        content = json.loads(path.read_text())
        jsonschema.Draft202012Validator(schema()).validate(content)
        return status, content

    return run


def test_one_screen(command: Command) -> None:
    status, out, err = command("diff", HOVER, SAG)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith("DIFFERENT  3 errors, ")
    assert len(lines) <= 23
    assert max(len(line) for line in lines if "tailbyte" not in line) <= 80
    errors = [line for line in lines if line.startswith("error")]
    assert errors[0].split() == ["error", "ch4", "node", "14", "node", "on", "the", "bus", *errors[0].split()[8:]]
    assert errors[0].endswith("not there  start")
    (shown,) = (line.strip() for line in lines if "tailbyte triage" in line)
    status, out, err = command(*shown.split()[1:])
    assert (status, "the supply of all ESCs broke down" in out) == (0, True)


def test_everything(command: Command) -> None:
    _, short, _ = command("diff", HOVER, SAG)
    _, out, _ = command("diff", HOVER, SAG, "--all")
    assert len(out.splitlines()) > len(short.splitlines())
    assert "Limits   " in out
    assert "(--all)" not in out


@pytest.mark.sampled(4)
@pytest.mark.parametrize("more", [(), ("--fail-on", "any")])
def test_a_capture_and_itself(command: Command, more: tuple[str, ...]) -> None:
    status, out, err = command("diff", HOVER, HOVER, *more)
    assert (status, err) == (0, "")
    assert out.startswith("NO DIFFERENCE FOUND  ")
    assert "\nCompared 6 nodes, 5 software versions, " in out
    assert "\nCannot   error frames: not recorded in either capture\n" in out


@pytest.mark.sampled(4)
@pytest.mark.parametrize("suffix", ["mcap", "pcapng", "log.gz"])
def test_another_format_is_the_same_capture(command: Command, tmp_path: Path, suffix: str) -> None:
    other = tmp_path / f"other.{suffix}"
    assert command("convert", HOVER, other)[0] == 0
    status, out, _ = command("diff", HOVER, other, "--fail-on", "any")
    assert (status, out.splitlines()[0].split("  ")[0]) == (0, "NO DIFFERENCE FOUND")


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("names", "status"),
    [("any", 1), ("error", 1), ("node", 1), ("telemetry,firmware", 0), ("never", 0), ("finding", 1)],
)
def test_what_fails(command: Command, names: str, status: int) -> None:
    assert command("diff", HOVER, SAG, "--fail-on", names)[0] == status


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([HOVER], "two captures are compared, not 1"),
        ([HOVER, HOVER, SAG], "two captures are compared, not 3"),
        ([HOVER, SAG, "--fail-on", "everything"], "--fail-on 'everything' is none of: any, error"),
        ([HOVER, SAG, "--fail-on", ""], "--fail-on '' names nothing: any, error"),
        ([HOVER, SAG, "--fail-on", "any", "--fail-on", " ,, "], "--fail-on ' ,, ' names nothing"),
        ([HOVER, SAG, "-o", "x.xml"], "-o x.xml: the name says no format: .html .htm .json .txt"),
        ([HOVER, SAG, "--select", "TRF-999"], "TRF-999"),
        ([HOVER, SAG, "--json", HOVER], "hover-4.log"),
        ([HOVER, SAG, "--bad-from", "yesterday"], "yesterday"),
        ([HOVER, SAG, "--good-to", "noon"], "--good-to: 'noon' is not a time"),
        ([HOVER, SAG, "--bad-from", "9999"], f"{SAG}: nothing is inside the window: --bad-from 9999"),
        ([HOVER, HOVER, "--from", "1", "--good-from", "99"], "nothing is inside the window: --good-from 99"),
        ([HOVER, SAG, "--from", "3", "--bad-to", "2.5s"], "--from 3 is after --bad-to 2.5s"),
        (["-", "-"], "standard input can be read only once"),
    ],
)
def test_wrong_usage(command: Command, arguments: list[object], reason: str) -> None:
    status, out, err = command("diff", *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert reason in err


def test_reports(command: Command, tmp_path: Path) -> None:
    names = [tmp_path / name for name in ("x.json", "x.html", "x.txt")]
    status, out, _ = command("diff", HOVER, SAG, "--json", names[0], "--html", names[1], "-o", names[2])
    assert status == 0
    content = json.loads(names[0].read_text())
    jsonschema.Draft202012Validator(schema()).validate(content)
    assert content["differences"][0]["what"] == "node on the bus"
    assert names[1].read_text().startswith("<!DOCTYPE html>")
    assert names[2].read_text().splitlines()[0] == out.splitlines()[0]


@pytest.mark.slow
def test_windows(command: Command, differ: Differ) -> None:
    status, content = differ(HOVER, HOVER, "--good-to", "2.5", "--bad-from", "2.5")
    assert status == 0
    assert content["good"]["end_ns"] <= content["bad"]["start_ns"]
    assert content["remarks"][:2] == ["good: only --good-to 2.5", "bad: only --bad-from 2.5"]
    assert {one["kind"] for one in content["differences"]} <= {"parameter", "finding"}
    _, content = differ(HOVER, HOVER, "--from", "1", "--good-to", "2")
    assert content["good"]["start_ns"] == content["bad"]["start_ns"]
    assert command("diff", HOVER, HOVER, "--from", "99")[0] == 2


def test_a_filter(command: Command, differ: Differ) -> None:
    _, content = differ(HOVER, SAG, "-Y", "src == 11")
    assert {one["node"] for one in content["matched"]} == {11}
    assert {one["node"] for one in content["differences"]} <= {11, None}
    assert content["remarks"][0] == "only what matches src == 11"
    status, out, err = command("diff", HOVER, SAG, "-Y", "ESCStatus.nothing > 3")
    assert (status, out) == (2, "")
    assert "^" in err


@pytest.mark.slow
def test_a_filter_cuts_nothing_apart(differ: Differ, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames between which others are left out are one batch, and have the numbers that they have in the capture."""
    faults, own = CAPTURES / "faults.log", tmp_path / "own.toml"
    own.write_text("""[rule.ACME-001]\ntitle = "Late"\nwhen = 'dronecan.status != "ok" && frame.number > 500'\n""")
    arguments = HOVER, faults, "-Y", "ESCStatus || RawCommand", "--vehicle", own
    picked = differ(*arguments)[1]
    told = [(one["rule"], one["frame"], one["remark"]) for one in picked["differences"]]
    assert ("TRF-003", 453, "one frame lost (the 2nd of 3), before frame 454") in told
    assert "of frame 513)" in next(remark for rule, frame, remark in told if (rule, frame) == ("TRF-010", 512))
    assert ("ACME-001", 512, "dronecan.status bad crc") in told
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 37)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 1000)
    assert differ(*arguments)[1] == picked


def test_a_choice_of_rules(differ: Differ) -> None:
    _, content = differ(HOVER, SAG, "--select", "TYP-305")
    assert {one["rule"] for one in content["differences"]} == {"", "TYP-305"}


@pytest.mark.slow
def test_pipes(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    code = "import sys; from analyzer.cli import main; sys.exit(main(sys.argv[1:]))"
    words = [sys.executable, "-c", code, "diff", str(HOVER), "-", "--json", "-"]
    with SAG.open("rb") as stream, path.open("wb") as out:
        done = subprocess.run(words, stdin=stream, stdout=out, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    content = json.loads(path.read_text())
    assert content["bad"]["path"] == "-"
    assert content["differences"][0]["what"] == "node on the bus"


# ---- captures that are not as they should be -------------------------------------------------------------------------

DAMAGES = {
    "missing": (None, 3, "NOT COMPARED"),
    "empty": (b"", 4, "NOT COMPARED"),
    "foreign": (b"".join(b"(%d.5) can0 1FF#0102\n" % n for n in range(99)), 4, "NOT COMPARED"),
    "noise": (bytes(range(256)) * 40, 3, "NOT COMPARED"),
}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", DAMAGES)
@pytest.mark.parametrize("first", [True, False])
def test_nothing_to_compare(command: Command, tmp_path: Path, name: str, *, first: bool) -> None:
    content, expected, verdict = DAMAGES[name]
    path = tmp_path / "other.log"
    if content is not None:
        path.write_bytes(content)
    status, out, err = command("diff", *((path, HOVER) if first else (HOVER, path)), "--fail-on", "any")
    assert "Traceback" not in err
    assert out.startswith(verdict)
    assert status in (expected, 3)
    assert "Cannot   " in out


def test_damage_is_said_first(command: Command, tmp_path: Path) -> None:
    whole = HOVER.read_bytes()
    path = tmp_path / "cut.log"
    path.write_bytes(whole[:90_000] + b"\nrubbish\n" + whole[90_000 + 60 : 150_000])
    status, out, err = command("diff", HOVER, path)
    assert status == 3
    assert "DAMAGED: " in out
    assert "what the second capture lacks: it is damaged" in " ".join(out.split())
    assert "unreadable" in err or "rubbish" in err


def test_without_times(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "bare.log"
    lines = HOVER.read_text().splitlines()
    path.write_text("".join(f"can0 {line.split()[2]}\n" for line in lines))
    status, out, _ = command("diff", HOVER, path)
    assert status in (0, 3)
    assert "no times" in " ".join(out.split()) or out.startswith("NOT COMPARED")


@pytest.mark.slow
def test_a_recorder_that_lost_frames_leaves_nothing_sure(differ: Differ, tmp_path: Path) -> None:
    lines = flown(12, flight="hover").text.splitlines(keepends=True)
    good, bad = tmp_path / "good.log", tmp_path / "bad.log"
    good.write_text("".join(lines))
    bad.write_text("".join(line for k, line in enumerate(lines) if not 3000 < k < 3400 and not 6000 < k < 6500))
    _, content = differ(good, bad)
    assert any("not complete" in text for text in content["cannot"])
    rates = [one for one in content["differences"] if one["kind"] == "rate"]
    assert {one["support"] for one in rates} <= {"possible"}


def test_interrupted(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def end(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("analyzer.report.comparison.traits.Traits.feed", end)
    status, out, err = command("diff", HOVER, SAG)
    assert (status, out, "Traceback" in err) == (130, "", False)


@pytest.mark.slow
@pytest.mark.parametrize("good", EVERY, ids=lambda path: path.name)
def test_all_captures_with_each_other(differ: Differ, good: Path) -> None:
    for bad in EVERY:
        status, content = differ(good, bad)
        assert status in (0, 3, 4)
        if good == bad:
            assert content["differences"] == []


@pytest.mark.sampled(4)
@pytest.mark.parametrize("bad", EVERY[::4], ids=lambda path: path.name)
def test_some_captures(command: Command, bad: Path) -> None:
    for good in (bad, HOVER):
        status, out, _ = command("diff", good, bad)
        assert status in (0, 3, 4)
        assert out
        if good == bad:
            assert out.startswith(("NO DIFFERENCE FOUND", "NOT COMPARED"))
