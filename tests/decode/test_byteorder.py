"""PUSH-010: which nodes send big-endian packets is found out from their ESCStatus, for any profile that says how."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MOTOR, UNIT, Traffic, lines, mixed, turned

import dissectors

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def motors(traffic: Traffic, decode: Callable[..., Any]) -> list[dict[str, Any]]:
    return decode(traffic.log).messages["PUSHCAN.MotorStatus"]


def of(rows: list[dict[str, Any]], node: int, column: str) -> list[Any]:
    return [row[column] for row in rows if row["src"] == node]


def test_a_node_is_read_big_endian_behind_its_third_proof(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(6):
        for node in (10, 11):
            traffic.status(node)
            traffic.motor(node, big=node == 11, current=-120)
    feedback = encode.packet("PUSHCAN.FocFeedback", 6, UNIT, report_rate=50, hardware_version=b"V1", led=0x0123)
    for node in (10, 11):
        traffic.push(node, turned("PUSHCAN.FocFeedback", feedback) if node == 11 else feedback)
    got = decode(traffic.log).messages
    rows = got["PUSHCAN.MotorStatus"]
    assert of(rows, 10, "big_endian") == [False] * 6
    assert of(rows, 11, "big_endian") == [False] * 3 + [True] * 3
    assert of(rows, 10, "voltage") == [48.5] * 6
    assert of(rows, 11, "voltage") == [619.7] * 3 + [48.5] * 3
    assert {row["packet_ok"] for row in rows} == {True}
    for row in [*[r for r in rows if r["src"] == 10], *[r for r in rows if r["src"] == 11][3:]]:
        shown = (row["speed"], row["current"], row["temperature"], row["position"], row["pwm"])
        assert shown == pytest.approx((3011, -1.2, 41.0, 12.34, 1500.0))
    # What is settled holds for every packet of the node, and for nothing but its numbers.
    for row in got["PUSHCAN.FocFeedback"]:
        assert row["big_endian"] == (row["src"] == 11)
        assert (row["report_rate"], row["led"], row["hardware_version.text"]) == (50, 0x0123, "V1")


def flags(traffic: Traffic, decode: Callable[..., Any], node: int = 11) -> list[bool]:
    return of(motors(traffic, decode), node, "big_endian")


def test_without_a_status_a_node_stays_little_endian(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(6):
        traffic.status(10)
        traffic.motor(10, voltage=0, speed=0)  # proves nothing, so that node 10 is looked at too
        traffic.motor(11, big=True)
    assert flags(traffic, decode) == [False] * 6


def test_values_that_read_the_same_both_ways_prove_nothing(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for round_ in range(8):
        traffic.status(11, voltage=0x1212 / 100, rpm=0)
        traffic.motor(11, big=True, voltage=0x1212, speed=0)
        if round_ >= 4:  # the same node spins up
            traffic.status(11)
            traffic.motor(11, big=True)
    assert flags(traffic, decode) == [False] * 4 + [False, False] * 3 + [True, True]


def test_values_that_agree_in_neither_way_or_in_different_ways_prove_nothing(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(5):
        traffic.status(11, voltage=20.0, rpm=-9)
        traffic.motor(11, big=True)
        traffic.status(11, voltage=48.5, rpm=int.from_bytes((3011).to_bytes(2, "big"), "little", signed=True))
        traffic.motor(11, big=True)
    assert flags(traffic, decode) == [False] * 10


@pytest.mark.parametrize("sent", ["bblbbbb", "lbbbbbb"])
def test_one_proof_of_little_endian_settles_a_node(decode: Callable[..., Any], flush: object, sent: str) -> None:
    traffic = Traffic()
    for order in sent:
        traffic.status(11)
        traffic.motor(11, big=order == "b")
    assert flags(traffic, decode) == [False] * 7
    cut = decode(*[piece for line in traffic.log.splitlines(keepends=True) for piece in (line, flush)])
    assert of(cut.messages["PUSHCAN.MotorStatus"], 11, "big_endian") == [False] * 7


def test_damaged_traffic_proves_nothing(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    damaged = bytearray(turned("PUSHCAN.MotorStatus", encode.packet("PUSHCAN.MotorStatus", 0, UNIT, **MOTOR)))
    damaged[-1] ^= 1
    for _ in range(4):
        traffic.status(11)
        traffic.push(11, bytes(damaged))
        traffic.status(12, broken=True)
        traffic.motor(12, big=True)
        traffic.status(13)
        traffic.push(13, turned("PUSHCAN.MotorStatus", encode.packet("PUSHCAN.MotorStatus", 0, UNIT)), broken=True)
    rows = motors(traffic, decode)
    assert len(rows) == 12
    assert not any(row["big_endian"] for row in rows)


def test_only_the_latest_status_before_a_packet_counts(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(5):
        traffic.motor(11, big=True)
        traffic.status(11)
        traffic.status(11, voltage=5.0, rpm=-7)
    assert flags(traffic, decode) == [False] * 5


def test_a_node_number_on_another_bus_is_another_node(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(5):
        for bus in ("can0", "can1"):
            traffic.status(11, bus=bus)
            traffic.motor(11, big=bus == "can1", bus=bus)
    rows = motors(traffic, decode)
    assert [row["big_endian"] for row in rows if row["bus"] == 0] == [False] * 5
    assert [row["big_endian"] for row in rows if row["bus"] == 1] == [False] * 3 + [True] * 2


def test_a_truncated_packet_is_turned_as_far_as_it_goes(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(3):
        traffic.status(11)
        traffic.motor(11, big=True)
    traffic.push(11, turned("PUSHCAN.MotorStatus", encode.packet("PUSHCAN.MotorStatus", 3, UNIT, **MOTOR))[:17])
    row = motors(traffic, decode)[-1]
    assert (row["big_endian"], row["complete"], row["packet_ok"]) == (True, False, False)
    assert (row["pwm"], row["speed"], row["voltage"], row["current"]) == (1500.0, 3011, 48.5, None)
    assert row["runtime.unwrapped"] is None


@pytest.mark.slow
def test_where_the_capture_is_cut_changes_nothing(decode: Callable[..., Any], flush: object) -> None:
    parts = mixed().log.splitlines(keepends=True)
    whole = decode(b"".join(parts)).messages
    assert of(whole["PUSHCAN.MotorStatus"], 11, "big_endian") == [False] * 3 + [True] * 2
    assert of(whole["PUSHCAN.MotorStatus"], 10, "runtime.unwrapped") == [65530, 65533, 65536, 65539, 65542]
    assert decode(*[piece for line in parts for piece in (line, flush)]).messages == whole
    for cut in range(1, len(parts), 3):
        assert decode(b"".join(parts[:cut]), flush, b"".join(parts[cut:])).messages == whole, cut


# ---- a vendor's own ------------------------------------------------------------------------------------------------

PROFILE = """\
[message.Meter]
dsdl = "20101.Meter.uavcan"
type = "acme.Meter"
[message.Push]
dsdl = "20102.Push.uavcan"
type = "acme.Push"
packets = "push.toml"
"""
FAMILY = """\
carrier = "data"
header = [0x55]
id_at = 1
count_at = 2
unit_at = 3
length_at = 4
[packet.Wide]
dsdl = "Wide.uavcan"
id = 7
"""
WIDE = "uint8[5] head\nuint24 level\nuint16[2] pair\nfloat32 ratio\nuint4 low\nuint16 odd\nuint4 high\n"
WIDE += "int32 deep\nuint8 sum"


def vendor(folder: Path, family: str) -> Path:
    (folder / "profile.toml").write_text(PROFILE)
    (folder / "push.toml").write_text(family)
    (folder / "20101.Meter.uavcan").write_text("uint32 level\nbool on\nvoid7")
    (folder / "20102.Push.uavcan").write_text("uint8[<=60] data")
    (folder / "Wide.uavcan").write_text(WIDE)
    return folder


def test_byte_order_and_wraps_come_from_the_profile(tmp_path: Path, decode: Callable[..., Any]) -> None:
    level = 'field.level = { scale = 10, wraps = true, agrees = { with = "Meter.level", within = "1/1000" } }'
    types = dissectors.load([vendor(tmp_path, FAMILY + level)])
    signature = {number: types.signatures(0, number)[0] for number in (20101, 20102)}
    frames = []
    for k in range(5):
        level = (0xFFFFE4 + 8 * k) % (1 << 24)
        body = bytes([0x55, 7, k, 1, 24]) + level.to_bytes(3, "big") + struct.pack(">HHf", 1, 515, 0.5)
        body += bytes([0x12, 0x34, 0x56]) + struct.pack(">i", -5)
        whole = body + bytes([sum(body) & 0xFF])
        meter = struct.pack("<IB", level * 10, 0)
        for number, payload in ((20101, meter), (20102, whole)):
            frames += encode.Transfer("message", number, 9, payload, signature[number], k).frames()
    rows = decode(lines(frames), types=types).messages["Push.Wide"]
    assert [row["big_endian"] for row in rows] == [False] * 3 + [True] * 2
    assert [row["level"] for row in rows[3:]] == [0xFFFFFC * 10.0, 40.0]
    assert [row["level.unwrapped"] for row in rows[3:]] == [0xFFFFFC * 10.0, 0x1000004 * 10.0]
    assert {(tuple(row["pair"]), row["ratio"], row["deep"]) for row in rows[3:]} == {((1, 515), 0.5, -5)}
    assert {(row["low"], row["odd"], row["high"]) for row in rows} == {(1, 0x4523, 6)}  # no whole bytes: never turned


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ("ratio = { wraps = true }", "wraps: only a single unsigned number of at most 32 bits wraps"),
        ("pair = { wraps = true }", "only a single unsigned number"),
        ("low = { agrees = { with = 'Meter.level', within = 0.1 } }", "two or more whole bytes"),
        ("level = { agrees = { within = 0.1 } }", "with is missing"),
        ("level = { agrees = { with = 'Gone.level', within = 0.1 } }", "with: 'Gone' is no message of this profile"),
        ("level = { agrees = { with = 'level', within = 0.1 } }", "with: '' is no message"),
        ("level = { agrees = { with = 'Meter.on', within = 0.1 } }", "with: 'on' is no number of acme.Meter"),
        ("level = { agrees = { with = 'Meter.level' } }", "within: a share from 0 to below 1 is expected"),
        ("level = { agrees = { with = 'Meter.level', within = 1 } }", "within: a share"),
        ("level = { agrees = { with = 'Meter.level', within = 0, by = 1 } }", "by: unknown key (allowed: "),
        ("level = { wrap = true }", "wrap: unknown key (allowed: agrees, bits, "),
    ],
)
def test_mistakes_in_the_profile_are_located(tmp_path: Path, field: str, reason: str) -> None:
    with pytest.raises(dissectors.ProfileError) as caught:
        dissectors.load([vendor(tmp_path, f"{FAMILY}field.{field}")])
    assert (caught.value.file, caught.value.line) == (str(tmp_path / "push.toml"), FAMILY.count("\n") + 1)
    assert reason in caught.value.reason


def test_messages_have_neither_key(tmp_path: Path) -> None:
    folder = vendor(tmp_path, FAMILY)
    (folder / "profile.toml").write_text(PROFILE + "field.data = {}\n[message.Meter.field.level]\nwraps = true\n")
    with pytest.raises(dissectors.ProfileError, match=r":10: .*wraps: unknown key"):
        dissectors.load([folder])
