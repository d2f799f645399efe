"""Settings of faults of values and lengths; that each fault is in the bytes is for the witness to prove."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.simulated import faulted, word

from analyzer.simulate.faults import catalogue
from dissectors.traffic import Code, Sending

if TYPE_CHECKING:
    from collections.abc import Callable


def field(name: str, value: object) -> Callable[[Sending], bool]:
    return lambda sending: bool(sending.values[name] == value)


def raw(sending: Sending) -> list[int]:
    return [code for code in sending.values.values() if isinstance(code, Code)]


# Settings that an ESC does not take.
REFUSED: dict[str, Callable[[Sending], bool]] = {
    "TYP-202": field("esc_id_set", 200),
    "TYP-203": field("esc_timing", 35),
    "TYP-204": field("esc_signal_priority", 3),
    "TYP-205": field("esc_can_rate", 9),
    "TYP-206": field("esc_fdb_rate", 1000),
    "TYP-207": field("esc_save_option", 2),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", ["TYP-004", "TYP-005", "TYP-101", "TYP-102", "TYP-104", "TYP-105"])
def test_one_command_that_is_not_obeyed_changes_no_more_than_the_speed_a_little(rule: str) -> None:
    seen, clean = faulted(rule), faulted()
    assert len(seen.shown(rule)) == 1
    assert [(one.node, one.name) for one in seen.sent] == [(one.node, one.name) for one in clean.sent]
    for one, right in zip(seen.of("ESCStatus"), clean.of("ESCStatus"), strict=True):
        assert abs(one.values["rpm"] - right.values["rpm"]) < 60
        assert word(one) & 0xF000 == word(right) & 0xF000


@pytest.mark.sampled(7)
@pytest.mark.parametrize(
    ("order", "holds"),
    [
        ("TYP-001:bytes=5", lambda s: len(s.payload) == 9),
        ("TYP-001:type=uavcan.protocol.NodeStatus", lambda s: len(s.payload) == 6),
        ("TYP-002:bytes=4", lambda s: len(s.payload) == 18),
        ("TYP-003:bits=2", lambda s: s.payload[-1] & 3 == 2),
        ("TYP-004:type=RawCommand", lambda s: len(s.payload) == 8),
        ("TYP-005:type=PUSHCAN", lambda s: len(s.payload) == 4 + 256),
        ("TYP-006:type=PUSHSCI", lambda s: s.payload[4:7] == b"\x07\xec\x96"),
        ("TYP-006:type=ParamGet", lambda s: len(s.payload) == 74 and s.payload[41] == 32),
        ("TYP-006:type=ParamGet:form=dsdl", lambda s: len(s.payload) == 74 and s.payload[41] >> 2 == 32),
        ("TYP-006:type=RawCommand", lambda s: len(s.payload) == 36 and s.payload[0] == 20),
        ("TYP-007:field=current", lambda s: isinstance(s.values["current"], Code)),
        ("TYP-008:sign=-1", lambda s: raw(s) == [0xFC00]),
        ("TYP-011:tag=5:node=13", lambda s: s.payload[0] == 5 and s.node == 13),
        ("TYP-101:channel=2:value=-5", lambda s: s.values["cmd"][2] == -5),
        ("TYP-103:more=-1", lambda s: len(s.values["cmd"]) == 3),
        ("TYP-105:value=768", lambda s: s.payload[:2] == b"\x00\x03"),
        ("TYP-201:type=ParamCfg", lambda s: s.name == "ParamCfg" and s.values["esc_index"] == 25),
        ("TYP-201:type=ParamGet:node=12", lambda s: s.node == 12 and s.values["esc_index"] == 25),
        ("TYP-203:type=ParamGet:value=0", lambda s: s.name == "ParamGet" and s.values["esc_timing"] == 0),
        ("TYP-209:field=esc_led_mode", lambda s: s.values["esc_led_mode"] == 0xFF),
        ("TYP-305:bit=1", lambda s: bool(word(s) & 2)),
        ("TYP-308:field=rpm", lambda s: s.values["rpm"] == 120_000),
        ("TYP-308:field=temperature:value=620", lambda s: s.values["temperature"] == 620.0),
        ("TYP-401:bytes=31", lambda s: len(s.payload) == 72),
        ("TYP-404:value=20250101", lambda s: s.values["esc_product_date"] == 20_250_101),
        ("TYP-504:type=PUSHSCI", lambda s: s.name == "PUSHSCI" and not s.values["data"]),
    ],
)
def test_settings_take_effect(order: str, holds: Callable[[Sending], bool]) -> None:
    shown = faulted(order).shown(order[:7])
    assert shown
    assert all(map(holds, shown))


def test_a_permanent_write_comes_while_the_motors_turn() -> None:
    seen = faulted("TYP-210")
    (write,) = seen.shown("TYP-210")
    assert (write.values["esc_save_option"], write.values["esc_led_mode"]) == (1, 0x57)
    command = [one for one in seen.of("RawCommand") if one.t <= write.t][-1]
    assert min(command.values["cmd"]) > 0


def test_a_query_is_27_bytes_of_ones() -> None:
    (query,) = faulted("TYP-208").shown("TYP-208")
    assert query.payload == b"\xff" * 27


@pytest.mark.slow
def test_an_esc_refuses_what_it_must_not_take() -> None:
    for rule, holds in REFUSED.items():
        seen = faulted(rule)
        (write,) = seen.shown(rule)
        reports = [one for one in seen.of("ParamGet") if one.t > write.t]
        assert reports
        assert rule == "TYP-202" or not any(map(holds, reports))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("escs", [1, 3, 8, 20])
def test_lengths_go_wrong_for_any_number_of_channels(escs: int) -> None:
    seen = faulted("TYP-004", "TYP-105", "TYP-103:more=-1" if escs > 1 else "TYP-103", escs=escs, seconds=2.5)
    (odd,) = seen.shown("TYP-004")
    assert 8 * len(odd.payload) % 14 >= 8
    assert len(odd.payload) <= 35
    assert ("TYP-103" in seen.answer("TYP-105")["also"]) == (escs != 4)
    assert len(seen.shown("TYP-103")) == 80


@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    "order",
    [
        *("TYP-007:type=RawCommand", "TYP-001:type=RawCommand", "TYP-302:type=PUSHCAN", "TYP-202:type=ESCStatus"),
        *("TYP-001:bytes=0", "TYP-001:bytes=99", "TYP-002:bytes=0", "TYP-005:more=0"),
        *("TYP-101:value=5", "TYP-101:channel=4", "TYP-103:more=0", "TYP-105:value=0"),
        *("TYP-201:value=19", "TYP-202:value=255", "TYP-203:value=15", "TYP-204:value=1", "TYP-205:value=-1"),
        *("TYP-206:value=65535", "TYP-207:value=0", "TYP-302:value=128", "TYP-303:value=5", "TYP-304:value=8"),
        *("TYP-308:value=50", "TYP-401:bytes=32", "TYP-402:by=0"),
    ],
)
def test_a_setting_that_breaks_no_rule_is_left_alone_and_told(order: str) -> None:
    seen = faulted(order, seconds=2.0)
    assert seen.key["faults"] == []
    assert seen.simulation.unused == (order,)


@pytest.mark.parametrize(
    "order",
    [
        *("TYP-305:seconds=nan", "TYP-308:value=inf", "TYP-006:form=word", "TYP-209:field=x", "TYP-002:bytes=-1"),
        *("TYP-305:bit=12", "TYP-305:bit=-1", "TYP-306:seconds=0", "TYP-307:seconds=-1", "TYP-101:type=ESCStatus"),
        *("TYP-501:type=ESCStatus", "TYP-103:type=PUSHCAN", "TYP-301:node=128"),
    ],
)
def test_a_setting_that_nothing_can_have_is_refused(order: str) -> None:
    with pytest.raises(ValueError, match=order[:7]):
        catalogue.order(order)


@pytest.mark.slow
def test_a_write_waits_until_the_motors_turn() -> None:
    assert faulted("TYP-210@0.1", seconds=3.0).answer("TYP-210")["time"] > 0.5
