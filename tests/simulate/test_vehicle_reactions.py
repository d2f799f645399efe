"""How the vehicle takes what goes wrong with it or is done to it, which faults and scenarios rely on."""

from __future__ import annotations

import struct
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import Flown, end, simulation, status_bits

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic import packets

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.tmotor.traffic import SimulatedVehicle

LOSS, ABNORMAL, OVER_TEMPERATURE, STALL = 1 << 3, 1 << 4, 1 << 5, 1 << 7
AT = 4 * SECOND


def after(do: Callable[[SimulatedVehicle], object], t: int = AT, seconds: float = 6, **settings: Any) -> Flown:
    """A flight in which something happens at `t`."""
    run = simulation(seconds, **settings)
    run.world.at(t, lambda: do(run.vehicle))
    return Flown(run)


def reports(flight: Flown, node: int, start: float, stop: float) -> list[dict[str, Any]]:
    """ESCStatus between two times in s, with their bits."""
    found = []
    for one in flight.of("ESCStatus", node):
        if start * SECOND <= one.t < stop * SECOND:
            bits, mode, encoder = status_bits(one)
            found.append({**one.values, "bits": bits, "mode": mode, "encoder": encoder})
    return found


def test_without_commands_the_throttle_is_held_and_then_zero() -> None:
    """4.4.1 explanation 2: a timeout of 100 ms, then throttle loss (bit 3); it ends with the next command."""

    def silence(vehicle: SimulatedVehicle) -> None:
        vehicle.commanding = False
        vehicle.world.at(AT + SECOND, lambda: setattr(vehicle, "commanding", True))

    flight = after(silence)
    assert not [one for one in flight.of("RawCommand") if AT < one.t < AT + SECOND]
    for node in flight.escs:
        held = reports(flight, node, 4.0, 4.09)
        assert all(row["bits"] == 0 and row["power_rating_pct"] > 30 for row in held)
        lost = reports(flight, node, 4.13, 5.0)
        assert {row["bits"] for row in lost} == {LOSS}
        assert {row["power_rating_pct"] for row in lost} == {0}
        assert {row["mode"] for row in lost} == {5}
        assert abs(lost[-1]["rpm"]) < 500
        again = reports(flight, node, 5.05, 6)
        assert {row["bits"] for row in again} == {0}
        assert again[-1]["mode"] in {3, 4}


def test_a_negative_command_is_abnormal() -> None:
    """4.4.1 explanation 2: bit 4 at once, the last valid throttle for 100 ms, then none."""

    def turn_back(vehicle: SimulatedVehicle) -> None:
        vehicle.throttle_hook = lambda cmd: [cmd[0], -1000, *cmd[2:]]

    flight = after(turn_back)
    assert {one.values["cmd"][1] for one in flight.of("RawCommand") if one.t > AT} == {-1000}
    rows = reports(flight, 12, 4.02, 6)
    assert {row["bits"] for row in rows} == {ABNORMAL}
    assert rows[0]["power_rating_pct"] > 30
    assert {row["power_rating_pct"] for row in rows[4:]} == {0}
    assert {row["bits"] for row in reports(flight, 11, 4, 6)} == {0}


def test_a_channel_that_is_left_out_is_lost() -> None:
    flight = after(lambda vehicle: setattr(vehicle, "throttle_hook", lambda cmd: cmd[:-1]))
    assert {row["bits"] for row in reports(flight, 14, 4.15, 6)} == {LOSS}
    assert {row["bits"] for row in reports(flight, 13, 4.15, 6)} == {0}


def test_a_blocked_rotor_is_a_stall() -> None:
    flight = after(lambda vehicle: setattr(vehicle.escs[0].motor, "blocked", True))
    rows = reports(flight, 11, 4.3, 6)
    assert {(row["bits"], row["rpm"]) for row in rows} == {(STALL, 0)}
    faults = {values["fault"] for one, values in flight.packets("MotorStatus", 11) if one.t > 4.3 * SECOND}
    assert faults == {STALL}


def test_an_esc_with_losses_overheats_over_seconds() -> None:
    flight = after(lambda vehicle: setattr(vehicle.escs[2], "heat", 2500.0), t=3 * SECOND, seconds=7)
    rows = reports(flight, 13, 3, 7)
    temperatures = [row["temperature"] for row in rows]
    assert temperatures[0] < 30
    assert temperatures[-1] > 110
    assert max(after - before for before, after in pairwise(temperatures)) < 3
    assert all(
        (row["bits"] == OVER_TEMPERATURE) == (row["temperature"] > 110)
        for row in rows
        if abs(row["temperature"] - 110) > 1
    )
    assert reports(flight, 12, 6, 7)[-1]["temperature"] < 30


