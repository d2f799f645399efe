"""`tailbyte triage --with flight.bin`: the autopilot's words beside the verdict of the bus."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES, dataflash
from kit.dataflash import rcou, words
from kit.simulated import flown

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

BEFORE = 30 * 10**9


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A capture that ends in flight, and the log of the autopilot that commanded in it."""
    folder = tmp_path_factory.mktemp("with")
    made = flown(10, flight="hover", seed=1)
    commands = [(one.frames[0].t, one.values["cmd"]) for one in made.of("RawCommand")]
    said = words(BEFORE // 1000, (1, "MSG", "long before"), (9, "ERR", 5, 1), (9.5, "MSG", "Radio \x1b[31mfailsafe"))
    log, capture = folder / "flight.bin", folder / "flight.log"
    log.write_bytes(dataflash.log(rcou(commands, -BEFORE), said))
    capture.write_text(made.text, encoding="ascii")
    return capture, log


@pytest.mark.slow
def test_its_words_stand_beside_the_verdict(pair: tuple[Path, Path], command: Command) -> None:
    capture, log = pair
    status, out, err = command("triage", capture, "--with", log)
    assert (status, err) == (0, "")
    first, *_ = (line for line in out.splitlines() if line.startswith("Autopilot"))
    assert "autopilot error: radio failsafe" in first
    assert r"Radio \x1b[31mfailsafe" in out
    assert "long before" not in out
    assert "Not on CAN attitude, GPS, pilot, who decided a command\n" in out
    alone = command("triage", capture)[1]
    assert "Add --with flight.bin" in alone
    verdict = [line for line in out.splitlines() if line.startswith("What broke first")]
    assert verdict == [line for line in alone.splitlines() if line.startswith("What broke first")]


def test_programs_get_both(pair: tuple[Path, Path], command: Command, tmp_path: Path) -> None:
    capture, log = pair
    assert command("triage", capture, "--with", log, "--json", tmp_path / "crash.json")[0] == 0
    found = json.loads((tmp_path / "crash.json").read_text())
    assert [one["kind"] for one in found["said"]] == ["autopilot error", "message"]
    assert {one["source"] for one in found["said"]} == {"autopilot"}
    assert found["autopilot"]["parts"]
    assert all(one["source"] == "bus" for one in (*found["after"], *found["earlier"]))


def test_the_log_of_another_flight_tells_nothing(pair: tuple[Path, Path], command: Command) -> None:
    status, out, err = command("triage", CAPTURES / "startup.log", "--with", pair[1])
    assert status == 3
    assert "nothing of it is told" in err
    assert "Autopilot" not in out
