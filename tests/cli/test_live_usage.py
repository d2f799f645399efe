"""Wrong usage of `tailbyte live` is told in one line before anything is opened or written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from analyzer.app.live import run as live_run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration")
BUS = "virtual:here"


@pytest.fixture
def nothing_opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whoever opens an interface, or leaves a file, has not looked at the arguments first."""

    def never(*_: object, **__: object) -> None:
        raise AssertionError("opened")

    monkeypatch.setattr(live_run, "open_receiver", never)
    monkeypatch.chdir(tmp_path)


@pytest.mark.sampled(3)
@pytest.mark.usefixtures("nothing_opened")
@pytest.mark.parametrize(
    ("args", "reason"),
    [
        ("", "which SocketCAN interface? (can0, vcan0; tailbyte live -D lists them)"),
        (f"{BUS} -i {BUS}", "virtual:here is named twice"),
        ("virt:a", "no interface type is called 'virt' (near: virtual)"),
        ("can0,zz", "'zz' is no filter"),
        ("-c can0", "argument -c: takes a number; did you mean tailbyte live can0?"),
        (f"{BUS} -c 0", "argument -c: '0' is not a number of at least 1"),
        (f"{BUS} -q --list", "--list and -q contradict each other"),
        (f"{BUS} -q -V", "-V and -q contradict each other"),
        (f"{BUS} -q -P", "-P and -q contradict each other"),
        (f"{BUS} -q -x", "-x and -q contradict each other"),
        (f"{BUS} -q -l", "-l and -q contradict each other"),
        (f"{BUS} -q -O NodeStatus", "-O and -q contradict each other"),
        (f"{BUS} -w - -T json", "-T json and -w - contradict each other"),
        (f"{BUS} -T fields", "-T fields needs -e FIELD"),
        (f"{BUS} -e dronecan.src", "-e FIELD goes with -T fields, csv, jsonl or json"),
        (f"{BUS} -T fields -e dronecan.scr", "no field or type is called 'dronecan.scr'; did you mean dronecan.src"),
        (f"{BUS} -O Nonsense", "no message is called 'Nonsense'"),
        (f"{BUS} --list --json -", "standard output is taken"),
        (f"{BUS} -w - --json -", "standard output is taken"),
        (f"{BUS} --json a.x --html a.x", "a.x: two reports cannot be one file"),
        (f"{BUS} --status-file a.x --json ./a.x", "a.x: a state and a report cannot be one file"),
        (f"{BUS} -w a.log --status-file a.log", "a.log: a recording and a state cannot be one file"),
        (f"{BUS} --exec-on error", "--exec-on is of no use without --exec"),
        (f"{BUS} -w a.log -F candump --json a.log", "a.log: a recording and a report cannot be one file"),
        (f"{BUS} -w ./a.log --json ../{{here}}/a.log", "./a.log: a recording and a report cannot be one file"),
        (f"{BUS} -o report.doc", "-o report.doc: the name says no format"),
        (f"{BUS} --status 0", "--status: no time at all"),
        (f"{BUS} --status soon", "--status: 'soon' is not a duration"),
        (f"{BUS} -w a.log -w b.mcap -F candump", "b.mcap: the name says mcap, -F says candump"),
        (f"{BUS} -w a.log --compression lz4", "--compression is for MCAP"),
        (f"{BUS} -w a.bin", "a.bin: the name says no format"),
        (f"{BUS} -w - -b packets:5", "-b: files of a ring need names: -w FILE"),
        (f"{BUS} -b packets:5", "-b is for a recording: add -w FILE"),
        (f"{BUS} -w a.log -b files:3", "-b files: says how many are kept"),
        (f"{BUS} -w a.log -a files:3", "-a files: counts the files of a ring: add -b"),
        (f"{BUS} -a filesize:3", "-a filesize: is for a recording: add -w FILE"),
        (f"{BUS} -a durations:3", "-a durations:3: did you mean duration:"),
        (f"{BUS} -a finding:TRF-999", "no such rule (did you mean"),
        (f"{BUS} --trigger error", "--trigger is for a recording: add -w FILE"),
        (f"{BUS} -w a.log --pre 3s", "--pre is of no use without --trigger"),
        (f"{BUS} -w a.log --trigger eror", "no such rule (did you mean error"),
        (f"{BUS} --select XYZ", "no rule is called 'XYZ'"),
        (f"{BUS} --fail-on foo", "'foo' is not CATEGORY:SEVERITY"),
        (f"{BUS} --vehicle nope.toml", "nope.toml: No such file or directory"),
        (f"{BUS} --dissector nope", "nope: no such folder"),
    ],
)
def test_one_line(args: str, reason: str, command: Command, tmp_path: Path) -> None:
    status, out, err = command("live", *args.format(here=tmp_path.name).split())
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("tailbyte live: ")
    assert reason in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        ("-w nope/a.log", "nope/a.log: No such file or directory"),
        ("--html nope/a.html", "nope/a.html: there is no folder nope"),
        ("-w there.log", "there.log: "),
    ],
)
def test_what_cannot_be_written_is_told_at_once(
    args: str, reason: str, command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.log").write_text("mine")
    status, out, err = command("live", BUS, "-q", *args.split())
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith(f"tailbyte: {reason}")
    assert (tmp_path / "there.log").read_text() == "mine"


def test_the_interface_of_python_cans_configuration(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv("CAN_CHANNEL", "there")
    status, _, err = command("live", "-q", "-a", "duration:10ms")
    assert status == 4
    assert "-- virtual:there: 0 frames = 0 received + 0 dropped, as far as its driver tells\n" in err


def test_without_socketcan_or_the_interface(command: Command) -> None:
    status, out, err = command("live", "nosuchcan0", "-q", "-a", "duration:10ms")
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("tailbyte: nosuchcan0: ")


@pytest.mark.parametrize("words", [("live",), ("live", "-w", "more.log"), ("live", "--view")], ids=" ".join)
def test_a_capture_is_no_bus(
    words: tuple[str, ...], command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flight.log").write_text("(1.0) can0 123#01\n")
    status, out, err = command(*words, "flight.log")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "flight.log is a file, no bus: decode, view and check read it, replay sends it" in err
    assert [one.name for one in tmp_path.iterdir()] == ["flight.log"]
