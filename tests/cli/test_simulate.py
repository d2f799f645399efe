"""`tailbyte simulate` into a file: what it writes, and what it refuses."""

from __future__ import annotations

import gzip
import json
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zstandard
from kit.command import run
from kit.rows import records, sound

from analyzer.simulate import START
from analyzer.simulate.faults import catalogue
from dissectors.tmotor.traffic import FLIGHT_PLANS

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

SHORT = ("--duration", "300ms", "--seed", "5")
FAULTY = ("--duration", "2", "--fault", "TRF-003@1", "--fault", "TRF-003@1.2:node=11")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path().iterdir()}


@pytest.mark.slow
def test_every_format_holds_the_same_frames(command: Command) -> None:
    names = ("a.log", "b.candump", "c.log.gz", "d.txt.zst", "e.mcap", "f.pcapng")
    for name in names:
        assert command("simulate", "-o", name, *SHORT)[0] == 0
    got = files()
    assert got["a.log"] == got["b.candump"] == gzip.decompress(got["c.log.gz"])
    assert zstandard.ZstdDecompressor().stream_reader(got["d.txt.zst"]).read() == got["a.log"]
    frames = records(sound("candump", got["a.log"]))
    assert len(frames) > 20
    for name, form in (("e.mcap", "mcap"), ("f.pcapng", "pcapng")):
        assert records(sound(form, got[name])) == frames


@pytest.mark.slow
def test_the_same_settings_give_the_same_bytes(command: Command) -> None:
    names = ("a.log.gz", "a.mcap", "a.pcapng", "key.json")
    seen: dict[str, set[bytes]] = {name: set() for name in names}
    for _ in range(2):
        for name in names[:3]:
            assert command("simulate", "-o", name, "--key", "key.json", *FAULTY)[0] == 0
        for name in names:
            seen[name].add(Path(name).read_bytes())
    assert [len(found) for found in seen.values()] == [1] * 4
    command("simulate", "-o", "b.log.gz", *FAULTY, "--seed", "2")
    assert Path("b.log.gz").read_bytes() not in seen["a.log.gz"]


def test_the_summary_counts_what_is_there(command: Command) -> None:
    status, out, err = command("simulate", "-o", "a.log", *FAULTY)
    frames = Path("a.log").read_text().count("\n")
    assert (status, out, err) == (0, "", f"-- {frames:,} frames, 2.0 s, 2 faults written to a.log\n")
    status, _, err = command("simulate", "-o", "a.log", *SHORT)
    assert err.endswith(" frames, 0.3 s, 0 faults written to a.log\n")


def test_the_key(command: Command) -> None:
    command("simulate", "-o", "a.log", "--key", "key.json", *FAULTY)
    text = Path("key.json").read_text()
    key = json.loads(text)
    assert [fault["rule"] for fault in key["faults"]] == ["TRF-003"] * 2
    assert key["settings"]["faults"] == ["TRF-003@1", "TRF-003@1.2:node=11"]
    lines = Path("a.log").read_text().splitlines()
    for fault in key["faults"]:
        assert re.search(rf'^   "frames": \[{", ".join(map(str, fault["frames"]))}\],$', text, re.MULTILINE)
        first = lines[fault["frames"][0] - 1]
        seconds, micro = re.match(r"\((\d+)\.(\d+)\)", first).groups()
        assert int(seconds) * 10**9 + int(micro) * 1000 == fault["t_ns"]
        assert {int(lines[number - 1].split()[2][6:8], 16) for number in fault["frames"]} == {fault["node"]}
    assert key["faults"][1]["node"] == 11
    assert text.endswith("]\n}\n")
    assert max(map(len, text.splitlines())) < 400


def test_a_text_in_the_key_is_left_as_it_is(command: Command) -> None:
    """It may look like a list of numbers."""
    command("simulate", "-o", "a.log", "--key", "key.json", *SHORT, "--bus-name", "[1,2]")
    assert json.loads(Path("key.json").read_text())["capture"]["bus"] == "[1,2]"


@pytest.mark.slow
def test_standard_output(command: Command) -> None:
    command("simulate", "-o", "a.log", *SHORT)
    assert run("simulate", "-o", "-", *SHORT).stdout == Path("a.log").read_bytes()
    command("simulate", "-o", "a.mcap", *SHORT)
    assert run("simulate", "-o", "-", "-F", "mcap", *SHORT).stdout == Path("a.mcap").read_bytes()
    done = run("simulate", "-o", "b.log", "--key", "-", *SHORT)
    assert (done.returncode, json.loads(done.stdout)["faults"]) == (0, [])


