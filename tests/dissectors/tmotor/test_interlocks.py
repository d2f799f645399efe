"""PUSH-305 and TYP-210: what is asked of an ESC whose motor turns, and what may be asked of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.judged import judge, proved
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture, motor

if TYPE_CHECKING:
    from kit.judged import Said

RULES = ("PUSH-305", "TYP-210")
STEPS = pytest.mark.parametrize("step", [None, 1, 7])
GROUND = 126
NO_CHANGE = {
    name: 0xFFFF if code.startswith("H") else 0xFF
    for name, _, code in (field.partition(":") for field in encode.PACKETS["PUSHSCI.FocParameters"][1].split())
}
OPEN = {
    field.partition(":")[0]: -1 if ":i" in field else (1 << int(field.partition(":u")[2])) - 1
    for field in encode.TYPES["ParamCfg"].layout.split()
}
UUID = 0xA1B2C3D4


def report(at: float, index: int = 0, rpm: int = 3012) -> Planned:
    return at, 11 + index, "ESCStatus", TURNING | {"esc_index": index, "rpm": rpm}


def asked(at: float, name: str, unit: int = 0xA1, **values: int) -> Planned:
    return at, GROUND, "PUSHSCI", encode.packet(f"PUSHSCI.{name}", 0, unit, **values)


def control(at: float, mode: int, unit: int = 0xA1) -> Planned:
    return asked(at, "OutputControl", unit, control_mode=mode)


def foc(at: float, unit: int = 0xA1, **values: int) -> Planned:
    return asked(at, "FocParameters", unit, **(NO_CHANGE | values))


def config(at: float, **values: int) -> Planned:
    return at, GROUND, "ParamCfg", OPEN | {"esc_save_option": 1} | values


def parameters(at: float, index: int, uuid: int) -> Planned:
    names = [field.partition(":")[0] for field in encode.TYPES["ParamGet"].layout.split()]
    return at, 11 + index, "ParamGet", dict.fromkeys(names, 0) | {"esc_index": index, "esc_uuid": uuid, "rsvd": []}


def texts(*sent: Planned, step: int | None = None) -> list[str]:
    found: list[Said] = judge(capture([*sent, report(9000)]), RULES, step)
    assert all((one.severity, one.node) == ("warning", GROUND) for one in found)
    assert all(one.rule == RULES[one.type == "ParamCfg"] for one in found)
    return [one.text for one in found]


REQUESTS: list[tuple[Planned, str]] = [
    (asked(100, "SetZero"), "set zero (0x08) to unit 1"),
    (foc(100, rotation_direction=1), "FOC parameters (0x1E) to unit 1"),
    (foc(100, throttle_priority=0x0100), "FOC parameters (0x1E) to unit 1"),
    (foc(100, bus_rate=2, save_option=0), "FOC parameters (0x1E) to unit 1"),
    (foc(100, save_option=1), "FOC parameters (0x1E) with permanent save to unit 1"),
    (control(100, 0x88), "lock (mode 0x88) to unit 1"),
    (control(100, 0x66), "free (mode 0x66) to unit 1"),
    (config(100, esc_index=0), "ParamCfg with permanent save to index 0"),
    (config(100, esc_index=0, esc_uuid=UUID), "ParamCfg with permanent save to uuid A1B2C3D4"),
    (config(100), "ParamCfg with permanent save to all ESCs"),
]


@STEPS
@pytest.mark.parametrize(("request_", "what"), REQUESTS)
@pytest.mark.parametrize("rpm", [3012, -3012, 100])
def test_what_is_asked_while_the_motor_turns(request_: Planned, what: str, rpm: int, step: int | None) -> None:
    assert texts(report(60, rpm=rpm), request_, step=step) == [f"node 126 sent {what}, ch1 turned at {rpm} rpm"]


@pytest.mark.parametrize(("request_", "what"), REQUESTS)
def test_what_is_asked_while_it_stands(request_: Planned, what: str) -> None:
    del what
    assert texts(report(0, rpm=4000), report(60, rpm=0), report(61, 1, rpm=99), request_) == []
    assert texts(request_) == []  # nobody knows
    assert texts(report(-901, rpm=4000), request_) == []  # it is long ago
    assert texts(report(101, rpm=4000), request_) == []  # it starts afterwards


@pytest.mark.parametrize(
    "request_",
    [
        asked(100, "FocQuery"), control(100, 0x00), control(100, 0x33), control(100, 0xEE), foc(100),
        foc(100, save_option=0), config(100, esc_index=0, esc_save_option=0, esc_led_mode=7),
        config(100, esc_save_option=0xFF), config(100, esc_uuid=0x12345678),  # nobody knows whose that is
    ],
)  # fmt: skip
def test_what_may_be_asked_at_any_time(request_: Planned) -> None:
    assert texts(report(60), request_) == []


@STEPS
def test_only_the_motor_that_is_addressed_counts(step: int | None) -> None:
    """One turns, two stand, a fourth was never heard."""
    before = [report(50), report(52, 1, rpm=0), report(54, 2, rpm=3), parameters(60, 2, UUID)]
    for other in (
        control(100, 0x88, 0xA3), control(100, 0x88, 0xA4), asked(100, "SetZero", 0xA2), config(100, esc_index=2),
        config(100, esc_index=0, esc_uuid=UUID),  # the UUID is what counts (4.4.2)
    ):  # fmt: skip
        assert texts(*before, other, step=step) == []
    (one,) = texts(*before, control(100, 0x88, 0xFF), step=step)
    assert one == "node 126 sent lock (mode 0x88) to all units, ch1 turned at 3012 rpm"


def test_a_unit_is_whoever_sends_its_packets() -> None:
    """Unit 5 is the ESC with index 0; the one with index 4 stands."""
    status = (40, 11, "PUSHCAN", motor(0, 0xA5, speed=2900))
    assert texts(report(50, 4, rpm=0), status, control(100, 0x88, 0xA5)) == [
        "node 126 sent lock (mode 0x88) to unit 5, unit 5 turned at 2900 rpm"
    ]
    assert texts(report(50, 4, rpm=0), status, report(60), control(100, 0x88, 0xA5)) == [
        "node 126 sent lock (mode 0x88) to unit 5, ch1 turned at 3012 rpm"
    ]
    stands = report(60, rpm=0)  # what was said last counts, whichever message said it
    assert texts(report(50, 4), status, stands, control(100, 0x88, 0xA5)) == []
    assert texts(stands, (70, 11, "PUSHCAN", motor(0, speed=2900)), control(100, 0x88)) == [
        "node 126 sent lock (mode 0x88) to unit 1, ch1 turned at 2900 rpm"
    ]


def test_many_motors_are_counted() -> None:
    reports = [report(50 + k, k, rpm=3000 + k) for k in range(7)]
    (one,) = texts(*reports, config(100))
    assert one.endswith("ch3 turned at 3002 rpm, ch4 turned at 3003 rpm, and 3 more turned")


def test_a_broken_packet_asks_nothing() -> None:
    at, node, name, data = control(100, 0x88)
    assert texts(report(60), (at, node, name, data[:-1] + bytes([data[-1] ^ 1]))) == []


@pytest.mark.slow
@pytest.mark.parametrize("fault", [*(f"PUSH-305@4:what={what}" for what in ("lock", "free", "zero", "foc")), "TYP-210"])
def test_a_fault_is_found_where_the_witness_finds_it(fault: str) -> None:
    assert [one.count for one in proved(fault[:8].rstrip("@"), flight(fault, seconds=8))] == [1]


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench", "startup"])
@pytest.mark.parametrize("escs", [1, 4, 8])
def test_a_clean_flight_has_none(plan: str, escs: int) -> None:
    assert judge(flight(flight=plan, seconds=20, escs=escs), RULES) == []
