"""ESCStatus: status word, telemetry, and what a node does in all its reports."""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import pytest
from kit import VECTORS, encode
from kit.judged import exact, judge, proved, whole
from kit.simulated import flight
from kit.traffic import STATUS, log

IDLE = 2 << 12
ERROR = 6 << 12
WORDS = ("TYP-303", "TYP-304", "TYP-305", "TYP-306", "TYP-307")


def sent(k: int, node: int = 11, name: str = "ESCStatus", **fields: Any) -> str:
    usual = STATUS | {"esc_index": 0, "error_count": IDLE} if name == "ESCStatus" else {}
    return log((k * 20, encode.transfer(name, usual | fields, node, k)))


def told(text: str, *rules: str, **settings: Any) -> list[tuple[str, str, int, str]]:
    return [(one.rule, one.severity, one.count, one.text) for one in whole(text, rules, **settings)]


def brief(text: str, rule: str) -> list[tuple[str, str, int, str]]:
    """What is told, without how long it lasted and what was measured."""
    return [(*one[:3], one[3].partition(" for ")[0].partition(" 2 times")[0]) for one in told(text, rule)]


def words(*values: int, node: int = 11) -> str:
    return "".join(sent(k, node, error_count=value) for k, value in enumerate(values))


@pytest.mark.sampled(11)
@pytest.mark.parametrize(
    ("order", "severity", "count", "text"),
    [
        ("TYP-302", "warning", 1, "110 %"),
        ("TYP-303", "warning", 1, "encoder 20000"),
        ("TYP-303:value=65535", "warning", 1, "encoder 65535"),
        ("TYP-304", "warning", 1, "mode 9"),
        ("TYP-304:value=0", "warning", 1, "mode 0"),
        ("TYP-305", "warning", 30, "MOS over temperature for 0.97 s to the end"),
        ("TYP-305:bit=7:seconds=1", "warning", 30, "stall for 0.97 s"),
        ("TYP-306", "error", 24, "after mode 4, faults: stall, for 0.77 s"),
        ("TYP-308", "warning", 1, "voltage = 150.0"),
        ("TYP-308:field=temperature", "warning", 1, "temperature = -100.0"),
        ("TYP-308:field=rpm", "warning", 1, "rpm = 120000.0"),
        ("TYP-010", "note", 1, "C reading: -2712 rpm, 57 %, index 1"),
    ],
)
def test_a_fault_is_found_where_it_is(order: str, severity: str, count: int, text: str) -> None:
    (one,) = exact(order[:7], flight(order))
    assert (one.severity, one.count, one.text.partition(": 4")[0]) == (severity, count, text)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("order", "text"),
    [("TYP-009:node=12", "360 values of 120 transfers end in 000"), ("TYP-307:node=12", "4, then 5")],
)
def test_a_habit_is_told_once_a_node(order: str, text: str) -> None:
    (one,) = proved(order[:7], flight(order))
    assert (one.severity, one.node, one.count, one.text) == ("note", 12, 1, text)


def test_the_vectors_break_the_status_word_where_they_say() -> None:
    blocks = json.loads((VECTORS / "violations.json").read_text())
    (block,) = (block for block in blocks if block["name"] == "escstatus_encoder_mode_faults")
    found = judge((VECTORS / "violations.log").read_bytes(), WORDS, step=7)
    assert {one.rule for one in found} == set(block["expect"])
    assert {one.first for one in found} == {block["first_line"]}


@pytest.mark.slow
def test_each_node_has_its_unit() -> None:
    said = judge(flight("TYP-301"), ("TYP-301",), step=401)
    units = {one.node: one.text.partition(",")[0] for one in said}
    assert units == {11: "degrees Celsius", 12: "degrees Celsius", 13: "kelvin", 14: "degrees Celsius"}
    for lowest, unit in ((50.0, "undecided"), (150.0, "degrees Celsius")):
        mixed = sent(0, temperature=lowest) + sent(1, temperature=math.nan) + sent(2, temperature=250.0)
        assert told(mixed, "TYP-301") == [("TYP-301", "note", 1, f"{unit}, samples {lowest} to 250.0")]
    assert not told(sent(0, temperature=math.nan), "TYP-301")


def test_a_sound_flight_is_clean() -> None:
    rules = ("TYP-009", "TYP-010", "TYP-302", "TYP-308", *WORDS)
    assert not judge(flight(escs=5), rules)


