"""Findings beside telemetry: `/findings` in MCAP says what `analyzer.check` finds in the same capture."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from kit import encode
from kit.command import CAPTURES, HOVER, START, log, run, start, wait_until
from kit.exported import read_mcap
from mcap.reader import make_reader

import analyzer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.report.model import Finding

    Main = Callable[..., tuple[int, str, str]]
    Logged = Sequence[tuple[int, Any]]

FAULTS, FAILURE = CAPTURES / "faults.log", CAPTURES / "esc-failure.mcap"
JUDGED = [FAULTS, FAILURE, CAPTURES / "dialects.txt", CAPTURES / "mission-8-faults.log", CAPTURES / "fd.log"]
CLEAN = [HOVER, CAPTURES / "hover-4.log", CAPTURES / "startup.log"]
LEVELS = {"error": 4, "warning": 3, "note": 2}


def findings(command: Main, path: Path, capture: Path, *more: object) -> Logged:
    command("export", capture, "-o", path, *more)
    return read_mcap(path).get("/findings", [])


def begun(capture: Path) -> int:
    return min(t for t in analyzer.open_capture(capture).table("frames").column("t").cast("int64").to_pylist() if t)


def numbers(message: str) -> list[int]:
    """Frame numbers and the count at the end of a message."""
    (where,) = re.findall(r"\(([^()]*)\)$", message)
    return [int(number) for number in re.findall(r"(?<![\w.])\d+(?![\w.]*[A-Za-z])", where)]


def says(finding: Finding, message: str) -> bool:
    """Rule, both texts, type, count, first and last frame."""
    frames = {place.frame for place in (finding.first, finding.last)} - {None}
    counts = {finding.count} if finding.count > 1 else set()
    parts = (finding.title, finding.text, finding.type)
    return (
        message.startswith(f"{finding.rule} ")
        and all(part in message for part in parts)
        and (not frames | counts or frames | counts <= set(numbers(message)))
    )


@pytest.mark.sampled(8)
@pytest.mark.parametrize("capture", JUDGED + CLEAN, ids=lambda path: path.stem)
def test_they_are_those_of_check(command: Main, tmp_path: Path, capture: Path) -> None:
    logged = findings(command, tmp_path / "out.mcap", capture)
    report = analyzer.check(capture)
    assert len(logged) == len(report.findings) > 0
    beginning, left = begun(capture), list(logged)
    for finding in report.findings:
        t = finding.first.t_ns
        matching = [
            one for one in left
            if one[0] == (beginning if t is None else t)
            and one[1].level == LEVELS[finding.severity]
            and one[1].HasField("timestamp") == (t is not None)
            and says(finding, one[1].message)
        ]  # fmt: skip
        assert matching, finding
        left.remove(matching[0])
        said = matching[0][1]
        assert t is None or said.timestamp.ToNanoseconds() == t
        assert said.file == str(capture)
        assert finding.node is None or f"node {finding.node}" in said.name
        assert finding.label in said.name
        assert said.name
    assert left == []


def test_what_a_message_looks_like(command: Main, tmp_path: Path) -> None:
    logged = findings(command, tmp_path / "out.mcap", FAULTS)
    (lost,) = [said for _, said in logged if said.message.startswith("TRF-003") and said.name == "ch1 node 11"]
    assert lost.message == (
        "TRF-003 A frame was lost or came in the wrong order: one frame lost (the 2nd of 3), before frame 454 "
        "(ESCStatus, frame 453)"
    )
    assert lost.level == 4
    assert lost.timestamp.ToNanoseconds() == START + 334_774_000
    foreign = [said for _, said in logged if said.message.startswith("CAN-001")]
    assert foreign[0].message.endswith(", 8 bytes (20 times, frames 26 165 347 ... 1901)")
    assert foreign[0].name == "can0"
    (unreadable,) = [said for _, said in logged if said.message.startswith("CAP-003")]
    assert unreadable.name == "capture"
    several = findings(command, tmp_path / "out.mcap", CAPTURES / "dialects.txt")
    assert "node 10 can0" in {said.name for _, said in several}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("capture", CLEAN, ids=lambda path: path.stem)
def test_a_clean_capture_has_notes_but_for_its_end(command: Main, tmp_path: Path, capture: Path) -> None:
    logged = findings(command, tmp_path / "out.mcap", capture)
    assert {said.level for _, said in logged if not said.message.startswith("CAP-005")} == {2}


@pytest.mark.slow
def test_readers_get_all_topics_by_time(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Although findings stand at the end of the file, in many chunks."""
    monkeypatch.setattr("analyzer.sinks.telemetry.CHUNK", 500)
    command("export", FAULTS, "-o", tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as file:
        seen = [(message.log_time, channel.topic) for _, channel, message in make_reader(file).iter_messages()]
    assert [t for t, _ in seen] == sorted(t for t, _ in seen)
    places = [k for k, (_, topic) in enumerate(seen) if topic == "/findings"]
    assert len(places) == 29
    assert places[0] < 100
    assert 1000 < places[-1] < len(seen) - 1


@pytest.mark.slow
def test_our_reader_passes_over_them(command: Main, tmp_path: Path) -> None:
    command("export", FAILURE, "-o", tmp_path / "out.mcap")

    def found(capture: Path) -> list[tuple[object, ...]]:
        return [(one.rule, one.node, one.count, one.first, one.text) for one in analyzer.check(capture).findings]

    assert found(tmp_path / "out.mcap") == found(FAILURE)


def test_the_schema_is_that_of_foxglove(command: Main, tmp_path: Path) -> None:
    command("export", FAULTS, "-o", tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (channel,) = [one for one in summary.channels.values() if one.topic == "/findings"]
    of = summary.schemas[channel.schema_id]
    assert (channel.message_encoding, of.encoding, of.name) == ("protobuf", "protobuf", "foxglove.Log")
    assert [one.name for one in summary.schemas.values()].count("foxglove.Log") == 1
    (file_,) = [one for one in FileDescriptorSet.FromString(of.data).file if one.package == "foxglove"]
    (message,) = file_.message_type
    kinds = {field.name: (field.number, field.Type.Name(field.type), field.type_name) for field in message.field}
    assert kinds == {
        "timestamp": (1, "TYPE_MESSAGE", ".google.protobuf.Timestamp"),
        "level": (2, "TYPE_ENUM", ".foxglove.Log.Level"),
        "message": (3, "TYPE_STRING", ""),
        "name": (4, "TYPE_STRING", ""),
        "file": (5, "TYPE_STRING", ""),
        "line": (6, "TYPE_FIXED32", ""),
    }
    (levels,) = message.enum_type
    names = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
    assert [(value.name, value.number) for value in levels.value] == [(name, k) for k, name in enumerate(names)]


@pytest.mark.slow
def test_without_times_they_stand_at_zero(command: Main, tmp_path: Path) -> None:
    untimed = tmp_path / "untimed.log"
    untimed.write_text(re.sub(r"(?m)^\([\d.]+\) (\w+) (\w+)#(\w*)$", _without_time, FAULTS.read_text()))
    logged = findings(command, tmp_path / "out.mcap", untimed)
    report = analyzer.check(untimed)
    assert {one.first.t_ns for one in report.findings} == {None}
    assert len(logged) == len(report.findings) > 10
    assert {t for t, _ in logged} == {0}
    assert not any(said.HasField("timestamp") for _, said in logged)
    assert any(says(report.findings[0], said.message) for _, said in logged)


def _without_time(line: re.Match[str]) -> str:
    data = line[3]
    return f"  {line[1]}  {line[2]}   [{len(data) // 2}]  " + " ".join(re.findall("..", data))


def test_a_window_has_what_goes_on_in_it(command: Main, tmp_path: Path) -> None:
    """Frames 6000 to 6500 of a failure that began with frame 4503; the whole capture is judged all the same."""
    logged = findings(command, tmp_path / "out.mcap", FAILURE, "--frames", "6000-6500")
    whole = {one.rule: one for one in analyzer.check(FAILURE).findings}
    inside = [
        one
        for one in whole.values()
        if one.first.frame is not None and one.first.frame <= 6500 and one.last.frame >= 6000
    ]
    assert [one.rule for one in inside] == ["TYP-306", "TYP-305", "PUSH-410", "PUSH-401", "BUS-022", "TYP-208"]
    assert {said.message[:8].rstrip() for _, said in logged} == {one.rule for one in inside}
    first = analyzer.open_capture(FAILURE).table("frames").column("t").cast("int64")[5999].as_py()
    for t, said in logged:
        finding = whole[said.message.split()[0]]
        assert t == first > said.timestamp.ToNanoseconds() == finding.first.t_ns
        assert says(finding, said.message)


@pytest.mark.slow
def test_a_window_has_findings_without_a_frame_by_their_time(command: Main, tmp_path: Path) -> None:
    def rules(*window: object) -> list[str]:
        logged = findings(command, tmp_path / "out.mcap", FAULTS, *window)
        return sorted(said.message.split()[0] for _, said in logged if said.message.startswith(("CAN-004", "CAP-00")))

    assert rules("--from", "1.35", "--to", "1.45") == ["CAN-004", "CAN-004"]
    assert rules("--from", "1.45", "--to", "1.55") == ["CAP-004"]
    assert rules("--last", "300ms") == []


@pytest.mark.slow
def test_a_capture_read_twice_is_judged_once(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last seconds of it are more than what can wait for its end."""
    once = findings(command, tmp_path / "out.mcap", FAULTS, "--last", "3s")
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    monkeypatch.setattr("analyzer.window.selection.MOST_WAITING", 100)
    twice = findings(command, tmp_path / "out.mcap", FAULTS, "--last", "3s")
    assert len(once) > 10
    assert list(map(str, twice)) == list(map(str, once))


def test_where_nothing_is_found_there_is_no_topic(command: Main, tmp_path: Path) -> None:
    rests = [encode.transfer("RawCommand", {"cmd": [0, 0]}, 1, k) for k in range(20)]
    frames = [frame for k, one in enumerate(rests) for frame in one.frames(START + k * 20_000_000, bus="can0")]
    (tmp_path / "fine.log").write_bytes(log(frames))
    assert analyzer.check(tmp_path / "fine.log").findings == ()
    assert findings(command, tmp_path / "out.mcap", tmp_path / "fine.log") == []
    assert set(read_mcap(tmp_path / "out.mcap")) == {"/can0/can", "/can0/node_1/RawCommand"}


@pytest.mark.slow
def test_chosen_tables(command: Main, tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    command("export", HOVER, "-o", path, "--table", "findings")
    assert set(read_mcap(path)) == {"/findings"}
    command("export", HOVER, "-o", path, "--table", "findings", "--table", "NodeStatus")
    assert {topic.rpartition("/")[2] for topic in read_mcap(path)} == {"findings", "uavcan.protocol.NodeStatus"}
    _, _, err = command("export", HOVER, "-o", path, "--table", "NodeStatus")
    assert "/findings" not in read_mcap(path)
    assert "findings" not in err


@pytest.mark.slow
def test_the_worst_are_told_when_there_are_many(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.report.log_messages.MOST", 8)
    _, _, err = command("export", FAULTS, "-o", tmp_path / "out.mcap")
    assert " 8 findings " in err
    logged = read_mcap(tmp_path / "out.mcap")["/findings"]
    (rest,) = [(t, said) for t, said in logged if said.name == "tailbyte"]
    assert (rest[0], rest[1].level) == (begun(FAULTS), 3)
    assert rest[1].message == "21 more findings are not shown here: see tailbyte check"
    told = sorted(said.message.split()[0] for _, said in logged if said.name != "tailbyte")
    assert told == sorted(one.rule for one in analyzer.check(FAULTS).findings[:8])


@pytest.mark.slow
def test_a_name_that_is_no_text(tmp_path: Path) -> None:
    capture = os.fsencode(tmp_path) + b"/\xff.log"
    Path(os.fsdecode(capture)).write_bytes(FAULTS.read_bytes())
    assert run("export", capture, "-o", tmp_path / "out.mcap").returncode == 3  # a line is unreadable
    topics = read_mcap(tmp_path / "out.mcap")
    for topic in ("/findings", "/can0/events"):
        assert topics[topic][0][1].file == f"{tmp_path}/\\xff.log"


@pytest.mark.slow
def test_ctrl_c_ends_a_pipe_and_what_came_is_judged(tmp_path: Path) -> None:
    with start("export", "-", "-o", tmp_path / "out.mcap", stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.write(FAULTS.read_bytes())
        process.stdin.flush()
        wait_until(lambda: any(tmp_path.iterdir()))
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert process.returncode == 130
    assert len(read_mcap(tmp_path / "out.mcap")["/findings"]) == 29


def test_what_fails_in_a_rule_is_not_lost(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("in a rule")

    monkeypatch.setattr("analyzer.rules.checking.Check.feed", fail)
    with pytest.raises(RuntimeError, match="in a rule"):
        command("export", HOVER, "-o", tmp_path / "out.mcap")
    assert list(tmp_path.iterdir()) == []