def test_an_esc_in_error_lets_its_motor_run_out() -> None:
    flight = after(lambda vehicle: setattr(vehicle.escs[1], "mode", 6))
    rows = reports(flight, 12, 4, 6)
    assert {row["mode"] for row in rows} == {6}
    assert rows[-1]["rpm"] == 0
    assert {values["system_status"] for one, values in flight.packets("MotorStatus", 12) if one.t > AT} == {0xCC}


def test_a_forced_mode_and_forced_bits_are_reported() -> None:
    def force(vehicle: SimulatedVehicle) -> None:
        vehicle.escs[0].mode, vehicle.escs[0].fault_bits = 9, 0x801

    flight = after(force)
    assert {(row["mode"], row["bits"]) for row in reports(flight, 11, 4, 6)} == {(9, 0x801)}


def test_kelvin_and_the_printed_float16_encoder() -> None:
    def change(vehicle: SimulatedVehicle) -> None:
        vehicle.escs[0].kelvin = vehicle.escs[1].coarse = True

    flight = after(change)
    assert all(row["temperature"] > 290 for row in reports(flight, 11, 4, 6))
    for row in reports(flight, 12, 4, 6):
        for name in ("voltage", "current", "temperature"):
            (code,) = struct.unpack("<H", struct.pack("<e", row[name]))
            assert code & 7 == 0


@pytest.mark.slow
def test_an_esc_with_the_other_byte_order() -> None:
    flight = after(lambda vehicle: setattr(vehicle.escs[0], "big_endian", True))
    status = {one.t: one.values for one in flight.of("ESCStatus", 11)}
    for one in flight.of("PUSHCAN", 11):
        name, values = packets.split(one.values["data"], big_endian=one.t > AT)
        if name == "MotorStatus":
            assert values["speed"] == status[one.t]["rpm"]
        assert packets.sound(one.values["data"])


def test_the_checksum_range_of_a_setting() -> None:
    """4.4.4 table 2 no 31, as printed; the ESC takes it."""

    def push(vehicle: SimulatedVehicle) -> None:
        vehicle.escs[0].sum_end = 28
        vehicle.push("FocParameters", 0xA1, report_rate=300)

    flight = after(push)
    data = next(one.values["data"] for one, values in flight.packets("FocParameters") if values["report_rate"] == 300)
    assert data[30] == sum(data[:28]) & 0xFF != sum(data[:30]) & 0xFF
    answered = [values["report_rate"] for one, values in flight.packets("FocFeedback", 11) if one.t > AT]
    assert set(answered) == {300}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("rate", [50, 0])
def test_a_report_rate_that_is_set_is_kept(rate: int) -> None:
    flight = after(lambda vehicle: vehicle.configure(1, esc_fdb_rate=rate))
    times = [one.t for one in flight.of("ESCStatus", 12) if one.t > AT + 50 * MILLISECOND]
    if rate:
        assert median(b - a for a, b in pairwise(times)) == pytest.approx(SECOND / rate, rel=1e-3)
    else:
        assert not times
        assert len([one for one in flight.of("PUSHCAN", 12) if one.t > AT]) > 5
    assert {one.values["esc_fdb_rate"] for one in flight.of("ParamGet", 12) if one.t > AT} == {rate}


@pytest.mark.slow
def test_a_direction_is_taken_over_once_the_motor_stands() -> None:
    flight = after(lambda vehicle: vehicle.configure(0, esc_rotate_dir=1), t=SECOND)
    assert {one.values["esc_rotate_dir"] for one in flight.of("ParamGet", 11) if one.t > SECOND} == {1}
    assert min(row["rpm"] for row in reports(flight, 11, 3, 6)) < -1000
    flying = after(lambda vehicle: vehicle.configure(0, esc_rotate_dir=1))
    assert min(row["rpm"] for row in reports(flying, 11, 4, 6)) > 1000


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("field", "value"),
    [("esc_timing", 35), ("esc_signal_priority", 3), ("esc_can_rate", 9), ("esc_fdb_rate", 401), ("esc_id_set", 200)],
)
def test_a_setting_out_of_range_is_refused(field: str, value: int) -> None:
    flight = after(lambda vehicle: vehicle.configure(2, **{field: value}))
    before, *_, last = flight.of("ParamGet", 13)
    name = {"esc_id_set": "esc_id_req"}.get(field, field)
    assert last.values[name] == before.values[name] != value


