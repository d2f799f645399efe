"""Frames a second, rates of commands and reports, stored bit rates."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from kit.encode import Transfer
from kit.flight import OPERATING, Sent, Vehicle, found
from kit.judged import judge, whole
from kit.simulated import flight

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path


def noise(vehicle: Vehicle, start: float, stop: float, per_second: float) -> None:
    """Single frames of node 77 at a steady rate."""
    for k in range(round((stop - start) * per_second / 1000)):
        transfer = Transfer("message", 341, 77, bytes(1), 0, k % 32)
        vehicle.put(start + k * 1000 / per_second, Sent(transfer, None, None))


def busy(per_second: float, throttle: int, stop: float = 2500) -> Vehicle:
    vehicle = Vehicle()
    vehicle.commands(0, stop, throttle)
    noise(vehicle, 0, stop, per_second)
    return vehicle


@pytest.mark.slow
def test_more_frames_than_allowed_while_motors_turn() -> None:
    (one,) = found(busy(2500, 1000), "BUS-001")
    assert one.severity == "warning"
    assert "frames in 1 s, limit 2400; most: node 77" in one.text
    assert int(one.text.split()[0]) in range(2598, 2603)  # with 100 commands
    assert found(busy(2500, 0), "BUS-001") == []
    assert found(busy(2200, 1000), "BUS-001") == []


@pytest.mark.slow
def test_only_whole_seconds_with_motors_turning_count() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 800, 1000)
    vehicle.commands(800, 2000, 0)
    noise(vehicle, 0, 2000, 3000)
    assert found(vehicle, "BUS-001") == []


def set_back(text: str, after: float, by: float) -> str:
    """The same with a clock that is set back by some ms after so many."""
    first = text.splitlines()[0]
    start, lines = float(first[1:18]), []
    for line in text.splitlines():
        t = float(line[1:18])
        t -= by / 1000 * (t - start >= after / 1000)
        lines.append(f"({t:.6f}{line[18:]}\n")
    return "".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize("by", [12, 50, 300, 900, 1100, 5000])
@pytest.mark.parametrize("throttle", [1000, 0])
def test_a_clock_that_is_set_back_makes_no_second_fuller(by: float, throttle: int) -> None:
    """What is too much behind it is found all the same."""
    rules = ("BUS-001", "BUS-002", "BUS-003")
    text = set_back(busy(2230 if throttle else 3800, throttle, 4000).finish(), 2000, by)
    assert whole(text, rules, (401,)) == []
    more = set_back(busy(2600 if throttle else 4200, throttle, 5500).finish(), 2000, by)
    (one,) = whole(more, rules, (401,))
    assert (one.rule, one.count) == ("BUS-001" if throttle else "BUS-002", 2)


@pytest.mark.slow
def test_overloads_that_are_apart_are_counted() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 6000, 1000)
    noise(vehicle, 0, 1500, 2600)
    noise(vehicle, 4000, 5500, 2600)
    (one,) = found(vehicle, "BUS-001")
    assert one.count == 2


@pytest.mark.slow
def test_more_frames_than_allowed_at_rest() -> None:
    (one,) = found(busy(4200, 0, 1500), "BUS-002")
    assert "limit 4000" in one.text
    assert found(busy(4200, 1000, 1500), "BUS-002") == []
    assert found(busy(3500, 0, 1500), "BUS-002") == []


@pytest.mark.slow
def test_limits_are_scaled_with_the_bit_rate() -> None:
    (one,) = found(busy(1300, 1000), "BUS-003", bit_rate=500_000)
    assert one.severity == "note"
    assert one.text.endswith("1200 at 500 kbps")
    assert found(busy(1000, 1000), "BUS-003", bit_rate=500_000) == []
    assert found(busy(1300, 1000), "BUS-003", bit_rate=1_000_000) == []
    assert found(busy(1300, 1000), "BUS-003") == []


@pytest.mark.parametrize(("period", "count"), [(2.5, 0), (2.7, 0), (2.8, 1), (2.2, 1)])
def test_the_rate_of_commands(period: float, count: int) -> None:
    vehicle = Vehicle()
    sent = vehicle.commands(0, 60 * period, 0, period=period)
    said = found(vehicle, "BUS-006")
    assert len(said) == count
    if said:
        assert said[0].frames == (sent[0].frames[0],)
        assert said[0].text.startswith(f"{1000 / period:.3g}"[:2])


def test_the_rate_is_the_mean_that_info_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of commands in pairs with a rest between, some of which do not arrive whole."""
    vehicle = Vehicle()
    for k in range(200):
        vehicle.commands(12 * k, 12 * k + 6, *[500] * 8, period=3)
    text = vehicle.finish().splitlines(keepends=True)
    path = tmp_path / "commands.log"
    path.write_text("".join(line for k, line in enumerate(text) if k % 21 != 1))
    assert main(["info", str(path), "-T", "json"]) == 0
    (rate,) = (one["hz"] for one in json.loads(capsys.readouterr().out)["nodes"])
    for step in (None, 7, 100):
        (one,) = judge(path.read_text(), ("BUS-006",), step)
        assert one.text.split()[0] == f"{rate:.0f}" == "167"


