"""The laws that one motor, its ESC's heat and the pack keep, whatever drives them."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.strategies import examples

from dissectors.tmotor.traffic import control
from dissectors.tmotor.traffic.control import LIMITS, MODES, MotorControl
from dissectors.tmotor.traffic.operation import COAST_DOWN, IDLE, OPERATING, SOFT_START, Operation
from dissectors.tmotor.traffic.physics.motor import RPM, Drive, Motor
from dissectors.tmotor.traffic.physics.pack import Pack


def motor(drive: Drive = Drive.DUTY, set_point: float = 0.5, **state: float) -> Motor:
    made = Motor(20.0, drive=drive, set_point=set_point)
    made.voltage = 48.0
    for name, value in state.items():
        setattr(made, name, value)
    return made


drives = st.sampled_from([(Drive.DUTY, 0.6), (Drive.DUTY, 0.05), (Drive.SPEED, -20.0), (Drive.FREE, 0.0),
                          (Drive.BRAKE, 0.0), (Drive.ANGLE, 200.0)])  # fmt: skip


@given(drives, st.floats(0, 400), st.lists(st.integers(1, 40_000), min_size=1, max_size=30))
@examples(60)
def test_steps_of_any_size_end_in_the_same_place(drive: tuple[Drive, float], speed: float, steps: list[int]) -> None:
    """Before friction stops it: the exact solution does not know how often it was asked."""
    whole, parts = (motor(*drive, speed=speed) for _ in range(2))
    whole.advance(sum(steps) / 1e6)
    for at in range(len(steps)):
        parts.advance(sum(steps[: at + 1]) / 1e6)
    if drive[0] is Drive.ANGLE or abs(whole.speed) > 10:
        assert parts.speed == pytest.approx(whole.speed, abs=1e-6)
        assert (parts.angle - whole.angle + 180) % 360 == pytest.approx(180, abs=0.2)


def test_the_angle_is_the_integral_of_the_speed() -> None:
    one = motor(Drive.DUTY, 0.3, speed=10.0)
    turned, steps = 0.0, 4000
    for step in range(1, steps + 1):
        before, angle = one.rpm, one.angle
        one.advance(step / steps)
        turned += (one.angle - angle) % 360
        assert (one.angle - angle) % 360 == pytest.approx((before + one.rpm) / 2 * 6 / steps, abs=0.01)
    assert turned > 360 * 10


@given(st.floats(0.02, 1), st.floats(0.02, 1), st.floats(30, 50))
def test_more_throttle_or_voltage_is_more_speed_current_and_thrust(one: float, other: float, voltage: float) -> None:
    low, high = sorted((one, other))
    slow, fast = motor(set_point=low, voltage=voltage), motor(set_point=high, voltage=voltage)
    for each in (slow, fast):
        each.advance(5)
    assert slow.speed <= fast.speed
    assert slow.current <= fast.current
    assert slow.thrust <= fast.thrust
    weak = motor(set_point=high, voltage=voltage - 5)
    weak.advance(5)
    assert weak.speed < fast.speed


@given(st.floats(0.05, 1), st.floats(30, 50))
def test_no_energy_comes_from_nowhere(duty: float, voltage: float) -> None:
    """What goes in is what the propeller takes and what heats: the rest is small."""
    one = motor(set_point=duty, voltage=voltage)
    one.advance(5)
    shaft = 2.8e-5 * one.speed**3
    copper = 0.06 * one.winding_current**2
    assert one.current * voltage == pytest.approx(shaft + copper + 0.06 * voltage, rel=1e-3)


def test_acceleration_costs_current_and_braking_gives_none_back() -> None:
    one = motor(set_point=0.3)
    one.advance(2)
    steady = one.current
    one.set_point = 0.6
    one.advance(2.01)
    rising = one.current
    one.advance(4)
    assert rising > one.current > steady
    one.set_point = 0.2
    one.advance(4.01)
    assert 0 < one.current < 0.1


def test_a_motor_without_torque_runs_out_and_stops() -> None:
    one = motor(Drive.FREE, 0.0, speed=300.0)
    speeds = []
    for step in range(1, 400):
        one.advance(step / 100)
        speeds.append(one.speed)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[99] * RPM < 500 < speeds[19] * RPM
    assert one.speed == 0.0


def test_heat_follows_the_losses_and_the_ambient() -> None:
    warm, idle, faulty = motor(set_point=0.6), motor(Drive.FREE, 0.0), motor(set_point=0.6, heat=200.0)
    temperatures = []
    for second in range(1, 1200):
        for one in (warm, idle, faulty):
            one.advance(second)
        temperatures.append(warm.temperature)
    assert temperatures == sorted(temperatures)
    assert 40 < warm.temperature < 90
    assert faulty.temperature > 110
    assert idle.temperature == pytest.approx(20 + 4.0 * 0.06 * 48, abs=1)
    warm.drive = Drive.FREE
    warm.advance(1210)
    assert warm.temperature < temperatures[-1]


def test_a_blocked_rotor_stands_and_draws_current() -> None:
    one = motor(set_point=0.5)
    one.advance(2)
    free = one.winding_current
    one.blocked = True
    one.advance(2.5)
    assert one.speed == 0
    assert one.winding_current > 2 * free
    one.blocked = False
    one.advance(4)
    assert one.speed > 200


def test_the_pack_sags_with_the_current_and_runs_empty() -> None:
    pack = Pack(capacity=3600.0, resistance=0.02)
    fresh = pack.voltage
    assert fresh == pytest.approx(12 * 4.18)
    pack.advance(1.0, 100.0)
    assert pack.sag == pytest.approx(2.0)
    assert pack.charge == pytest.approx(1 - 100 / 3600)
    loaded = pack.voltage
    pack.advance(1.0, 0.0)
    assert loaded < pack.voltage < fresh
    voltages = []
    for _ in range(50):
        pack.advance(1.0, 100.0)
        voltages.append(pack.voltage)
    assert voltages == sorted(voltages, reverse=True)
    assert pack.charge == 0
    assert pack.open_voltage == pytest.approx(12 * 3.2)


def test_the_order_of_operating_modes() -> None:
    """4.4.3: soft start, operating, coast-down, idle; the throttle of a soft start rises slowly."""
    one, operation = motor(Drive.FREE, 0.0), Operation()
    modes, duties = [operation.mode], []
    for step in range(1, 500):
        one.advance(step / 100)
        operation.follow(0.5 if 50 <= step < 300 else 0.0, one, 0.01)
        duties.append(operation.duty)
        if operation.mode != modes[-1]:
            modes.append(operation.mode)
    assert modes == [1, IDLE, SOFT_START, OPERATING, COAST_DOWN, IDLE]
    assert max(after - before for before, after in pairwise(duties)) < 0.01
    assert max(duties) == 0.5


@pytest.mark.parametrize("mode", MODES)
def test_every_control_mode_on_a_bench(mode: int) -> None:
    """4.4.4 table 4 no 7."""
    one, order = motor(Drive.FREE, 0.0, angle=100.0, zero=10.0), MotorControl()
    if mode == control.BRAKE:
        one.speed = 100.0
    set_point = {control.POSITION: 900, control.REVERSE_POSITION: 900, control.CURRENT: 50}.get(mode, 300)
    order.take(mode, set_point, one)
    assert order.active == (mode != control.QUERY)
    for step in range(1, 300):
        if order.active:
            order.drive(one)
        one.advance(step / 100)
    turning = {0xEE: 90, 0x22: -90, 0x33: 300, 0x3A: -300}
    if mode in turning:
        assert one.rpm == pytest.approx(turning[mode], abs=1)
    elif mode in {0x55, 0x44}:
        assert one.rpm > 50
    elif mode in {0x5A, 0x4A}:
        assert one.rpm < -50
    else:
        assert one.rpm == pytest.approx(0, abs=1)
    where = {0x11: 90.0, 0x1A: 270.0, 0x88: 90.0}.get(mode)
    if where is not None:
        assert one.position == pytest.approx(where, abs=0.2)


@pytest.mark.parametrize("mode", sorted(LIMITS))
def test_a_set_point_beyond_its_range_is_refused(mode: int) -> None:
    order = MotorControl()
    order.take(mode, LIMITS[mode] + 1, motor())
    assert not order.active
    order.take(mode, LIMITS[mode], motor())
    assert order.active


def test_an_unknown_control_mode_is_refused() -> None:
    order = MotorControl()
    for mode in set(range(256)) - set(MODES):
        order.take(mode, random.randrange(3600), motor())
    assert not order.active
