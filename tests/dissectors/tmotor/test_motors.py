"""Motors against their throttle, throttle that stops, two angles of one rotor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES
from kit.flight import Vehicle, found
from kit.judged import judge

if TYPE_CHECKING:
    from kit.flight import Sent

COAST_DOWN, FOLD = 5, 7
FULL = 8191


def stopping(pause: float, throttle: int = 2000, rpm: int = 3000, bits: int = 0) -> tuple[Vehicle, list[Sent]]:
    vehicle = Vehicle()
    sent = vehicle.commands(0, 1000, throttle)
    vehicle.commands(1000 + pause, 2000 + pause, throttle)
    vehicle.statuses(0, 1000, rpm=rpm)
    vehicle.statuses(1000, 1000 + pause, rpm=rpm, bits=bits)
    vehicle.statuses(1000 + pause, 2000 + pause, rpm=rpm)
    return vehicle, sent


@pytest.mark.slow
def test_commands_that_stop() -> None:
    vehicle, sent = stopping(800, bits=8)
    (one,) = found(vehicle, "BUS-007")
    assert (one.severity, one.node, one.frames) == ("error", 1, (sent[-1].frames[0],))
    assert one.text == "none for 810 ms; throttle loss in index 0"
    assert found(stopping(80)[0], "BUS-007") == []


@pytest.mark.slow
def test_commands_that_stop_at_rest_are_a_note() -> None:
    (one,) = found(stopping(500, throttle=0, rpm=0)[0], "BUS-007")
    assert (one.severity, one.text) == ("note", "none for 510 ms; throttle loss in no ESC")
    (one,) = found(stopping(500, throttle=0, rpm=200)[0], "BUS-007")
    assert one.severity == "error"


def test_commands_that_do_not_come_back() -> None:
    for after, count in ((50, 0), (1000, 1)):
        vehicle = Vehicle()
        sent = vehicle.commands(0, 500, 1000)
        vehicle.statuses(0, 500 + after, rpm=500)
        said = found(vehicle, "BUS-007")
        assert [one.frames for one in said] == [(sent[-1].frames[0],)] * count


def test_a_silent_bus_is_no_stop_of_commands() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 500, 1000)
    vehicle.commands(2500, 3000, 1000)
    assert found(vehicle, "BUS-007") == []


def test_lone_commands_are_no_stream() -> None:
    vehicle = Vehicle()
    for k in range(6):
        vehicle.command(k * 300, 0)
    assert found(vehicle, "BUS-007") == []


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("bits", "severity"), [(0, "warning"), (1 << 4, "note")])
def test_negative_throttle(bits: int, severity: str) -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 1000, 0)
    vehicle.commands(1000, 1200, -1000)
    vehicle.commands(1200, 2000, 0)
    vehicle.statuses(5, 1000)
    during = vehicle.statuses(1005, 1205, bits=bits)
    vehicle.statuses(1205, 2000)
    (one,) = found(vehicle, "BUS-016")
    assert (one.severity, one.frames) == (severity, (during[0].frames[0],))
    answer = "the ESC sets bit 4, as it should," if bits else "the ESC is silent (bit 4 is 0)"
    assert one.text == f"ch1 = -1000: {answer} in 10 reports"


@pytest.mark.slow
def test_one_report_does_not_prove_silence() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 1000, 0)
    vehicle.commands(1000, 1020, -1000)
    vehicle.commands(1020, 2000, 0)
    vehicle.statuses(5, 2000)
    assert found(vehicle, "BUS-016") == []


def test_stock_escs_need_not_report_negative_throttle() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 1000, -1000)
    vehicle.statuses(5, 1000, mode=0)
    assert found(vehicle, "BUS-016") == []


def following(throttle: int, rpm: int, seconds: float, **more: int) -> tuple[Vehicle, list[Sent]]:
    vehicle = Vehicle()
    vehicle.commands(0, seconds * 1000, throttle)
    return vehicle, vehicle.statuses(5, seconds * 1000, rpm=rpm, **more)


@pytest.mark.slow
def test_a_motor_that_does_not_start() -> None:
    vehicle, sent = following(4096, 0, 3)
    (one,) = found(vehicle, "BUS-028")
    assert (one.count, one.text) == (1, "ch1 at 50 %, 0 rpm")
    assert one.frames == (sent[50].frames[0],)
    assert found(following(4096, 0, 0.9)[0], "BUS-028") == []
    assert found(following(800, 0, 3)[0], "BUS-028") == []  # below 10 %
    assert found(following(4096, 100, 3)[0], "BUS-028") == []


@pytest.mark.slow
def test_a_motor_that_starts_late() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 3000, 4096)
    vehicle.statuses(5, 900)
    vehicle.statuses(905, 1000, rpm=50)
    vehicle.statuses(1005, 1900)
    vehicle.statuses(1905, 3000, rpm=50)
    assert found(vehicle, "BUS-028") == []


def test_a_short_zero_starts_the_second_anew() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 800, 4096)
    vehicle.command(800, 0)
    vehicle.commands(810, 1600, 4096)
    vehicle.statuses(5, 1600)
    assert found(vehicle, "BUS-028") == []


@pytest.mark.slow
def test_a_motor_that_turns_without_throttle() -> None:
    (one,) = found(following(0, 900, 4)[0], "BUS-028")
    assert one.text == "ch1 at 0 %, 900 rpm"
    assert found(following(0, 900, 1.9)[0], "BUS-028") == []
    assert found(following(0, 400, 4)[0], "BUS-028") == []
    assert found(following(0, 900, 4, mode=COAST_DOWN)[0], "BUS-028") == []
    assert found(following(0, 900, 4, mode=FOLD)[0], "BUS-028") == []


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "count"), [(0xA1, 0), (0xFF, 0), (0xA2, 1)])
def test_a_motor_that_a_control_packet_drives(unit: int, count: int) -> None:
    vehicle, _ = following(0, 900, 4)
    vehicle.push(1, "PUSHSCI.OutputControl", 126, unit, control_mode=0x33, set_point=900)
    assert len(found(vehicle, "BUS-028")) == count


def test_old_commands_are_not_held_against_a_motor() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 500, 4096)
    vehicle.statuses(5, 500, rpm=900)
    vehicle.statuses(505, 4000)
    assert found(vehicle, "BUS-028") == []


def test_the_motor_of_a_failing_esc() -> None:
    text = (CAPTURES / "command-loss.log").read_text()
    assert judge(text, ("BUS-028",)) == []
    assert [one.text for one in judge(text, ("BUS-007",))] == ["none for 2494 ms; throttle loss in index 0, 1, 2"]


@pytest.mark.parametrize(
    ("encoder", "position", "rpm", "apart", "count"),
    [
        (4150, 9600, 0, 5, 1),
        (4150, 9120, 0, 5, 0),
        (4150, 9600, 0, 15, 0),
        (4150, 9600, 300, 5, 0),
        (16380, 50, 0, 5, 0),
    ],
)
def test_two_angles_of_one_rotor(encoder: int, position: int, rpm: int, apart: float, count: int) -> None:
    for first in (True, False):
        vehicle = Vehicle()
        vehicle.status(0 if first else apart, encoder=encoder, rpm=rpm)
        vehicle.push(apart if first else 0, "PUSHCAN.MotorStatus", 11, 0xA1, position=position, speed=rpm)
        said = found(vehicle, "BUS-032")
        assert [one.text for one in said] == ["encoder 91.2, position 96.0 degrees"] * count


@pytest.mark.parametrize(("pwm", "after", "count"), [(14200, 300, 1), (0, 300, 0), (14200, 50, 0)])
def test_pwm_that_takes_over(pwm: int, after: float, count: int) -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 510, 4096)
    sent = vehicle.push(500 + after, "PUSHCAN.MotorStatus", 11, 0xA1, pwm=pwm, speed=3900, throttle=100)
    vehicle.push(600 + after, "PUSHCAN.MotorStatus", 11, 0xA1, pwm=pwm * (count == 1), speed=3900, throttle=100)
    said = found(vehicle, "BUS-034")
    assert [(one.frames, one.text) for one in said] == [
        ((sent.frames[0],), "PWM 1420.0 us, 3900 rpm without commands")
    ] * count
