"""PUSH-101, -302, -401 to -408, -501 and -502: values of packets, against the witness and by hand."""

from __future__ import annotations

from typing import Any

import pytest
from kit import VECTORS, encode
from kit.judged import judge, proved, said
from kit.simulated import flight
from kit.traffic import MOTOR, Planned, Traffic, capture, motor, motors

RULES = (
    "PUSH-101", "PUSH-302", "PUSH-401", "PUSH-403", "PUSH-404", "PUSH-405", "PUSH-406", "PUSH-407", "PUSH-408",
    "PUSH-410", "PUSH-501", "PUSH-502",
)  # fmt: skip
VERSIONS = {"hardware_version": b"HW 1.2", "software_version": b"V2.2.3"}


def sent(name: str, **values: Any) -> str:
    """One packet of a name."""
    return capture([(0, 10, name.partition(".")[0], encode.packet(name, 0, 0xA1, **values))])


def texts(rule: str, text: str) -> list[tuple[str, str]]:
    return [(one.severity, one.text) for one in said(rule, text)]


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_a_fault_is_found_where_the_witness_finds_it(rule: str) -> None:
    assert [one.count for one in proved(rule, flight(f"{rule}@4", seconds=10))] == [1]


@pytest.mark.slow
def test_a_clean_flight_has_none() -> None:
    assert judge(flight(seconds=10), RULES) == []


def test_the_block_of_the_vectors() -> None:
    text = (VECTORS / "violations.log").read_text(encoding="ascii")
    assert [(one.rule, one.severity, one.first, one.text) for one in judge(text, RULES) if one.first > 103] == [
        ("PUSH-401", "warning", 117, "system status 0x22, unknown; 50.0 V, 10.0 A, -5 degC, 3000 rpm"),
        ("PUSH-403", "warning", 117, "700.0 us"),
        ("PUSH-404", "warning", 117, "100.4 %"),
        ("PUSH-405", "note", 117, "65036 read as hundredths of a degree below zero"),
        ("PUSH-406", "note", 117, "motor status 0x01"),
    ]


@pytest.mark.parametrize(
    ("rule", "values", "expected"),
    [
        ("PUSH-401", {"system_status": 0x11}, []),
        (
            "PUSH-401",
            {"system_status": 0xCC},
            [("warning", "system status 0xCC, fault; 48.5 V, 1.2 A, 41 degC, 3011 rpm")],
        ),
        ("PUSH-410", {"fault": 0}, []),
        (
            "PUSH-410",
            {"fault": 0x1020},
            [("warning", "MOS over temperature (0x0020), bit 12 (0x1000); 48.5 V, 1.2 A, 41 degC, 3011 rpm")],
        ),
        ("PUSH-403", {"pwm": 0}, []),
        ("PUSH-403", {"pwm": 10_400}, []),
        ("PUSH-403", {"pwm": 19_500}, []),
        ("PUSH-403", {"pwm": 19_501}, [("note", "1950.1 us")]),
        ("PUSH-403", {"pwm": 8000}, [("note", "800.0 us")]),
        ("PUSH-403", {"pwm": 7999}, [("warning", "799.9 us")]),
        ("PUSH-403", {"pwm": 22_001}, [("warning", "2200.1 us")]),
        ("PUSH-404", {"throttle": 250}, []),
        ("PUSH-404", {"throttle": 251}, [("warning", "100.4 %")]),
        ("PUSH-405", {"temperature": 23_314}, []),
        ("PUSH-405", {"temperature": 23_315}, [("note", "23315 read as hundredths of a kelvin")]),
        ("PUSH-405", {"temperature": 0x7FFF}, [("note", "32767 read as hundredths of a kelvin")]),
        ("PUSH-405", {"temperature": 0xFFFF}, [("note", "65535 read as hundredths of a degree below zero")]),
        ("PUSH-406", {"motor_status": 0}, []),
        ("PUSH-408", {"speed": 32_766, "current": -32_766}, []),
        ("PUSH-408", {"speed": -32_768}, [("note", "speed -32768 rpm")]),
        ("PUSH-408", {"current": -32_767}, [("note", "current -327.67 A")]),
    ],
)
def test_a_status_packet(rule: str, values: dict[str, int], expected: list[tuple[str, str]]) -> None:
    assert texts(rule, sent("PUSHCAN.MotorStatus", **(MOTOR | values))) == expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, []),
        ({"throttle_priority": 0xFFFF, "bus_rate": 0xFF, "report_rate": 0xFFFF, "save_option": 0xFF}, []),
        ({"throttle_priority": 0x0101, "bus_rate": 5, "report_rate": 400, "save_option": 1}, []),
        ({"throttle_priority": 2}, ["throttle priority = 2"]),
        ({"throttle_priority": 0x0300}, ["position loop = 3"]),
        ({"bus_rate": 6, "save_option": 2}, ["bus rate = 6", "save option = 2"]),
        ({"report_rate": 401}, ["report rate = 401"]),
    ],
)
def test_parameters_that_are_set(values: dict[str, int], expected: list[str]) -> None:
    found = texts("PUSH-101", sent("PUSHSCI.FocParameters", **values))
    assert sorted(found) == [("warning", text) for text in expected]