@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    "change",
    [{"checksum": 1}, {"length": 9, "resum": True}, {"frame_id": 0x44}, {"header": b"\xec\x97"}, {"unit_id": 0xA7}],
)
def test_a_packet_that_is_wrong_is_passed_over(change: dict[str, Any]) -> None:
    def send(vehicle: SimulatedVehicle) -> None:
        data = packets.change(packets.packet("FocQuery", 0, 0xA1), **change)
        vehicle.ground.send("PUSHSCI", {"data_sequence": 0, "data": data})

    damaged = after(send)
    whole = after(lambda vehicle: vehicle.push("FocQuery", 0xA1))
    answers = [[one.t for one, _ in flight.packets("FocFeedback", 11)] for flight in (damaged, whole)]
    assert [sum(AT < t < AT + 20 * MILLISECOND for t in found) for found in answers] == [0, 1]


@pytest.mark.slow
def test_a_control_mode_waits_for_zero_throttle() -> None:
    flight = after(lambda vehicle: vehicle.push("OutputControl", 0xA1, control_mode=0xEE))
    assert {row["mode"] for row in reports(flight, 11, 4, 6)} == {4}
    ground = after(lambda vehicle: vehicle.push("OutputControl", 0xA1, control_mode=0xEE), t=SECOND, seconds=10)
    assert {row["mode"] for row in reports(ground, 11, 1.02, 1.09)} == {7}


def test_a_restart() -> None:
    flight = after(lambda vehicle: vehicle.escs[0].restart())
    silent = [one for one in flight.sent if one.node == 11 and AT + 5 * MILLISECOND < one.t < AT + 290 * MILLISECOND]
    assert not silent
    first = next(one for one in flight.of("ESCStatus", 11) if one.t > AT + 200 * MILLISECOND)
    assert (first.transfer_id, status_bits(first)[1]) == (0, 1)
    pushed, values = next(
        (one, values) for one, values in flight.packets("MotorStatus", 11) if one.t > AT + SECOND // 4
    )
    assert (pushed.values["data_sequence"], values["frame_count"]) == (0, 0)
    counts = [values["power_on_count"] for _, values in flight.packets("MotorStatus", 11)]
    assert counts[-1] == counts[0] + 1


def test_counts_and_clocks_can_be_moved() -> None:
    def move(vehicle: SimulatedVehicle) -> None:
        vehicle.escs[0].shift_frame_count(7)
        vehicle.escs[0].runtime_offset -= 1000
        vehicle.escs[0].telemetry = False

    flight = after(move)
    rows = [(one.t, values) for one, values in flight.packets("MotorStatus", 11)]
    (before, *_), (behind, *_) = [values for t, values in rows if t < AT][-1:], [values for t, values in rows if t > AT]
    assert behind["runtime"] < before["runtime"] - 900
    counts = [packets.split(one.values["data"])[1]["frame_count"] for one in flight.of("PUSHCAN", 11)]
    assert sorted({(b - a) % 256 for a, b in pairwise(counts)}) == [1, 8]
    assert not [one for one in flight.of("ESCStatus", 11) if one.t > AT + 5 * MILLISECOND]
    assert len(rows) > 20


@pytest.mark.slow
def test_the_ground_station_asks_an_esc_that_it_does_not_know_by_its_index() -> None:
    flight = after(lambda vehicle: vehicle.configure(3), t=50 * MILLISECOND, seconds=4)
    asked = flight.of("ParamCfg")[0]
    assert (asked.values["esc_index"], asked.values["esc_uuid"]) == (3, 0xFFFF_FFFF)
    assert [one.node for one in flight.of("ParamGet") if one.t < end(asked) + 20 * MILLISECOND] == [14]


@pytest.mark.slow
def test_the_last_command_can_be_asked() -> None:
    run = simulation(5)
    seen = []
    run.world.at(4 * SECOND + 1_000_000, lambda: seen.extend(run.vehicle.command(index) for index in range(4)))
    flight = Flown(run)
    assert seen == next(one.values["cmd"] for one in reversed(flight.of("RawCommand")) if one.t <= 4 * SECOND)
