"""Rules of vehicle files that compare what one ESC says in two messages: a unit is no channel, a bus is not another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

import analyzer

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.app.capture import Capture

FLIGHT = CAPTURES / "mission-8-faults.log"
DIFFER = "MotorStatus.speed > 500 && !within(MotorStatus.speed, ESCStatus.rpm, 5 rpm)"
FOLLOWED = 'when = "MotorStatus"\nthen = "ESCStatus"\nwithin = "60 ms"'


def counts(capture: Path, folder: Path, rule: str) -> dict[tuple[str | None, int | None], int]:
    vehicle = folder / "vehicle.toml"
    vehicle.write_text(f'[rule.OWN-001]\ntitle = "x"\n{rule}\n')
    found: dict[tuple[str | None, int | None], int] = {}
    for one in analyzer.check(capture, vehicle=vehicle, select=["OWN"]).findings:
        if one.rule == "OWN-001":
            found[one.bus, one.node] = found.get((one.bus, one.node), 0) + one.count
    return found


def differing(capture: Capture) -> dict[tuple[str, int], int]:
    """Speeds that are not those of the last report of the same node on the same bus, in plain Python."""
    transfers = capture.table("transfers").to_pylist()
    speeds, reports = (
        {row["transfer"]: row[column] for row in capture.table(name).to_pylist() if row["trusted"]}
        for name, column in (("PUSHCAN.MotorStatus", "speed"), ("ESCStatus", "rpm"))
    )
    told: dict[tuple[str, int], int] = {}
    found: dict[tuple[str, int], int] = {}
    for k in sorted(range(len(transfers)), key=lambda k: transfers[k]["frame"][-1]):
        who = capture.buses[transfers[k]["bus"]], transfers[k]["src"]
        told |= {who: reports[k]} if k in reports else {}
        if k in speeds and speeds[k] > 500 and not (who in told and abs(speeds[k] - told[who]) <= 5):
            found[who] = found.get(who, 0) + 1
    return found


def test_the_reports_of_one_esc_are_compared(tmp_path: Path) -> None:
    rows = differing(analyzer.open_capture(FLIGHT))
    assert counts(FLIGHT, tmp_path, f'when = "{DIFFER}"') == rows
    assert sum(rows.values()) < 10  # where a report was lost


def test_a_report_follows_a_packet_of_the_same_esc(tmp_path: Path) -> None:
    assert counts(FLIGHT, tmp_path, FOLLOWED) == {}
    assert counts(FLIGHT, tmp_path, FOLLOWED.replace("ESCStatus", "ESCStatus.rpm < -1"))


@pytest.mark.parametrize("when", [DIFFER, "NodeStatus && src == 10 && RawCommand.cmd[4] > 0"])
def test_another_bus_is_another_vehicle(tmp_path: Path, when: str) -> None:
    """A capture of two: the other one starts later, with the same node IDs and channels."""
    lines = FLIGHT.read_text().splitlines()
    late = [line.replace(" can0 ", " can1 ") for line in (CAPTURES / "hover-4.log").read_text().splitlines()]
    alone = {}
    for name, some in (("one.log", lines), ("other.log", late), ("both.log", lines + late)):
        path = tmp_path / name
        path.write_text("\n".join(sorted(some, key=lambda line: line.split(")")[0])) + "\n")
        found = counts(path, tmp_path, f'when = "{when}"')
        if name == "both.log":
            assert found == alone
        alone |= found
    assert alone or when == DIFFER