def test_settings_reach_the_simulation(command: Command) -> None:
    wanted = (
        "--flight", "bench", "--esc", "2", "--seed", "-3", "--rate", "10", "--bitrate", "500000", "--stock",
        "--start", "2026-01-02T03:04:05.5Z", "--bus-name", "can7", "--duration", "1s", "--fault-rate", "TRF-003=0",
    )  # fmt: skip
    assert command("simulate", "-w", "a.log", "--key", "key.json", *wanted)[0] == 0
    key = json.loads(Path("key.json").read_text())
    assert key["settings"] == {
        "profile": "bench", "scenario": None, "esc": 2, "duration_ns": 10**9, "seed": -3, "bit_rate": 500_000,
        "rate_hz": 10, "stock": True, "start_ns": 1_767_323_045_500_000_000, "faults": [],
        "fault_rates": ["TRF-003=0"],
    }  # fmt: skip
    assert {line.split()[1] for line in Path("a.log").read_text().splitlines()} == {"can7"}
    assert Path("a.log").read_text().startswith("(176732304")


@pytest.mark.slow
def test_without_settings(command: Command) -> None:
    command("simulate", "-o", "a.log", "--key", "key.json")
    settings = json.loads(Path("key.json").read_text())["settings"]
    wanted = {"profile": "hover", "esc": 4, "duration_ns": 10 * 10**9, "seed": 1, "bit_rate": 10**6, "start_ns": START}
    assert settings.items() >= wanted.items()


@pytest.mark.parametrize("flight", FLIGHT_PLANS)
def test_every_flight(command: Command, flight: str) -> None:
    assert command("simulate", "-o", "a.log", "--flight", flight, "--duration", "1")[0] == 0


def test_the_old_name_of_the_flight_still_works(command: Command) -> None:
    args = ("simulate", "-o", "a.log", "--duration", "0.2", "--esc", "1")
    assert command(*args, "--flight", "bench")[0] == 0
    data = Path("a.log").read_bytes()
    status, _, err = command(*args, "--profile", "bench")
    assert status == 0
    assert err.startswith("tailbyte simulate: --profile is deprecated: the option is called --flight now\n")
    assert err.count("\n") == 2  # that, and what has been written
    assert Path("a.log").read_bytes() == data
    assert "--profile" not in command("simulate", "--help")[1]


@pytest.mark.slow
def test_a_scenario_brings_its_flight_and_its_time(command: Command) -> None:
    for story in catalogue.stories().values():
        least = ("--esc", str(story.least)) if story.least > 4 else ()
        status, _, err = command("simulate", "-o", "a.log", "--key", "key.json", "--scenario", story.name, *least)
        assert status == 0, err
        key = json.loads(Path("key.json").read_text())
        assert key["settings"]["profile"] == story.flight
        assert key["settings"]["duration_ns"] == round(story.seconds * 10**9)
        assert key["scenario"]["events"]


@pytest.mark.slow
def test_a_scenario_in_another_flight(command: Command) -> None:
    story = next(iter(catalogue.stories()))
    command("simulate", "-o", "a.log", "--key", "key.json", "--scenario", story, "--flight", "mission")
    assert json.loads(Path("key.json").read_text())["settings"]["profile"] == "mission"


