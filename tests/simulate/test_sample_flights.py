"""The simulated sample captures: what their keys say is in them, and nothing else is wrong with them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES, ROOT
from kit.libraries import received
from kit.simulated import FLIGHTS, TEN, Flight, key_of, prove
from witness import finder
from witness.reader import Log

from analyzer.cli import main
from analyzer.simulate.faults import catalogue

if TYPE_CHECKING:
    from pathlib import Path

    from witness.reader import Transfer

LOGS = [name for name in FLIGHTS if name.endswith(".log")]
CLEAN = {"hover-4.log": set(), "startup.log": {"CAN-008"}}  # nodes that ask for their ID are anonymous
QUERY = "TYP-208"  # the ground station asks for all parameters in every flight


def flight(name: str) -> Flight:
    path = CAPTURES / name
    return Flight(Log(path.read_text()), json.loads(key_of(path).read_text()), ())


@pytest.mark.parametrize("name", LOGS)
def test_every_fault_of_the_key_is_in_the_bytes(name: str) -> None:
    found = flight(name)
    assert found.key["capture"]["frames"] == len(found.log.frames)
    assert found.key["capture"]["error_frames"] == len(found.log.errors)
    for answer in found.key["faults"]:
        listed = [found.log[number] for number in answer["frames"]]
        listed += [found.log.lines[number - 1] for number in answer["lines"]]
        assert min(frame.t for frame in listed) == answer["t_ns"]
        assert max(frame.t for frame in listed) == answer["t_end_ns"]
        assert all(frame.error for frame in listed[len(answer["frames"]) :])


def _proved() -> set[str]:
    """The rules that the witness knows: those of frames, transfers, values and packets."""
    return {rule for rule in catalogue.faults() if not rule.startswith(("BUS", "CAP"))} - {QUERY}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", sorted(CLEAN))
def test_nothing_is_wrong_with_a_clean_flight(name: str) -> None:
    found = flight(name)
    assert found.key["faults"] == []
    rules = _proved()
    assert {rule for rule in rules if finder(rule)(found.log)} == CLEAN[name]


@pytest.mark.parametrize("name", sorted(CLEAN))
def test_pydronecan_takes_every_transfer_of_a_clean_flight(name: str) -> None:
    found = flight(name)
    taken = received((CAPTURES / name).read_text())
    assert [number for number, _ in taken] == [one.frames[-1].number for one in sorted(found.log.transfers, key=_end)]
    assert {one.status for one in found.log.transfers} == {"ok"}
    assert {one.payload._type.full_name for _, one in taken} >= {"com.tmotor.esc.PUSHCAN", "com.tmotor.esc.ParamGet"}


def _end(transfer: Transfer) -> int:
    return transfer.frames[-1].number


@pytest.mark.slow
def test_ten_faults_and_no_more() -> None:
    found = flight("mission-8-faults.log")
    orders = [catalogue.order(text) for text in TEN.split()]
    assert sorted(answer["rule"] for answer in found.key["faults"]) == sorted(order.fault.rule for order in orders)
    assert len(orders) == 10
    for order in orders:
        prove(order.fault.rule, found)
        (answer,) = found.answers(order.fault.rule)
        assert answer["time"] * 1e9 >= (order.t or 0)
    allowed = {rule for answer in found.key["faults"] for rule in (answer["rule"], *answer["also"])}
    rules = _proved()
    assert {rule for rule in rules if finder(rule)(found.log)} <= allowed


@pytest.mark.slow
def test_the_mcap_holds_what_the_text_would(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "x.log"
    assert main(["simulate", *FLIGHTS["esc-failure.mcap"].split(), "-o", str(text)]) == 0
    for path in (CAPTURES / "esc-failure.mcap", text):
        assert main(["convert", str(path), "-", "-F", "candump"]) == 0
    mcap, log = (part for part in _halves(capsys.readouterr().out))
    assert mcap == log


def _halves(text: str) -> tuple[list[str], list[str]]:
    lines = text.splitlines()
    return lines[: len(lines) // 2], lines[len(lines) // 2 :]


def test_all_captures_together_are_small() -> None:
    assert sum(path.stat().st_size for path in CAPTURES.iterdir()) < 5_500_000
    stories = [path for path in map(CAPTURES.joinpath, FLIGHTS) if "--scenario" in FLIGHTS[path.name]]
    assert max(path.stat().st_size for path in stories) < 310_000


def test_each_kind_of_cause_is_there() -> None:
    stories = [json.loads(key_of(CAPTURES / name).read_text())["scenario"] for name in FLIGHTS]
    kinds = {one["cause"]["kind"] for one in stories if one}
    assert kinds >= {
        *("esc", "propulsion", "thrust", "control", "commanded", "commands-lost", "wiring", "bus", "battery"),
        *("recorder", "address", "device", "setup", "none"),
    }
    assert any("unknown" in one["knowable"] for one in stories if one)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_readme_says_what_it_is_and_how_it_was_made(name: str) -> None:
    rows = [line for line in (CAPTURES / "README.md").read_text().splitlines() if line.startswith(f"| `{name}` |")]
    assert len(rows) == 1
    assert f"`{FLIGHTS[name]}`" in rows[0] or "kit/simulated.py" in rows[0]
    assert "make_captures" in (ROOT / "captures" / "README.md").read_text()


def test_keys_are_as_documented() -> None:
    fields = {"rule", "t_ns", "t_end_ns", "time", "frames", "lines", "more", "node", "type", "done", "also"}
    for name in FLIGHTS:
        key: dict[str, Any] = json.loads(key_of(CAPTURES / name).read_text())
        assert key["schema"] == "tailbyte.simulate.key/1"
        assert all(set(answer) == fields for answer in key["faults"])
