"""Rules of vehicle files that compare what one ESC says in two messages: a unit is no channel, a bus is not another."""

from __future__ import annotations

from typing import TYPE_CHECKING

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


def test_another_bus_is_another_vehicle(tmp_path: Path) -> None:
    """Its commands are zero, and come right behind those of the first one."""
    rule = 'when = "NodeStatus && src == 11 && RawCommand.cmd[0] > 100"'
    lines = (CAPTURES / "hover-4.log").read_text().splitlines()
    commands = [line.split() for line in lines if "04060A#" in line]
    zeros = [
        f"({float(t[1:-1]) + 1e-4:.6f}) can1 {frame[:9]}{'00' * (len(frame) // 2 - 5)}{frame[-2:]}"
        for t, _, frame in commands
    ]
    both = tmp_path / "both.log"
    both.write_text("\n".join(sorted(lines + zeros, key=lambda line: line.split()[0])) + "\n")
    alone = counts(CAPTURES / "hover-4.log", tmp_path, rule)
    assert alone
    assert counts(both, tmp_path, rule) == alone