def test_a_stock_esc_has_no_status_word() -> None:
    stock = words(0x8000_0FFF, 0x8000_0FFF)
    assert not told(stock, *WORDS)
    forced = {one[0] for one in told(stock, *WORDS, dialects={11: frozenset({"tm"})})}
    assert forced == {"TYP-303", "TYP-304", "TYP-305"}
    assert told(sent(0, error_count=0, power_rating_pct=101), "TYP-302") == [("TYP-302", "note", 1, "101 %")]
    assert told(sent(0, power_rating_pct=101), "TYP-302") == [("TYP-302", "warning", 1, "101 %")]


def test_the_dialect_that_shows_late_holds_for_all_reports() -> None:
    found = told(words(0, 9 << 12, IDLE), "TYP-304")
    assert found == [("TYP-304", "warning", 1, "mode 0"), ("TYP-304", "warning", 1, "mode 9")]


def test_limits_are_allowed() -> None:
    assert not told(words(16383 << 16 | 1 << 12, 8 << 12), *WORDS)
    fields = {"voltage": 120.0, "current": -1000.0, "temperature": 500.0, "rpm": -100_000, "power_rating_pct": 100}
    assert not told(sent(0, **fields) + sent(1, temperature=-60.0, voltage=math.nan), "TYP-302", "TYP-308")
    assert [one[3] for one in told(sent(0, current=-math.inf, voltage=-0.5), "TYP-308")] == [
        "current = -inf", "voltage = -0.5",
    ]  # fmt: skip


def test_a_fault_bit_is_told_when_it_rises() -> None:
    hot, loss = IDLE | 1 << 5, IDLE | 1 << 3
    start = sent(0, 10, "RawCommand", cmd=[0])
    assert brief(start + words(hot, hot, IDLE, IDLE, hot, hot | 1), "TYP-305") == [
        ("TYP-305", "warning", 4, "MOS over temperature"),
        ("TYP-305", "warning", 1, "over voltage; 48.5 V, 1.0 A, 40 degC, -5 rpm"),
    ]
    assert brief(words(loss, IDLE, loss) + start + words(loss, IDLE, loss), "TYP-305") == [
        ("TYP-305", "note", 3, "throttle loss"),
        ("TYP-305", "warning", 1, "throttle loss; 48.5 V, 1.0 A, 40 degC, -5 rpm"),
    ]


def test_fault_bits_of_nodes_are_their_own() -> None:
    both = "".join(sent(k, node, error_count=IDLE | node - 11) for k in range(4) for node in (11, 12))
    assert brief(both, "TYP-305") == [("TYP-305", "warning", 4, "over voltage")]


def test_error_mode_says_what_went_before() -> None:
    before, none = "after mode 4, faults: throttle loss, stall,", "after mode unknown, faults: none;"
    assert brief(words(4 << 12, ERROR | 0x88, ERROR), "TYP-306")[0][2:] == (2, before)
    assert brief(words(ERROR, IDLE), "TYP-306")[0][2:] == (1, f"{none} 48.5 V, 1.0 A, 40 degC, -5 rpm")
    assert whole(words(4 << 12, ERROR, IDLE, ERROR), ("TYP-306",), (3,))


def test_a_word_counts_if_it_only_rises_in_small_steps() -> None:
    assert told(words(3, 3, 4, 20), "TYP-307") == [("TYP-307", "note", 1, "3, then 4")]
    for other in ((3, 3, 3), (3, 4, 4), (3, 4, 21), (3, 4, 5, 4), (3, 4, 5, IDLE)):
        assert not told(words(*other), "TYP-307"), other


def test_values_that_end_in_zeros_must_be_many_and_different() -> None:
    def coarse(transfers: int, different: int) -> str:
        volts = [struct.unpack("<e", struct.pack("<H", 0x5000 | k % different << 3))[0] for k in range(transfers)]
        return "".join(sent(k, voltage=value, current=1.0, temperature=math.inf) for k, value in enumerate(volts))

    (one,) = judge(coarse(50, 7), ("TYP-009",))
    assert (one.text, one.first) == ("100 values of 50 transfers end in 000", 1)
    assert not judge(coarse(50, 6), ("TYP-009",))
    assert not judge(coarse(49, 7), ("TYP-009",))
    assert not judge(coarse(50, 7) + sent(50, voltage=48.53), ("TYP-009",))
