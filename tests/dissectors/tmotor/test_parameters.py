"""ParamCfg and ParamGet: queries, doubtful values, counters, dates, UUIDs."""

from __future__ import annotations

from typing import Any

import pytest
from kit import encode
from kit.judged import exact, judge, whole
from kit.simulated import flight
from kit.traffic import Timed, alive, log

_FIELDS = [field.split(":")[0] for field in encode.TYPES["ParamGet"].layout.split()]
REPORT: dict[str, Any] = dict.fromkeys(_FIELDS, 1) | {"rsvd": [], "esc_uuid": 0x11223344, "esc_product_date": 20240703}
WRITE: dict[str, Any] = dict.fromkeys([f.split(":")[0] for f in encode.TYPES["ParamCfg"].layout.split()], 1)
WRITE |= {"esc_uuid": 0x11223344, "esc_save_option": 0}


class Capture:
    """Transfers in the order of sending, at times in ms."""

    def __init__(self) -> None:
        self.sent: list[Timed] = []

    def send(self, t: int, name: str, node: int, **fields: Any) -> Capture:
        self.sent.append((t, encode.transfer(name, fields, node, len(self.sent))))
        return self

    def report(self, t: int, node: int = 11, **fields: Any) -> Capture:
        return self.send(t, "ParamGet", node, **REPORT | fields)

    def write(self, t: int, **fields: Any) -> Capture:
        return self.send(t, "ParamCfg", 125, **WRITE | fields)

    def alive(self, t: int, uptime: int, node: int = 11) -> Capture:
        self.sent.append((t, alive(uptime, node, len(self.sent))))
        return self

    def told(self, *rules: str) -> list[str]:
        return [one.text for one in whole(log(*self.sent), rules) for _ in range(one.count)]


@pytest.mark.sampled(8)
@pytest.mark.parametrize(
    ("order", "severity", "text"),
    [
        ("TYP-209", "note", "esc_acc_threshold = 0x00FF"),
        ("TYP-209:field=esc_led_mode", "note", "esc_led_mode = 0x00FF"),
        ("TYP-401", "note", "16 bytes"),
        ("TYP-401:bytes=31", "note", "31 bytes"),
        ("TYP-402", "warning", "esc_startup_times 376, then 371"),
        ("TYP-402:field=esc_startup_duration", "warning", "esc_startup_duration 5344, then 5339"),
        ("TYP-403", "warning", "79B05F3A: nodes 11 and 13"),
        ("TYP-403:node=12", "warning", "79B05F3A: nodes 11 and 12"),
    ],
)
def test_a_fault_is_found_where_it_is(order: str, severity: str, text: str) -> None:
    (one,) = exact(order[:7], flight(order))
    assert (one.severity, one.count, one.text) == (severity, 1, text)


@pytest.mark.slow
def test_a_sound_flight_has_queries_only() -> None:
    assert not judge(flight(escs=5), ("TYP-209", "TYP-401", "TYP-402", "TYP-403"))
    (one,) = exact("TYP-208", flight(escs=5))
    assert (one.severity, one.text) == ("note", "asked by node 125")


def test_a_query_has_all_its_bytes() -> None:
    ones = {name: -1 if name == "esc_rotate_dir" else 0xFFFFFFFF for name in WRITE}
    assert Capture().write(0, **ones).told("TYP-208", "TYP-209") == ["asked by node 125"]
    assert not Capture().write(0, **ones | {"esc_index": 0}).told("TYP-208", "TYP-209")


def test_a_uuid_is_doubtful_if_its_low_bytes_are_ones() -> None:
    for uuid, doubtful in ((0xFF, True), (0xFFFF, True), (0xFFFFFF, True), (0xFFFFFFFF, False), (0xFF00FF00, False)):
        assert bool(Capture().write(0, esc_uuid=uuid).told("TYP-209")) == doubtful, hex(uuid)


def test_a_counter_wraps_at_16_bits() -> None:
    assert not Capture().report(0, esc_startup_times=65001).report(10, esc_startup_times=499).told("TYP-402")
    found = Capture().report(0, esc_startup_times=65000).report(10, esc_startup_times=499).told("TYP-402")
    assert found == ["esc_startup_times 65000, then 499"]
    other = Capture().report(0, esc_error_count=5).report(10, esc_error_count=4, esc_uuid=7)
    assert not other.told("TYP-402")


def test_dates_are_days_or_seconds() -> None:
    capture = Capture()
    for k, date in enumerate((20240703, 1719964800, 20241332, 0)):
        capture.report(k, esc_product_date=date)
    assert capture.told("TYP-404") == [
        "20240703: YYYYMMDD", "1719964800: seconds since 1970", "20241332: unknown", "20241332: unknown",
    ]  # fmt: skip


def test_two_nodes_with_a_uuid_must_both_be_there() -> None:
    two = "11223344: nodes 11 and 12"

    def shared() -> Capture:
        return Capture().alive(0, 10).report(100, 11).report(200, 12, esc_index=2)

    assert shared().alive(1000, 11).told("TYP-403") == [two]
    assert shared().report(300, 11).told("TYP-403") == [two]
    assert not shared().told("TYP-403"), "node 11 fell silent"
    assert not shared().alive(1000, 0).told("TYP-403"), "node 11 restarted"
    assert not shared().alive(1500, 0).report(1600, 12, esc_index=2).alive(2500, 1).told("TYP-403")


def test_an_index_keeps_its_uuid_unless_it_restarts() -> None:
    def changed() -> Capture:
        return Capture().alive(0, 10).report(100).report(200, esc_uuid=0xA)

    was = "0000000A: index 1 had 11223344 before"
    assert changed().told("TYP-403") == [was]
    assert changed().alive(1000, 11).told("TYP-403") == [was]
    assert not changed().alive(1000, 0).told("TYP-403")
    assert not Capture().report(100).report(200, esc_uuid=0xA, esc_index=2).told("TYP-403")
