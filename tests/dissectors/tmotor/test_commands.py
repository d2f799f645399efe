"""RawCommand, priorities, length prefixes and FocCtrl: what fires, where, and what must not."""

from __future__ import annotations

import pytest
from kit import encode
from kit.judged import exact, judge, proved, whole
from kit.simulated import flight
from kit.traffic import STATUS, Timed, log


def command(*cmd: int, number: int = 0, **more: object) -> encode.Transfer:
    return encode.transfer("RawCommand", {"cmd": list(cmd)}, 10, number, **more)


def report(index: int, number: int = 0, node: int = 11, **more: object) -> encode.Transfer:
    return encode.transfer("ESCStatus", STATUS | {"esc_index": index}, node, number, **more)


@pytest.mark.sampled(12)
@pytest.mark.parametrize(
    ("order", "severity", "count", "text"),
    [
        ("TYP-006", "warning", 1, "whole-byte length prefix 28, decoded with it"),
        ("TYP-006:type=PUSHSCI", "warning", 1, "whole-byte length prefix 7, decoded with it"),
        ("TYP-006:type=RawCommand", "warning", 1, "whole-byte length prefix 20, decoded with it"),
        ("TYP-006:type=ParamGet", "warning", 1, "whole-byte length prefix 32, decoded with it"),
        ("TYP-006:type=ParamGet:form=dsdl", "warning", 1, "6-bit length prefix 32, decoded with it"),
        ("TYP-101:channel=3:value=-1", "warning", 1, "ch4 = -1"),
        ("TYP-102:channel=2", "warning", 1, "ch3 = -8192"),
        ("TYP-103", "note", 80, "5 channels, highest index 3"),
        ("TYP-103:more=-1:commands=10", "note", 10, "3 channels, highest index 3"),
        ("TYP-104:count=3", "note", 3, "no channels"),
        ("TYP-105", "warning", 1, "as a word 1000, as sent 232, 192, 0, 0"),
        ("TYP-105:value=4095", "warning", 1, "as a word 4095, as sent 1023, 192, 0, 0"),
    ],
)
def test_a_fault_is_found_where_it_is(order: str, severity: str, count: int, text: str) -> None:
    (one,) = exact(order[:7], flight(order))
    assert (one.severity, one.count, one.text) == (severity, count, text)


@pytest.mark.parametrize(
    "rule", ["CAN-013", "CAN-016", "TYP-006", "TYP-101", "TYP-102", "TYP-103", "TYP-104", "TYP-105"]
)
def test_a_sound_flight_is_clean(rule: str) -> None:
    assert not judge(flight(escs=5), (rule,))


def test_priority_is_a_warning_only_for_reports_of_the_t_motor_dialect() -> None:
    (one,) = proved("CAN-013", flight("CAN-013"))
    assert (one.severity, one.node, one.type, one.text) == ("warning", 12, "ESCStatus", "priority 16, 31 is LOWEST")
    stock = log(
        (0, command(1, priority=7)), (10, report(0, priority=16)),
        (20, command(1, number=1, priority=0)), (30, report(0, 1, priority=16)), (40, command(1, number=2)),
    )  # fmt: skip
    found = [(one.severity, one.node, one.key, one.count) for one in judge(stock, ("CAN-013",), step=3)]
    assert found == [
        ("note", 10, "priority=7", 1), ("note", 11, "priority=16", 2), ("note", 10, "priority=0", 1),
    ]  # fmt: skip
    forced = judge(stock, ("CAN-013",), dialects={11: frozenset({"tm"})})
    assert {one.node: one.severity for one in forced} == {10: "note", 11: "warning"}


def test_foc_ctrl_is_told_once_a_node() -> None:
    (one,) = proved("CAN-016", flight("CAN-016"))
    assert (one.severity, one.node, one.text) == ("note", 125, "type 1035 is not part of V2.2")


def test_both_limits_are_told_for_each_channel() -> None:
    found = judge(log((0, command(5, -8192, -8191, -1)), (5, command(0, 8191, number=1))), ("TYP-101", "TYP-102"))
    assert [(one.rule, one.key, one.text) for one in found] == [
        ("TYP-101", "channel=2", "ch2 = -8192"),
        ("TYP-101", "channel=3", "ch3 = -8191"),
        ("TYP-101", "channel=4", "ch4 = -1"),
        ("TYP-102", "channel=2", "ch2 = -8192"),
    ]


def test_channels_are_counted_only_after_a_second_of_reports() -> None:
    def found(*late: int) -> list[tuple[int, str]]:
        sent: list[Timed] = [(t, command(1, 2, number=k)) for k, t in enumerate(late)]
        said = whole(log((0, report(0)), (900, report(2, 1)), *sent), ("TYP-103",))
        return [(one.count, one.text) for one in said]

    assert not found(50, 950)
    assert found(1100, 1800) == [(2, "2 channels, highest index 2")]
    assert not found(2000), "a second after the last report nobody knows"


def test_channels_are_counted_anew_a_second_after_a_gap_in_the_capture() -> None:
    """Of those that report seldom some have not spoken again; both batches and a second gap are tried."""

    def found(*late: int) -> list[tuple[int, int]]:
        before: list[Timed] = [(0, report(0)), (10, report(1, 1)), (900, report(1, 2)), (1800, report(0, 3))]
        after: list[Timed] = [(t + 100, report(0, 4 + k)) for k, t in enumerate((5000, 5800, 9000))]
        sent: list[Timed] = [(t, command(1, 2, number=k)) for k, t in enumerate((1850, *late))]
        return [(one.first, one.count) for one in whole(log(*before, *after, *sent), ("TYP-103",))]

    assert not found(5150, 5900, 9150), "less than a second after each gap"
    assert [count for _, count in found(5150, 6150, 6190, 9150)] == [2]


def test_a_word_of_16_bits_needs_its_zeros_and_its_low_bits() -> None:
    assert len(judge(log((0, command(232, 192, 0, 0))), ("TYP-105",))) == 1
    for near in ((232, 192, 0, 1), (232, 193, 0, 0), (232, 0, 0, 0), (4096, 64, 0, 0), (-1, 64, 0, 0)):
        assert not judge(log((0, command(*near))), ("TYP-105",)), near
    assert not judge(log((0, command(232, 192, 0))), ("TYP-105",))
    assert not judge(log((0, command(232, 192, 0, 0, fd=True))), ("TYP-105",))


def test_can_fd_has_a_length_by_right() -> None:
    text = log((0, command(1, 2, fd=True)), (5, command(fd=True, number=1)))
    assert not judge(text, ("TYP-006", "TYP-104"))
    (one,) = judge(log((0, command())), ("TYP-104",))
    assert (one.node, one.text) == (10, "no channels")
