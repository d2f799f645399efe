"""Packets inside PUSHSCI and PUSHCAN: header, length, checksum and count in columns; lengths in front of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MOTOR, UNIT, Traffic, differing, lines

if TYPE_CHECKING:
    from collections.abc import Callable


def test_the_sum_of_set_foc_parameters_ends_at_30_or_28(decode: Callable[..., Any]) -> None:
    """DEVIATION 4.4.4: both ranges are accepted, and the longer one named when they agree (PUSH-005, PUSH-006)."""
    same = {"report_rate": 0, "save_option": 0}
    traffic = Traffic()
    usual = {"esc_id": 3, "report_rate": 300, "save_option": 1, "bus_rate": 5}
    for end, values in ((30, usual), (28, usual), (None, usual | same), (27, usual)):
        traffic.push(1, encode.packet("PUSHSCI.FocParameters", 0, UNIT, end, **values), name="PUSHSCI")
    rows = decode(traffic.log).messages["PUSHSCI.FocParameters"]
    assert [row["checksum_end"] for row in rows] == [30, 28, 30, None]
    assert [row["checksum_ok"] for row in rows] == [True, True, True, False]
    assert [row["packet_ok"] for row in rows] == [True, True, True, False]
    assert {row["length_ok"] for row in rows} == {True}


def test_other_sums_end_before_the_checksum(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for name in encode.PACKETS:
        traffic.push(1, encode.packet(name, 0, UNIT), name=name[:7])
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
    assert [short[name] for name in ("packet_ok", "checksum_ok", "checksum_end", "runtime")] == [
        False,
        False,
        None,
        None,
    ]


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
    head, _, array = kind.layout.strip().rpartition(" ")
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