def test_the_median_and_the_mean_have_to_be_wrong() -> None:
    """A pause makes the mean wrong, and pairs the median."""
    pause, pairs = Vehicle(), Vehicle()
    for start in (0, 1000):
        pause.commands(start, start + 250, 500, period=2.5)
    for k in range(100):
        pairs.commands(5 * k, 5 * k + 2, 500, period=1)
    assert found(pause, "BUS-006") == found(pairs, "BUS-006") == []


def test_few_commands_have_no_rate() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 490, 0)
    assert found(vehicle, "BUS-006") == []


def test_one_command_has_no_rate_however_few_are_enough() -> None:
    vehicle = Vehicle()
    vehicle.command(0, 1000, 1000, 1000)
    assert judge(vehicle.finish(), ("BUS-006",), numbers={"BUS-006": {"min_transfers": 1}}) == []


def test_one_report_has_no_rate_however_few_are_enough() -> None:
    lines = reporting(50, 33).finish().splitlines(keepends=True)
    reports = [k for k, line in enumerate(lines) if "040A" in line]
    text = "".join(line for k, line in enumerate(lines) if k not in reports[3:])
    numbers = {"BUS-018": {"min_transfers": 1, "min_s": 0}}
    assert judge(text, ("BUS-018",), numbers=numbers) == []


def reporting(configured: int, period: float) -> Vehicle:
    vehicle = Vehicle()
    vehicle.parameters(0, esc_fdb_rate=configured)
    vehicle.statuses(100, 3100, period=period)
    return vehicle


@pytest.mark.slow
def test_the_rate_of_reports() -> None:
    (one,) = found(reporting(50, 33), "BUS-018")
    assert (one.node, one.text) == (11, "configured 50 Hz, measured 30.3 Hz")
    assert found(reporting(50, 20), "BUS-018") == []
    assert len(found(reporting(0, 20), "BUS-018")) == 1