def test_the_list(command: Command) -> None:
    status, out, err = command("simulate", "--list")
    assert (status, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    words = out.split()
    for fault in catalogue.faults().values():
        assert fault.rule in words
        assert " ".join(fault.title.split()) in " ".join(words)
        assert {f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
                for name, value in fault.options.items()} <= set(words)  # fmt: skip
    for story in catalogue.stories().values():
        assert story.name in words
        assert " ".join(story.story.split()) in " ".join(words)


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        ([], "where to? give -o FILE, or an interface such as vcan0; or --list"),
        (["out.log"], "out.log is no interface: did you mean -o out.log?"),
        (["-i", "out.mcap.gz"], "out.mcap.gz is no interface: did you mean -o out.mcap.gz?"),
        (["-o", "out.log", "vcan0"], "to the file out.log or onto the bus vcan0: which one?"),
        (["-o", "out.log", "--channel", "x"], "to the file out.log or onto the bus x: which one?"),
        (["-o", "out"], "out: the name says no format: give -F candump, mcap or pcapng"),
        (["-o", "out.blf"], "out.blf: the name says no format: give -F candump, mcap or pcapng"),
        (["-o", ""], "the output has no name"),
        (["-o", "out.log", "-F", "mcap"], "out.log: the name says candump, -F says mcap"),
        (["-o", "out.log", "--compression", "lz4"], "--compression is for MCAP"),
        (["-o", "out.log", "--key", "./out.log"], "the capture and its key need a file each"),
        (["-o", "-", "--key", "-"], "the capture and its key need a file each"),
        (["-o", "out.log", "--fd"], "--fd is for a bus"),
        (["-o", "out.log", "--allow-actuation"], "--allow-actuation is for a bus"),
        (["-o", "out.log", "--bus-kwargs", "a=1"], "--bus-kwargs is for a bus"),
        (["vcan0", "--start", "1773475330"], "--start is for a file"),
        (["vcan0", "-F", "mcap"], "-F is for a file"),
        (["-o", "out.log", "--flight", "hoover"], f"no flight is called 'hoover' (there is {', '.join(FLIGHT_PLANS)})"),
        (["-o", "out.log", "--scenario", "none"], "no scenario is called 'none'"),
        (["-o", "out.log", "--esc", "0"], "--esc 0 is outside 1 to 20"),
        (["-o", "out.log", "--esc", "21"], "--esc 21 is outside 1 to 20"),
        (["-o", "out.log", "--rate", "401"], "--rate 401 is outside 1 to 400"),
        (["-o", "out.log", "--bitrate", "800000"],
         "--bitrate 800000 is none of 1000000, 500000, 250000, 125000, 100000, 50000"),
        (["-o", "out.log", "--duration", "long"], "--duration: 'long' is not a time (2.5, 2.5s, 300ms, 10min)"),
        (["-o", "out.log", "--duration", "25h"], "--duration: '25h' is more than a day"),
        (["-o", "out.log", "--duration", "0"], "--duration is nothing"),
        (["-o", "out.log", "--duration", "1us"], "nothing is sent in 1e-06 s"),
        (["-o", "out.log", "--seed", "9" * 5000],
         f"argument --seed: '{'9' * 20}' is not a whole number (see tailbyte simulate --help)"),
        (["-o", "out.log", "--bus-name", "a#b"], None),
        (["-o", "out.log", "--bus-name", "x" * 61], None),
        (["-o", "out.log", "--start", "12.5"],
         "--start: '12.5' is no date (2026-03-14T12:49:54, or seconds since 1970)"),
        (["-o", "out.log", "--start", "9999-01-01"],
         "--start: '9999-01-01' is no date (2026-03-14T12:49:54, or seconds since 1970)"),
        (["-o", "out.log", "--start", "noon"], None),
        (["-o", "out.log", "--bus-name", "a b"],
         "--bus-name: 'a b' is not a name of printable characters without spaces and #, at most 60"),
        (["-o", "out.log", "--fault", "TRF-999"], None),
        (["-o", "out.log", "--fault", "trf-003@nan"], None),
        (["-o", "out.log", "--fault", "TRF-003:nod=3"], None),
        (["-o", "out.log", "--fault", "TRF-003@10"], "--fault TRF-003@10: that is after the end, 10 s"),
        (["-o", "out.log", "--fault-rate", "TRF-003"], "'TRF-003' is not RULE=P with a probability from 0 to 1"),
        (["-o", "out.log", "--fault-rate", "TRF-003=2"], "'TRF-003=2' is not RULE=P with a probability from 0 to 1"),
        (["-o", "out.log", "--duration", "1", "--fault", "TRF-003:node=99", "--fault", "TRF-001:node=98"],
         "no occasion in 1 s for TRF-003:node=99, TRF-001:node=98"),
        (["-o", "out.log", "--seed", "one"], None),
        (["-o", "out.log", "--no-such"], None),
    ],
)  # fmt: skip
def test_what_is_refused(command: Command, args: list[str], reason: str | None) -> None:
    Path("out.log").write_text("old")
    status, out, err = command("simulate", *args)
    assert (status, out, err.count("\n")) == (2, "", 1), err
    assert reason is None or err == f"tailbyte simulate: {reason}\n"
    assert files() == {"out.log": b"old"}


def test_names_that_come_near_are_said(command: Command) -> None:
    assert "TRF-031" in command("simulate", "-o", "out.log", "--fault", "TRF-0311")[2]
    near = next(iter(catalogue.stories()))
    assert near in command("simulate", "-o", "out.log", "--scenario", near[:-1])[2]


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "America/New_York"])
def test_a_date_without_a_zone_is_the_same_moment_everywhere(
    command: Command, monkeypatch: pytest.MonkeyPatch, zone: str
) -> None:
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    assert command("simulate", "-o", "x.log", "--duration", "50ms", "--start", "2026-03-14T12:49:54")[0] == 0
    assert Path("x.log").read_text().startswith("(1773492594.00")


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("arguments", "rules"),
    [
        (["pack-sag", "--stock"], "TYP-305"),
        (["pack-sag", "--duration", "2"], "TYP-305"),
        (["bus-break", "--duration", "2"], "CAP-002"),
        (["esc-failure", "--flight", "startup", "--duration", "6"], "BUS-028"),
        (["command-loss", "--flight", "startup", "--duration", "2", "--esc", "20"], "BUS-007"),
    ],
)
def test_a_story_that_is_not_told_is_refused(command: Command, arguments: list[str], rules: str) -> None:
    status, _, err = command("simulate", "-o", "x.log", "--scenario", *arguments)
    assert (status, err.count("\n"), Path("x.log").exists()) == (2, 1, False)
    assert f"the scenario {arguments[0]} does not happen in " in err
    assert err.endswith(f": no {rules}\n")
