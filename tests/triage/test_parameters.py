"""Events of parameters: set, saved, reported otherwise, and counters of power-ups."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from kit import traffic
from kit.encode import packet, transfer
from kit.flight import START, Vehicle
from kit.traffic import MS, capture, log, motor
from kit.traffic import of_kinds as kinds

if TYPE_CHECKING:
    from collections.abc import Callable

    Told = Callable[..., tuple[list[dict[str, Any]], list[dict[str, Any]]]]

SENT = traffic.START // MS  # ms, of what is sent here by itself
FLOWN = START // MS
GET_SET, OPCODE = "uavcan.protocol.param.GetSet", "uavcan.protocol.param.ExecuteOpcode"


def said(events: list[dict[str, Any]], *wanted: str, start: int = 0) -> list[tuple[int, int, int, str]]:
    """Who says what, and between which times in ms since the start of the capture."""
    found = kinds(events, *wanted)
    return [(one["t"] // MS - start, one["t_end"] // MS - start, one["node"], one["text"]) for one in found]


# ---- a vendor's own commands and reports


def test_what_is_set_by_whom_and_whether_it_is_kept(told: Told) -> None:
    vehicle = Vehicle()
    vehicle.configure(0)  # asks
    vehicle.configure(100, esc_index=3, esc_uuid=0xA0, esc_fdb_rate=50, esc_can_rate=1, esc_save_option=1)
    vehicle.configure(200, esc_index=0, esc_led_mode=0x197, esc_save_option=0)
    vehicle.configure(300, esc_timing=20)
    events = told(vehicle.finish().encode())[1]
    led = "esc_led_mode.enable 7, esc_led_mode.flash no, esc_led_mode.frequency 2.5 Hz"
    assert said(events, "parameter", start=FLOWN) == [
        (100, 100, 126, "sets esc_can_rate 500 kbps, esc_fdb_rate 50 Hz (esc_index 3, esc_uuid 0xA0, permanent)"),
        (200, 200, 126, f"sets {led} (esc_index 0, esc_uuid all, temporary)"),
        (300, 300, 126, "sets esc_timing 20 deg (esc_index all, esc_uuid all)"),
    ]  # fmt: skip
    first = kinds(events, "parameter")[0]
    assert json.loads(first["values"]) == {"esc_can_rate": 1, "esc_fdb_rate": 50}
    assert (first["type"], first["clause"], first["frame"]) == ("ParamCfg", "4.4.2", 5)


def test_settings_in_packets(told: Told) -> None:
    names = "over_voltage_threshold over_current_threshold over_temperature_threshold beep_volume acceleration_limit"
    open_ = dict.fromkeys(f"{names} deceleration_limit rotation_direction throttle_priority led".split(), 0xFFFF)
    open_ |= {"esc_id": 0xFFFF, "bus_rate": 0xFF, "report_rate": 0xFFFF, "save_option": 0xFF}
    rows = [open_, open_ | {"report_rate": 100, "save_option": 0, "throttle_priority": 1}]
    text = capture(
        (50.0 * k, 125, "PUSHSCI", packet("PUSHSCI.FocParameters", k, 0xA2, **one)) for k, one in enumerate(rows)
    )
    ((*_, set_),) = said(told(text.encode())[1], "parameter")
    assert set_ == (
        "sets throttle_priority.priority CAN, throttle_priority.position_loop off, report_rate 100 Hz "
        "(unit 2, temporary)"
    )


def test_commands_that_go_on_and_on_set_nothing(told: Told) -> None:
    text = capture(
        (50.0 * k, 125, "PUSHSCI", packet("PUSHSCI.OutputControl", k, 0xA2, control_mode=0x33, set_point=k))
        for k in range(9)
    )
    assert said(told(text.encode())[1], "parameter", "save") == []


def test_what_a_device_reports_otherwise_than_before(told: Told) -> None:
    vehicle = Vehicle()
    for at, changed in (
        (0, {}),
        (1000, {}),
        (2000, {"esc_timing": 20, "esc_fdb_rate": 50}),
        (3000, {"esc_timing": 20}),
    ):
        vehicle.parameters(at, **changed)
        vehicle.parameters(at + 10, 12)  # always the same
    events = told(vehicle.finish().encode())[1]
    assert said(events, "parameter", start=FLOWN) == [
        (1000, 2000, 11, "reports esc_timing 15 deg -> 20 deg, esc_fdb_rate 30 Hz -> 50 Hz"),
        (2000, 3000, 11, "reports esc_fdb_rate 50 Hz -> 30 Hz"),
    ]
    assert json.loads(kinds(events, "parameter")[0]["values"]) == {"esc_timing": 20, "esc_fdb_rate": 50}


def test_an_exchanged_device_is_told_by_its_identity(told: Told) -> None:
    vehicle = Vehicle()
    vehicle.parameters(0, esc_startup_times=3)
    vehicle.parameters(9000, esc_uuid=0xBEEF, esc_startup_times=5)
    events = told(vehicle.finish().encode())[1]
    assert said(events, "parameter", start=FLOWN) == [(0, 9000, 11, "reports esc_uuid 0xA0 -> 0xBEEF")]
    assert said(events, "power-up") == []  # counters of two devices


# ---- power-ups


@pytest.mark.parametrize(
    ("counts", "text"),
    [
        ((3, 3, 4), "was powered up again: esc_startup_times 3 -> 4"),
        ((3, 3, 6), "was powered up 3 times: esc_startup_times 3 -> 6"),
        ((3, 3, 3), None),
        ((3, 4, 3), "was powered up again: esc_startup_times 3 -> 4"),
        ((3, 3, 900), None),  # nobody is powered up so often in a second
    ],
)
def test_a_counter_of_power_ups(told: Told, counts: tuple[int, ...], text: str | None) -> None:
    vehicle = Vehicle()
    for k, count in enumerate(counts):
        vehicle.parameters(2000 * k, esc_startup_times=count)
    events = told(vehicle.finish().encode())[1]
    assert [text for *_, text in said(events, "power-up")] == [text] * (text is not None)
    assert said(events, "parameter", "restart") == []


def test_a_counter_in_reports_that_come_all_the_time(told: Told) -> None:
    rows = [(20.0 * k + 3000.0 * (k >= 5), 10, "PUSHCAN", motor(k, power_on_count=7 + (k >= 5))) for k in range(10)]
    assert said(told(capture(rows).encode())[1], "power-up", start=SENT) == [
        (80, 3100, 10, "was powered up again: power_on_count 7 -> 8")
    ]


# ---- the standard's services


def ask(t: int, name: str, tid: int, **value: Any) -> Any:
    fields = {"index": 0, "value": value or {"empty": {}}, "name": name.encode()}
    return t, transfer(f"{GET_SET}.Request", fields, 127, tid, dst=42)


def answer(t: int, name: str, tid: int, **value: Any) -> Any:
    empty = {"empty": {}}
    fields = {"value": value, "default_value": empty, "max_value": empty, "min_value": empty, "name": name.encode()}
    return t, transfer(f"{GET_SET}.Response", fields, 42, tid, dst=127)


def test_parameters_of_the_standard(told: Told) -> None:
    sent = [
        ask(0, "RATE", 0), answer(20, "RATE", 0, integer_value=50),
        ask(1000, "RATE", 1, integer_value=10), answer(1020, "RATE", 1, integer_value=10),
        ask(2000, "NAME", 2, string_value=b"\x1b[2J"), answer(2020, "NAME", 2, string_value=b"\x1b[2J"),
        ask(3000, "RATE", 3), answer(3020, "RATE", 3, integer_value=10),
    ]  # fmt: skip
    events = told(log(*sent).encode())[1]
    assert said(events, "parameter", start=SENT) == [
        (1000, 1000, 127, "sets RATE of node 42 to 10"),
        (20, 1020, 42, "reports RATE 50 -> 10"),
        (2000, 2000, 127, "sets NAME of node 42 to \x1b[2J"),
    ]


def test_parameters_are_saved_or_erased(told: Told) -> None:
    def asked(t: int, code: int, tid: int) -> Any:
        return t, transfer(f"{OPCODE}.Request", {"opcode": code, "argument": 0}, 127, tid, dst=42)

    def done(t: int, ok: int, tid: int) -> Any:
        return t, transfer(f"{OPCODE}.Response", {"argument": 0, "ok": ok}, 42, tid, dst=127)

    events = told(log(asked(0, 0, 0), done(10, 1, 0), asked(500, 1, 1), done(520, 0, 1), asked(900, 7, 2)).encode())[1]
    assert said(events, "save", start=SENT) == [
        (0, 0, 127, "asks node 42: save its parameters"), (10, 10, 42, "save its parameters: done"),
        (500, 500, 127, "asks node 42: erase its parameters"), (520, 520, 42, "erase its parameters: not done"),
        (900, 900, 127, "asks node 42: opcode 7 its parameters"),
    ]  # fmt: skip


def test_any_cut_tells_the_same(told: Told) -> None:
    vehicle = Vehicle()
    for k in range(6):
        vehicle.configure(1000 * k, esc_timing=10 + k)
        vehicle.parameters(1000 * k + 20, esc_timing=10 + k, esc_startup_times=3 + k // 2)
    data = vehicle.finish().encode()
    whole = told(data)[1]
    assert len(kinds(whole, "parameter", "power-up")) == 6 + 5 + 2
    assert told(*(data[k : k + 97] for k in range(0, len(data), 97)))[1] == whole