@pytest.mark.parametrize(
    ("mode", "point", "limit"),
    [(0x55, 10_000, 0), (0x55, 10_001, 10_000), (0xBB, 10_001, 10_000), (0x88, 3600, 0), (0x1A, 3601, 3600),
     (0x00, 65_535, 0), (0x66, 65_535, 0), (0x77, 65_535, 0)],
)  # fmt: skip
def test_set_points(mode: int, point: int, limit: int) -> None:
    found = texts("PUSH-302", sent("PUSHSCI.OutputControl", control_mode=mode, set_point=point, reserved=0))
    assert found == [("warning", f"mode 0x{mode:02X}, set point {point}, at most {limit}")] * bool(limit)


@pytest.mark.parametrize(
    ("values", "rule", "expected"),
    [
        ({}, "PUSH-501", []),
        ({"software_version": b"V2\0\xff\xff"}, "PUSH-501", []),
        ({"hardware_version": b" " * 16}, "PUSH-501", []),
        ({"software_version": b"V\xc3\x84"}, "PUSH-501", [("note", "software version: 56 C3 84" + " 00" * 13)]),
        ({"bus_rate": 5, "report_rate": 400, "save_option": 1}, "PUSH-502", []),
        ({"throttle_priority": 1, "position_loop": 1}, "PUSH-502", []),
        ({"throttle_priority": 2}, "PUSH-502", [("warning", "throttle priority = 2")]),
        ({"position_loop": 0x0101}, "PUSH-502", [("warning", "position loop = 257")]),
        ({"save_option": 2}, "PUSH-502", [("note", "save option = 2")]),
        ({"save_option": 3}, "PUSH-502", [("warning", "save option = 3")]),
        ({"bus_rate": 255}, "PUSH-502", [("warning", "bus rate = 255")]),
        ({"report_rate": 401}, "PUSH-502", [("warning", "report rate = 401")]),
    ],
)
def test_feedback(values: dict[str, Any], rule: str, expected: list[tuple[str, str]]) -> None:
    assert texts(rule, sent("PUSHCAN.FocFeedback", **(VERSIONS | values))) == expected


def test_a_packet_that_is_not_sound_has_no_values() -> None:
    packet = bytearray(motor(0, throttle=255))
    packet[-1] ^= 1
    assert said("PUSH-404", capture([(0, 10, "PUSHCAN", bytes(packet))])) == []
    assert said("PUSH-404", capture([(0, 10, "PUSHSCI", motor(0, throttle=255))])) == []


