"""A fleet to try reports on: vehicles, firmware, one ESC that ages, damaged, foreign, equal, vanishing files; its key.

    python tests/bench/make_fleet.py FOLDER [--vehicles 6] [--days 24] [--seed 1]

`FOLDER/<vehicle>/<date>/flight.log.gz`, and `FOLDER/key.json`, which says what a report has to find, and nothing else.
What the key calls vanishing is to be removed between listing and reading, and could not be read then; if it is left
there, it is one more capture without a flight.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import io
import json
import random
import sys
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from math import sin
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from kit.encode import Bus, Frame, Transfer, log_line, transfer

MS, SECOND = 10**6, 10**9
LENGTH = 12 * SECOND
ESCS = 4
FIRST_DAY = date(2026, 10, 1)
OLD, NEW = (2, 5), (2, 7)  # firmware: the old one sends reports with a toggle bit that does not alternate
AGEING = 18.0  # kelvin that the ESC which ages gets hotter than the others until the last day


@dataclass
class Plan:
    """What is special about a flight."""

    vehicle: int
    day: int
    firmware: tuple[int, int] = NEW
    warmer: float = 0.0  # of the second ESC
    toggles: int = 0  # reports that break the rule of the toggle bit


def flight(plan: Plan, chance: random.Random) -> list[Frame]:
    """Return the frames of one flight."""
    start = int(datetime.combine(FIRST_DAY, datetime.min.time(), UTC).timestamp()) + plan.day * 86400 + 8 * 3600
    t0 = start * SECOND
    bus = Bus(t0)
    own = [chance.gauss(0, 1) for _ in range(ESCS)]
    air = chance.gauss(15, 5)
    broken = set(chance.sample(range(20, 100), plan.toggles))
    for k, t in enumerate(range(0, LENGTH, 20 * MS)):
        bus.send(t0 + t, transfer("RawCommand", {"cmd": [_command(t)] * ESCS}, 1, k).frames())
    for node in range(ESCS):
        for k, t in enumerate(range(0, LENGTH, 100 * MS)):
            bus.send(t0 + t + 2 * MS + node * MS, _report(node, t, k, plan, own[node], air, k in broken, chance))
    for node in (1, *(11 + n for n in range(ESCS))):
        for k, t in enumerate(range(0, LENGTH, SECOND)):
            bus.send(t0 + t + node * MS, transfer("uavcan.protocol.NodeStatus", _alive(100 + k), node, k).frames())
    for n in range(ESCS):
        request = transfer("uavcan.protocol.GetNodeInfo.Request", {}, 1, n, dst=11 + n)
        bus.send(t0 + (50 + 100 * n) * MS, request.frames())
        bus.send(t0 + (60 + 100 * n) * MS, _information(n, plan.firmware).frames())
    return [frame for frame, _ in bus.run()]


def _command(t: int) -> int:
    """Return the command of 8191: up, hover, and down as a pilot lands."""
    if not SECOND < t < LENGTH - SECOND:
        return 0
    part = min(1.0, (t - SECOND) / (2 * SECOND), (LENGTH - SECOND - t) / (3 * SECOND))
    return round((0.1 + 0.9 * part) * (4000 + 300 * sin(t / SECOND)))


def _report(
    node: int, t: int, k: int, plan: Plan, own: float, air: float, broken: bool, chance: random.Random
) -> list[Frame]:
    on = _command(t) > 0
    rpm = round(_command(t) * 0.6 * (1 + chance.gauss(0, 0.002)))
    warmer = plan.warmer if node == 1 else 0.0
    fields = {
        "error_count": 4 << 12 if on else 1 << 12,
        "voltage": 48.0 - 0.1 * t / SECOND - (0.8 if on else 0),
        "current": 1.6 * (rpm / 1000) ** 2 * (1 + chance.gauss(0, 0.01)),
        "temperature": air + 25 + 0.3 * t / SECOND + own + warmer + chance.gauss(0, 0.3),
        "rpm": rpm,
        "power_rating_pct": round(_command(t) / 81.91) if on else 0,
        "esc_index": node,
    }
    frames = transfer("ESCStatus", fields, 11 + node, k).frames()
    if broken and node == 0:
        middle = frames[1]
        frames[1] = Frame(middle.id, middle.data[:-1] + bytes([middle.data[-1] ^ 0x20]), middle.t)
    return frames


def _alive(uptime: int) -> dict[str, int]:
    return {"uptime_sec": uptime, "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}


def _information(n: int, firmware: tuple[int, int]) -> Transfer:
    software = {
        "major": firmware[0], "minor": firmware[1], "optional_field_flags": 0, "vcs_commit": 0, "image_crc": 0,
    }  # fmt: skip
    hardware = {"major": 1, "minor": 0, "unique_id": [n] * 16, "certificate_of_authenticity": []}
    fields: dict[str, Any] = {
        "status": _alive(100), "software_version": software, "hardware_version": hardware, "name": list(b"com.esc"),
    }  # fmt: skip
    return transfer("uavcan.protocol.GetNodeInfo.Response", fields, 11 + n, n, dst=1)


def packed(frames: list[Frame]) -> bytes:
    """Return the frames as a packed log, the same bytes for the same frames."""
    return gzip.compress("".join(f"{log_line(one)}\n" for one in frames).encode(), 6, mtime=0)


def make(folder: Path, vehicles: int = 6, days: int = 24, seed: int = 1) -> dict[str, Any]:
    """Write the fleet, and return the key."""
    chance = random.Random(seed)
    turn = days // 2  # from this day on the ESC ages
    last, good = b"", b""
    for vehicle in range(1, vehicles + 1):
        for day in range(days):
            old = vehicle >= vehicles - 1  # the last two vehicles have the old firmware, and no other one has it
            warmer = AGEING * (day - turn + 1) / (days - turn) if vehicle == 3 and day >= turn else 0.0
            plan = Plan(vehicle, day, OLD if old else NEW, warmer, 3 if old and chance.random() < 0.6 else 0)
            last = packed(flight(plan, chance))
            _write(folder, vehicle, day, "flight.log.gz", last)
            good = good or last
    crash(folder / "v02" / (FIRST_DAY + timedelta(days - 1)).isoformat() / "crash.log.gz", days - 1)
    _write(folder, vehicles, days, "copy.log.gz", last)  # the same bytes under another name
    _write(folder, 1, days, "cut.log.gz", good[: len(good) // 2])
    _write(folder, 1, days + 1, "garbage.log.gz", bytes(chance.randrange(256) for _ in range(3000)))
    _write(folder, 2, days, "empty.log.gz", b"")
    _write(folder, 2, days + 1, "foreign.log.gz", packed(_foreign(days + 1, chance)))
    vanishing = _write(folder, 4, days, "vanishing.log.gz", packed(_foreign(days, chance)))
    key = {
        "vehicles": vehicles,
        "captures": vehicles * days + 7,
        "vanishing": [str(vanishing.relative_to(folder))],
        "duplicates": 1,
        "unreadable": 1,
        "damaged": 1,
        "odd": [{
            "vehicle": "v03", "ch": 2, "quantity": "temperature_median", "sign": 1,
            "since": (FIRST_DAY + timedelta(turn)).isoformat(),
        }],
        "open": [{"vehicle": "v02", "kind": "esc"}],
        "firmware": [{"rule": "TRF-003", "software": "2.5"}],
        "not_separable": [f"v{vehicle:02}" for vehicle in (vehicles - 1, vehicles)],
    }  # fmt: skip
    (folder / "key.json").write_text(json.dumps(key, indent=1))
    return key


def crash(path: Path, day: int) -> None:
    """Write a flight in which an ESC fails, by the simulator."""
    from analyzer.cli import main as tailbyte  # noqa: PLC0415 - only the folder of tests is needed before

    start = (FIRST_DAY + timedelta(day)).isoformat()
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        arguments = ("--scenario", "esc-failure", "--start", f"{start}T12:00:00", "--seed", "3")
        ended = tailbyte(["simulate", "-o", str(path), *arguments])
    assert ended == 0, said.getvalue()


def _foreign(day: int, chance: random.Random) -> list[Frame]:
    start = int(datetime.combine(FIRST_DAY, datetime.min.time(), UTC).timestamp()) + day * 86400
    return [
        Frame(0x100 + k % 7, chance.randbytes(8), start * SECOND + k * 10 * MS, extended=False) for k in range(1000)
    ]


def _write(folder: Path, vehicle: int, day: int, name: str, data: bytes) -> Path:
    path = folder / f"v{vehicle:02}" / (FIRST_DAY + timedelta(day)).isoformat() / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def main() -> None:
    """Write what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    for name, usual in (("vehicles", 6), ("days", 24), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    args = parser.parse_args()
    key = make(args.folder, args.vehicles, args.days, args.seed)
    sys.stdout.write(f"{key['captures']} captures of {key['vehicles']} vehicles\n")


if __name__ == "__main__":
    main()