def test_lost_reports_do_not_change_the_rate() -> None:
    vehicle = reporting(50, 20)
    kept = [line for k, line in enumerate(vehicle.finish().splitlines(keepends=True)) if k < 8 or k // 3 % 2]
    assert judge("".join(kept), ("BUS-018",)) == []


def counted(configured: int, step: int, offsets: tuple[int, ...] = (0,), period: float = 20) -> Vehicle:
    """Reports of node 11 every `period` ms of so many ESCs, whose transfer IDs rise by `step` from their offsets."""
    vehicle = Vehicle()
    vehicle.parameters(0, esc_fdb_rate=configured)
    fields = {"error_count": OPERATING << 12, "voltage": 50.0, "current": 1.0, "temperature": 40.0, "rpm": 0}
    for k in range(150):
        for n, offset in enumerate(offsets):
            report = {**fields, "power_rating_pct": 0, "esc_index": n}
            vehicle.send(100 + k * period + n * 3, "ESCStatus", 11, report, transfer_id=(offset + k * step) % 32)
    return vehicle


@pytest.mark.slow
@pytest.mark.parametrize(("step", "offsets"), [(2, (0,)), (5, (0,)), (1, (0, 9, 18)), (1, (4, 4, 4))])
def test_ids_that_do_not_count_the_reports_say_nothing_of_the_rate(step: int, offsets: tuple[int, ...]) -> None:
    assert found(counted(50, step, offsets), "BUS-018") == []
    (one,) = found(counted(30, step, offsets), "BUS-018")
    assert one.text == "configured 30 Hz, measured 50.0 Hz"


def test_a_rate_is_measured_from_its_setting_on() -> None:
    vehicle = Vehicle()
    vehicle.statuses(0, 3000, period=20)
    vehicle.configure(3000, esc_index=0, esc_fdb_rate=10)
    vehicle.parameters(3010, esc_fdb_rate=10)
    vehicle.statuses(3100, 6100, period=100)
    assert found(vehicle, "BUS-018") == []


def test_a_stored_rate_against_a_known_one() -> None:
    vehicle = Vehicle()
    sent = vehicle.parameters(0, esc_can_rate=1)
    (one,) = found(vehicle, "BUS-019", bit_rate=1_000_000)
    assert one.frames == (sent.frames[0],)
    assert one.text == "code 1 is 500 kbps, but the bus runs at 1000 kbps"
    same = Vehicle()
    same.parameters(0, esc_can_rate=1)
    assert found(same, "BUS-019", bit_rate=500_000) == []


@pytest.mark.slow
def test_a_stored_rate_against_the_spacing() -> None:
    for code, count in ((1, 1), (0, 0)):
        vehicle = Vehicle()
        vehicle.parameters(0, esc_can_rate=code)
        for k in range(120):
            vehicle.parameters(10 + k, 12)
            for n in range(40):
                vehicle.status(10 + k * 40 + n, 13)
        said = found(vehicle, "BUS-019")
        assert len(said) == count
        assert all("262 us are needed" in one.text for one in said)


def test_configured_rates_add_up() -> None:
    for rate, count in ((100, 0), (400, 1)):
        vehicle = Vehicle()
        vehicle.commands(0, 1000, 0)
        vehicle.parameters(10, 11, esc_fdb_rate=400)
        vehicle.parameters(30, 12, esc_fdb_rate=rate)
        sent = vehicle.parameters(50, 13, esc_fdb_rate=rate)
        said = found(vehicle, "BUS-024")
        assert [one.frames for one in said] == [(sent.frames[0],)] * count
        assert all(one.text == "3701 frames/s configured, limit 2400" for one in said)


def silent(pause: float, period: float = 20) -> Vehicle:
    vehicle = Vehicle()
    vehicle.commands(0, 6000, 0)
    vehicle.statuses(0, 1000, period=period)
    vehicle.statuses(1000 + pause, 6000, period=period)
    return vehicle


@pytest.mark.slow
def test_an_esc_that_stops_reporting() -> None:
    (one,) = found(silent(600), "BUS-025")
    assert (one.node, one.count, one.text) == (11, 1, "index 0 silent for 620 ms, period 20 ms")
    assert found(silent(70), "BUS-025") == []  # less than 100 ms
    assert found(silent(300, period=100), "BUS-025") == []  # less than 5 periods


def test_an_esc_that_is_silent_to_the_end() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 3000, 0)
    sent = vehicle.statuses(0, 1000)
    (one,) = found(vehicle, "BUS-025")
    assert one.frames == (sent[-1].frames[0],)


def test_a_pause_of_the_whole_bus_is_no_dropout() -> None:
    vehicle = Vehicle()
    for start in (0, 3000):
        vehicle.commands(start, start + 1000, 0)
        vehicle.statuses(start, start + 1000)
    assert found(vehicle, "BUS-025") == []


@pytest.mark.slow
def test_a_restart_is_no_dropout() -> None:
    vehicle = silent(1500)
    status = {"health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}
    for ms, uptime in ((500, 100), (2600, 0), (3600, 1)):
        vehicle.send(ms, "uavcan.protocol.NodeStatus", 11, {"uptime_sec": uptime, **status})
    assert found(vehicle, "BUS-025") == []


def test_a_new_rate_is_no_dropout() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 6000, 0)
    vehicle.statuses(0, 1000)
    vehicle.configure(990, esc_index=0, esc_fdb_rate=2)
    vehicle.statuses(1500, 6000, period=500)
    assert found(vehicle, "BUS-025") == []


def test_different_stored_rates() -> None:
    vehicle = Vehicle()
    for k, code in enumerate((0, 0, 1, 9)):
        vehicle.parameters(10 * k, 11 + k, esc_can_rate=code)
    (one,) = found(vehicle, "BUS-029")
    assert (one.node, one.count, one.text) == (13, 1, "code 0 in node 11, 1 in node 13")


def test_the_sample_point_follows_from_the_bit_rate() -> None:
    for rate, count in ((500_000, 1), (1_000_000, 0), (None, 0)):
        vehicle = Vehicle()
        vehicle.command(0, 0)
        assert len(found(vehicle, "BUS-033", bit_rate=rate)) == count


@pytest.mark.slow
def test_a_period_is_known_no_better_than_times_are() -> None:
    """At 10 ms a period of 33.3 ms shows as 30 or 40 ms; 30 Hz is still not 80 Hz."""

    def rounded(text: str) -> str:
        return "".join(f"{line[:14]}0000{line[18:]}" for line in text.splitlines(keepends=True))

    healthy = rounded(flight(seconds=10))
    assert len({line.split()[0] for line in healthy.splitlines()}) < 1001
    assert judge(healthy, ("BUS-018",)) == []
    (one,) = judge(rounded(flight("BUS-018@3", seconds=10)), ("BUS-018",))
    assert one.rule == "BUS-018"