def test_a_finding_for_each_value() -> None:
    text = motors({"motor_status": 1}, {"motor_status": 2}, {"motor_status": 1})
    assert [(one.key, one.count) for one in said("PUSH-406", text)] == [("value=1", 2), ("value=2", 1)]


@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ((3, 100), (3, 100), []),
        ((3, 65_535), (3, 0), []),
        ((3, 65_535), (3, 60), ["runtime 65535, then 60"]),
        ((3, 100), (3, 99), ["runtime 100, then 99"]),
        ((3, 100), (4, 0), []),
        ((3, 100), (2, 101), ["power-on count 3, then 2"]),
        ((65_535, 100), (0, 0), []),
        ((3, 100), (2, 99), ["power-on count 3, then 2", "runtime 100, then 99"]),
    ],
)
def test_lives(before: tuple[int, int], after: tuple[int, int], expected: list[str], step: int | None) -> None:
    values = [{"power_on_count": powered, "runtime": runtime} for powered, runtime in (before, after, after)]
    found = said("PUSH-407", motors(*values), step)
    assert [one.text for one in found] == expected
    assert all(one.count == 1 and one.first == 6 for one in found)


def test_units_and_nodes_live_alone() -> None:
    lives = [(10, 0xA1, 9), (11, 0xA1, 5), (10, 0xA2, 3), (10, 0xA1, 9), (11, 0xA1, 5), (10, 0xA2, 3)]
    sending = [(k * 20.0, node, "PUSHCAN", motor(k, unit, runtime=s)) for k, (node, unit, s) in enumerate(lives)]
    assert said("PUSH-407", capture(sending)) == []


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize(("uptimes", "count"), [((100, 0), 0), ((100, 103), 1), ((0, 3), 1), ((), 1)])
@pytest.mark.parametrize("late", [1500, 2500])
def test_a_restart_excuses_a_runtime(uptimes: tuple[int, ...], count: int, late: int, step: int | None) -> None:
    """The uptime after the packet counts, and so does one between both packets."""
    sending: list[Planned] = [
        (500, 10, "PUSHCAN", motor(0, power_on_count=3, runtime=100)),
        (2000, 10, "PUSHCAN", motor(1, power_on_count=3, runtime=0)),
        (4000, 10, "PUSHCAN", motor(2, power_on_count=3, runtime=2)),
    ]
    status = {"health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}
    for at, uptime in zip((0, late), uptimes, strict=False):
        sending.append((at, 10, "uavcan.protocol.NodeStatus", status | {"uptime_sec": uptime}))
    text = capture(sorted(sending, key=lambda one: one[0]))
    assert len(said("PUSH-407", text, step)) == count


def test_a_set_point_out_of_range_is_told_once() -> None:
    text = sent("PUSHSCI.OutputControl", control_mode=0x33, set_point=12_000)
    assert [one.rule for one in judge(text) if one.severity != "note"] == ["PUSH-302"]


@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize("big", [False, True])
def test_packets_before_the_proof_of_their_byte_order_accuse_nobody(big: bool, step: int | None) -> None:
    """Read the other way round, they show 620 V, and a temperature of 46 K: what is live is taken back."""
    traffic = Traffic()
    for _ in range(12):
        traffic.status(11, error_count=4 << 12)
        traffic.motor(11, big=big)
    assert [one.rule for one in judge(traffic.log, ("PUSH",), step)] == ["PUSH-010"] * big


@pytest.mark.parametrize("step", [None, 1, 7])
def test_packets_that_agree_in_no_byte_order_are_told(step: int | None) -> None:
    traffic = Traffic()
    for _ in range(12):
        traffic.status(11, error_count=4 << 12)
        traffic.motor(11, voltage=2000, speed=500)
    assert {one.text: one.count for one in judge(traffic.log, ("PUSH-409",), step)} == {
        "voltage 20.0, ESCStatus 48.5": 11, "speed 500.0, ESCStatus 3011.0": 11,
    }  # fmt: skip
