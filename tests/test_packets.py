"""Packets inside PUSHSCI and PUSHCAN: their verdicts, the byte order of their sender, counters that wrap, prefixes."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import encode
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sequences import STATUS, lines
from values import differing

import dissectors
from analyzer.unwrap import Unwrapper

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

UNIT = 0xA1
MOTOR = {"voltage": 4850, "speed": 3011, "current": -120, "temperature": 4100, "position": 1234, "pwm": 15000}


def turned(name: str, whole: bytes) -> bytes:
    """The packet as a big-endian sender writes it; the sum of its bytes stays the same."""
    out, at = bytearray(whole), 6
    for code in (field.partition(":")[2] for field in encode.PACKETS[name][1].split()):
        size = struct.calcsize("<" + code)
        if code in "Hh":
            out[at : at + size] = out[at : at + size][::-1]
        at += size
    return bytes(out)


class Traffic:
    """Transfers of some nodes in the order sent, with running transfer IDs and frame counts."""

    def __init__(self) -> None:
        self.frames: list[encode.Frame] = []
        self._ids: dict[Any, int] = {}

    def _next(self, *key: Any) -> int:
        self._ids[key] = self._ids.get(key, -1) + 1
        return self._ids[key]

    def send(self, name: str, fields: dict[str, Any], node: int, bus: str = "can0", *, broken: bool = False) -> None:
        frames = encode.transfer(name, fields, node, self._next(name, node, bus)).frames(bus=bus)
        if broken:
            data = frames[-1].data
            frames[-1] = encode.Frame(frames[-1].id, bytes([data[0] ^ 0x10]) + data[1:], bus=bus)
        self.frames += frames

    def status(self, node: int, voltage: float = 48.5, rpm: int = 3011, **more: Any) -> None:
        self.send("ESCStatus", STATUS | {"voltage": voltage, "rpm": rpm}, node, **more)

    def push(self, node: int, *packets: bytes, name: str = "PUSHCAN", **more: Any) -> None:
        fields = {"data_sequence": self._next("sequence", node), "data": list(b"".join(packets))}
        self.send(name, fields, node, **more)

    def motor(self, node: int, *, big: bool = False, unit: int = UNIT, bus: str = "can0", **values: int) -> None:
        whole = encode.packet("PUSHCAN.MotorStatus", self._next("count", node, unit), unit, **(MOTOR | values))
        self.push(node, turned("PUSHCAN.MotorStatus", whole) if big else whole, bus=bus)

    @property
    def log(self) -> bytes:
        return lines(self.frames)


def packets(traffic: Traffic, decode: Callable[..., Any], name: str = "PUSHCAN.MotorStatus") -> list[dict[str, Any]]:
    return decode(traffic.log).messages[name]


def of(rows: Iterable[dict[str, Any]], node: int, column: str) -> list[Any]:
    return [row[column] for row in rows if row["src"] == node]


# ---- byte order (PUSH-010) ------------------------------------------------------------------------------------------


def test_a_node_is_read_big_endian_behind_its_third_proof(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(6):
        for node in (10, 11):
            traffic.status(node)
            traffic.motor(node, big=node == 11)
    feedback = encode.packet("PUSHCAN.FocFeedback", 6, UNIT, report_rate=50, hardware_version=b"V1", led=0x0123)
    for node in (10, 11):
        traffic.push(node, turned("PUSHCAN.FocFeedback", feedback) if node == 11 else feedback)
    got = decode(traffic.log).messages
    rows = got["PUSHCAN.MotorStatus"]
    assert of(rows, 10, "big_endian") == [False] * 6
    assert of(rows, 11, "big_endian") == [False] * 3 + [True] * 3
    assert of(rows, 10, "voltage") == [48.5] * 6
    assert of(rows, 11, "voltage") == [618.58] * 3 + [48.5] * 3
    assert {row["packet_ok"] for row in rows} == {True}
    for row in [*[r for r in rows if r["src"] == 10], *[r for r in rows if r["src"] == 11][3:]]:
        shown = (row["speed"], row["current"], row["temperature"], row["position"], row["pwm"])
        assert shown == pytest.approx((3011, -1.2, 41.0, 12.34, 1500.0))
    # What is settled holds for every packet of the node, and for nothing but its numbers.
    for row in got["PUSHCAN.FocFeedback"]:
        assert row["big_endian"] == (row["src"] == 11)
        assert (row["report_rate"], row["led"], row["hardware_version.text"]) == (50, 0x0123, "V1")


def flags(traffic: Traffic, decode: Callable[..., Any], node: int = 11) -> list[bool]:
    return of(packets(traffic, decode), node, "big_endian")


def test_without_a_status_a_node_stays_little_endian(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(6):
        traffic.status(10)
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


def test_one_proof_of_little_endian_settles_a_node(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for big in (True, True, False, True, True, True, True):
        traffic.status(11)
        traffic.motor(11, big=big)
    assert flags(traffic, decode) == [False] * 7


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
    rows = packets(traffic, decode)
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
    rows = packets(traffic, decode)
    assert [[r["big_endian"] for r in rows if r["bus"] == bus] for bus in (0, 1)] == [[False] * 5, [False] * 3 + [True] * 2]


def test_a_truncated_packet_is_turned_as_far_as_it_goes(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(3):
        traffic.status(11)
        traffic.motor(11, big=True)
    traffic.push(11, turned("PUSHCAN.MotorStatus", encode.packet("PUSHCAN.MotorStatus", 3, UNIT, **MOTOR))[:17])
    row = packets(traffic, decode)[-1]
    assert (row["big_endian"], row["complete"], row["packet_ok"]) == (True, False, False)
    assert (row["pwm"], row["speed"], row["voltage"], row["current"]) == (1500.0, 3011, 48.5, None)
    assert row["runtime.unwrapped"] is None


def mixed() -> Traffic:
    traffic = Traffic()
    for step in range(5):
        for node in (10, 11):
            traffic.status(node, voltage=48.5 - step / 8)
            runtime = (65530 + 3 * step) % 65536
            traffic.motor(node, big=node == 11, voltage=4850 - step * 12, runtime=runtime)
    return traffic


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
WIDE = "uint8[5] head\nuint24 level\nuint16[2] pair\nfloat32 ratio\nuint4 low\nuint12 odd\nint32 deep\nuint8 sum"


def vendor(folder: Path, family: str) -> Path:
    (folder / "profile.toml").write_text(PROFILE)
    (folder / "push.toml").write_text(family)
    (folder / "20101.Meter.uavcan").write_text("uint32 level\nbool on\nvoid7")
    (folder / "20102.Push.uavcan").write_text("uint8[<=60] data")
    (folder / "Wide.uavcan").write_text(WIDE)
    return folder


def test_byte_order_and_wraps_come_from_the_profile(tmp_path: Path, decode: Callable[..., Any]) -> None:
    agree = 'field.level = { scale = 10, unit = "l", wraps = true, agrees = { with = "Meter.level", within = "1/1000" } }'
    types = dissectors.load([vendor(tmp_path, FAMILY + agree)])
    signature = {number: types.signatures(0, number)[0] for number in (20101, 20102)}
    frames = []
    for k in range(5):
        level = (0xFFFFF0 + 8 * k) % (1 << 24)
        body = bytes([0x55, 7, k, 1, 25]) + level.to_bytes(3, "big") + struct.pack(">HHf", 1, 515, 0.5)
        body += bytes([0x12, 0x34]) + struct.pack(">i", -5)
        whole = body + bytes([sum(body) & 0xFF])
        meter = struct.pack("<IB", level * 10, 0)
        for number, payload in ((20101, meter), (20102, whole)):
            frames += encode.Transfer("message", number, 9, payload, signature[number], k).frames()
    rows = decode(lines(frames), types=types).messages["Push.Wide"]
    assert [row["big_endian"] for row in rows] == [False] * 3 + [True] * 2
    assert [row["level"] for row in rows[3:]] == [80.0, 160.0]
    assert [row["level.unwrapped"] for row in rows[3:]] == [80.0, 160.0]
    assert {(tuple(row["pair"]), row["ratio"], row["deep"]) for row in rows[3:]} == {((1, 515), 0.5, -5)}
    assert len({(row["low"], row["odd"], row["sum"] - row["head"][2]) for row in rows[1:3]}) >= 1
    assert {(row["low"], row["odd"]) for row in rows} == {(1, 0x342)}  # no whole bytes: never turned


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
        ("level = { agrees = { with = 'Meter.level', within = 0, by = 1 } }", "by: unknown key (allowed: with, within)"),
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
    with pytest.raises(dissectors.ProfileError, match=r":9: .*wraps: unknown key"):
        dissectors.load([folder])


# ---- counters that wrap (PUSH-407) ----------------------------------------------------------------------------------


def test_runtime_goes_on_over_its_wrap_and_begins_anew_at_a_restart(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for first, second in ((65000, 7), (65535, 8), (0, 9), (40, 3), (39, 4), (60000, 5), (10, 6)):
        traffic.motor(10, runtime=first)
        traffic.motor(10, unit=0xA2, runtime=second)
    damaged = bytearray(encode.packet("PUSHCAN.MotorStatus", 9, UNIT, runtime=3000))
    damaged[10] ^= 1
    traffic.push(10, bytes(damaged))
    traffic.motor(10, runtime=3000)
    rows = packets(traffic, decode)
    one = [(row["runtime"], row["runtime.unwrapped"]) for row in rows if row["unit"] == 1]
    # A step down by one second is a restart: the wraps before it belong to another life.
    assert one[:7] == [(65000, 65000), (65535, 65535), (0, 65536), (40, 65576), (39, 39), (60000, 60000), (10, 65546)]
    assert one[7:] == [(3000, None), (3000, 68536)]
    assert [row["runtime.unwrapped"] for row in rows if row["unit"] == 2] == [7, 8, 9, 3, 4, 5, 6]


def test_what_was_read_in_the_wrong_order_is_no_part_of_the_runtime(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for runtime in (0x00F0, 0x00FE, 0x0102, 0x0103, 0x0104):
        traffic.status(11)
        traffic.motor(11, big=True, runtime=runtime)
    assert of(packets(traffic, decode), 11, "runtime.unwrapped")[3:] == [0x0103, 0x0104]


def test_the_unwrapped_column_says_what_it_is(decode: Callable[..., Any]) -> None:
    schema = decode(mixed().log).batches[-1].messages["PUSHCAN.MotorStatus"].schema
    about = schema.field("runtime.unwrapped").metadata
    assert (about[b"unit"], about[b"source"], about[b"clause"]) == (b"s", b"runtime", b"4.4.5 table 1 no 26-27")


def slowly(counters: list[int], raw: list[int], bits: int) -> list[int]:
    last: dict[int, tuple[int, int]] = {}
    out = []
    for name, value in zip(counters, raw, strict=True):
        before, wrapped = last.get(name, (value, 0))
        if before - value > 1 << bits - 1:
            wrapped += 1 << bits
        elif value < before:
            wrapped = 0
        last[name] = value, wrapped
        out.append(value + wrapped)
    return out


@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from([0, 1, 7, 8, 9, 14, 15])), max_size=60), st.integers(0, 60))
def test_unwrapping_many_counters_at_once(rows: list[tuple[int, int]], cut: int) -> None:
    unwrapper = Unwrapper(4)
    out: list[int] = []
    for part in (rows[:cut], rows[cut:]):
        columns = np.array(part, np.uint32).reshape(-1, 2).T
        out += unwrapper.follow(columns[0], columns[1]).tolist()
    assert out == slowly([name for name, _ in rows], [value for _, value in rows], 4)


# ---- verdicts in columns --------------------------------------------------------------------------------------------


def test_the_sum_of_set_foc_parameters_ends_at_30_or_28(decode: Callable[..., Any]) -> None:
    """DEVIATION 4.4.4: both ranges are accepted, and the longer one named when they agree (PUSH-005, PUSH-006)."""
    same = {"report_rate": 0, "save_option": 0}
    traffic = Traffic()
    for end, values in ((30, {}), (28, {}), (None, same), (27, {})):
        values = {"esc_id": 3, "report_rate": 300, "save_option": 1, "bus_rate": 5} | values
        traffic.push(1, encode.packet("PUSHSCI.FocParameters", 0, UNIT, end, **values), name="PUSHSCI")
    rows = packets(traffic, decode, "PUSHSCI.FocParameters")
    assert [row["checksum_end"] for row in rows] == [30, 28, 30, None]
    assert [row["checksum_ok"] for row in rows] == [True, True, True, False]
    assert [row["packet_ok"] for row in rows] == [True, True, True, False]
    assert {row["length_ok"] for row in rows} == {True}


def test_other_sums_end_before_the_checksum(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for name in encode.PACKETS:
        carrier, _, kind = name.partition(".")
        traffic.push(1, encode.packet(name, 0, UNIT), name=carrier)
    got = decode(traffic.log).messages
    found = {name: got[name][0] for name in encode.PACKETS}
    assert {name: row["checksum_end"] for name, row in found.items()} == {
        "PUSHSCI.SetZero": 6, "PUSHSCI.FocParameters": 30, "PUSHSCI.FocQuery": 6, "PUSHSCI.OutputControl": 11,
        "PUSHCAN.MotorStatus": 27, "PUSHCAN.FocFeedback": 54,
    }  # fmt: skip
    # Without a number of two bytes there is no byte order to speak of.
    assert {name for name, row in found.items() if "big_endian" not in row} == {"PUSHSCI.SetZero", "PUSHSCI.FocQuery"}
    assert {row.get("big_endian", False) for row in found.values()} == {False}


def test_a_wrong_length_field_and_the_header_of_the_other_direction(decode: Callable[..., Any]) -> None:
    wrong = bytearray(encode.packet("PUSHCAN.MotorStatus", 0, UNIT))
    wrong[5] += 1
    wrong[-1] = (wrong[-1] + 1) % 256
    traffic = Traffic()
    traffic.push(10, bytes(wrong))
    traffic.push(10, encode.packet("PUSHSCI.SetZero", 0, UNIT))
    traffic.push(1, encode.packet("PUSHCAN.MotorStatus", 0, UNIT), name="PUSHSCI")
    got = decode(traffic.log).messages
    assert set(got) == {
        "PUSHSCI", "PUSHCAN", "PUSHCAN.MotorStatus", "PUSHCAN.SetZero", "PUSHSCI.MotorStatus"
    }  # fmt: skip
    verdict = ("header_ok", "length_ok", "checksum_ok", "packet_ok")
    assert [got["PUSHCAN.MotorStatus"][0][name] for name in verdict] == [True, False, True, False]
    assert [got["PUSHCAN.SetZero"][0][name] for name in verdict] == [False, True, True, True]
    assert [got["PUSHSCI.MotorStatus"][0][name] for name in verdict] == [False, True, True, True]


def test_every_byte_is_in_a_packet_or_unrecognized(decode: Callable[..., Any]) -> None:
    motor = encode.packet("PUSHCAN.MotorStatus", 0, UNIT)
    unknown = bytes([0x7B, 0x8C, 0x77, 1, UNIT, 9, 1, 2, 3])
    traffic = Traffic()
    traffic.push(10, motor, b"\x01\x02\x03", motor)
    traffic.push(10, unknown)
    traffic.push(10, motor[:2])
    traffic.push(10, motor, motor[:20])
    traffic.push(10, b"")
    got = decode(traffic.log).messages
    assert [(row["transfer"], row["offset"], row["complete"]) for row in got["PUSHCAN.MotorStatus"]] == [
        (0, 0, True), (0, 31, True), (3, 0, True), (3, 28, False)
    ]  # fmt: skip
    assert [
        (row["transfer"], row["offset"], row["reason"], row["data"]) for row in got["PUSHCAN.unrecognized"]
    ] == [
        (0, 28, "no header", b"\x01\x02\x03"), (1, 0, "unknown frame id", unknown), (2, 0, "truncated", motor[:2])
    ]  # fmt: skip
    short = got["PUSHCAN.MotorStatus"][-1]
    assert (short["packet_ok"], short["checksum_ok"], short["checksum_end"], short["runtime"]) == (False, False, None, None)


def test_frame_counts_step_by_unit_and_by_packet_id(decode: Callable[..., Any]) -> None:
    sent = [("FocFeedback", 254, 0xA1), ("MotorStatus", 255, 0xA1), ("MotorStatus", 7, 0xA2), ("MotorStatus", 0, 0xA1),
            ("MotorStatus", 2, 0xA1), ("MotorStatus", 7, 0xA2), ("FocFeedback", 3, 0xA1)]  # fmt: skip
    traffic = Traffic()
    for name, count, unit in sent:
        traffic.push(10, encode.packet(f"PUSHCAN.{name}", count, unit))
    traffic.push(11, encode.packet("PUSHCAN.MotorStatus", 9, 0xA1))
    got = decode(traffic.log).messages
    rows = sorted([*got["PUSHCAN.MotorStatus"], *got["PUSHCAN.FocFeedback"]], key=lambda row: row["transfer"])
    assert [row["count_step"] for row in rows] == [None, 1, None, 1, 2, 0, 1, None]
    assert [row["count_step_id"] for row in rows] == [None, None, None, 1, 2, 0, 5, None]


# ---- length prefixes on classic CAN (TYP-006) ------------------------------------------------------------------------


def test_a_push_message_with_its_length_in_front(decode: Callable[..., Any]) -> None:
    motor = encode.packet("PUSHCAN.MotorStatus", 0, UNIT, **MOTOR)
    zero = encode.packet("PUSHSCI.SetZero", 0, UNIT)
    traffic = Traffic()
    for name, packet in (("PUSHCAN", motor), ("PUSHSCI", zero)):
        traffic.push(10, bytes([len(packet)]), packet, name=name)
        traffic.push(10, packet, name=name)
        traffic.push(10, bytes([len(packet) + 1]), packet, name=name)  # counts something else: data like any other
    got = decode(traffic.log).messages
    for name, packet in (("PUSHCAN", motor), ("PUSHSCI", zero)):
        assert [(row["layout"], bytes(row["data"])) for row in got[name]] == [
            (1, packet), (0, packet), (0, bytes([len(packet) + 1]) + packet)
        ]  # fmt: skip
    assert [row["offset"] for row in got["PUSHCAN.MotorStatus"]] == [0, 0, 1]
    assert {row["voltage"] for row in got["PUSHCAN.MotorStatus"]} == {48.5}


def prefixed(name: str, fields: dict[str, Any], width: int) -> encode.Transfer:
    """With a length field of `width` bits in front of the tail array."""
    kind = encode.TYPES[name]
    head, _, array = kind.layout.rpartition(" ")
    field, base = array.split(":")[0], array.split(":")[1].partition("[")[0]
    bits = encode.encode(head, fields, tail=False) + encode.scalar(f"u{width}", len(fields[field]))
    bits += "".join(encode.scalar(base, value) for value in fields[field])
    return encode.Transfer(kind.kind, kind.type_id, 10, encode.to_bytes(bits), kind.signature)


PARAM = {
    "esc_index": 3, "esc_uuid": 0xDEADBEEF, "esc_id_req": 3, "esc_ov_threshold": 60, "esc_oc_threshold": 200,
    "esc_ot_threshold": 110, "esc_acc_threshold": 1000, "esc_dacc_threshold": 900, "esc_rotate_dir": -1,
    "esc_timing": 12, "esc_startup_times": 9, "esc_startup_duration": 3600, "esc_product_date": 20240131,
    "esc_error_count": 2, "esc_signal_priority": 1, "esc_led_mode": 0x0123, "esc_can_rate": 0, "esc_fdb_rate": 50,
    "esc_save_option": 1,
}  # fmt: skip
CHANNELS = [8191, -8191, 0, 1, -1, *range(100, 1600, 100)]


@pytest.mark.parametrize(
    ("name", "fields", "width", "size", "layout"),
    [
        ("ParamGet", {"rsvd": list(range(200, 232))}, 0, 73, 0),
        ("ParamGet", {"rsvd": list(range(200, 232))}, 6, 74, 1),
        ("ParamGet", {"rsvd": list(range(200, 232))}, 8, 74, 2),
        ("RawCommand", {"cmd": CHANNELS}, 0, 35, 0),
        ("RawCommand", {"cmd": CHANNELS}, 5, 36, 1),
        ("RawCommand", {"cmd": CHANNELS}, 8, 36, 2),
        ("RawCommand", {"cmd": CHANNELS[:8]}, 5, 15, 1),
        ("RawCommand", {"cmd": CHANNELS[:4]}, 8, 8, 2),
    ],
)
def test_the_printed_maxima_have_a_length_in_front(
    decode: Callable[..., Any], name: str, fields: dict[str, Any], width: int, size: int, layout: int
) -> None:
    fields = PARAM | fields if name == "ParamGet" else fields
    sent = prefixed(name, fields, width) if width else encode.transfer(name, fields, 10)
    assert len(sent.payload) == size
    got = decode(lines(sent.frames()))
    (row,) = got.messages[name]
    assert (row["layout"], row["trusted"], row["pad_nonzero"]) == (layout, True, False)
    assert 0 <= row["bits_left"] < 8
    assert differing(fields, row) == {}
