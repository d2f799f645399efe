"""The built-in profiles say what the document says."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit import VECTORS

from dissectors.profile import Profile

if TYPE_CHECKING:
    from dissectors.schema import Derived, Message, Packet

BUILT_IN = Path(find_spec("dissectors").origin).parent


@pytest.fixture(scope="module")
def messages() -> dict[str, Message]:
    return {message.name: message for message in Profile.open(BUILT_IN / "tmotor").dissector().messages}


@pytest.fixture(scope="module")
def packets(messages: dict[str, Message]) -> dict[str, Packet]:
    return {
        f"{message.name}.{packet.name}": packet
        for message in messages.values()
        if message.packets
        for packet in message.packets.packets
    }


@pytest.fixture(scope="module")
def everything(messages: dict[str, Message], packets: dict[str, Packet]) -> dict[str, Message | Packet]:
    return {**messages, **packets}


def derive(column: Derived, raw: float) -> float:
    """A derived value as the schema defines it."""
    value = Fraction(raw) * column.scale + column.offset
    for piece in column.pieces:
        if (piece.start is None or piece.start <= value) and (piece.stop is None or value < piece.stop):
            return float(value + piece.add)
    return float(value)


def derived(of: Message | Packet, name: str) -> Derived:
    return next(column for column in of.derived if column.name == name)


def test_payload_sizes_of_the_document(messages: dict[str, Message]) -> None:
    """The maxima of 4.3.1 count a length field; classic CAN has none."""
    sizes = {name: (m.min_bytes, m.max_bytes, m.max_bytes_with_length) for name, m in messages.items()}
    assert sizes == {
        "RawCommand": (0, 35, 36),
        "ParamCfg": (27, 27, 27),
        "ESCStatus": (14, 14, 14),
        "PUSHSCI": (4, 259, 260),
        "PUSHCAN": (4, 259, 260),
        "ParamGet": (41, 73, 74),
    }
    assert messages["RawCommand"].min_bytes_with_length == 1
    assert {name for name, message in messages.items() if message.prefix} == {
        *("RawCommand", "PUSHSCI", "PUSHCAN", "ParamGet")
    }


def test_packets_of_the_document(packets: dict[str, Packet]) -> None:
    assert {name: (packet.id, packet.length, packet.checksum_ends) for name, packet in packets.items()} == {
        "PUSHSCI.SetZero": (0x08, 7, (6,)),
        "PUSHSCI.FocParameters": (0x1E, 31, (30, 28)),
        "PUSHSCI.FocQuery": (0x1A, 7, (6,)),
        "PUSHSCI.OutputControl": (0x06, 12, (11,)),
        "PUSHCAN.MotorStatus": (0x15, 28, (27,)),
        "PUSHCAN.FocFeedback": (0x1E, 55, (54,)),
    }


def rows(first: str, last: str) -> set[int]:
    return set(range(int(first), int(last or first) + 1))


def test_every_field_has_its_row_and_the_rows_are_the_bytes(
    messages: dict[str, Message], packets: dict[str, Packet]
) -> None:
    """The document numbers rows by byte, so the clauses of a fixed layout must name each of its bytes."""
    fixed = [messages[name] for name in ("ParamCfg", "ESCStatus", "ParamGet")]
    for of in [*messages.values(), *packets.values()]:
        assert re.fullmatch(r"4\.4\.[1-6]( table [1-4])?", of.clause)
        assert of.summary
        for member in of.layout.fields:
            assert of.notes[member.name].clause.startswith(of.clause), (of.name, member.name)
        for part in (part for note in of.notes.values() for part in note.parts):
            assert part.clause
    for of in [*fixed, *packets.values()]:
        position = 0
        for member in of.layout.fields:
            first, last = position // 8 + 1, (position + member.type.max_bits - 1) // 8 + 1
            clause = of.notes[member.name].clause
            match = re.fullmatch(re.escape(of.clause) + r" no (\d+)(?:-(\d+))?", clause)
            assert match, clause
            if member.name != "rsvd":
                assert rows(match[1], match[2]) == rows(str(first), str(last)), (of.name, member.name)
            position += member.type.max_bits


def test_status_word(messages: dict[str, Message]) -> None:
    note = messages["ESCStatus"].notes["error_count"]
    assert note.name == "status"
    assert [(part.name, part.low, part.high) for part in note.parts] == [
        *(("over_voltage", 0, 0), ("under_voltage", 1, 1), ("over_current", 2, 2), ("throttle_loss", 3, 3)),
        *(("throttle_abnormal", 4, 4), ("mos_over_temperature", 5, 5), ("capacitor_over_temperature", 6, 6)),
        *(("stall", 7, 7), ("amplifier_fault", 8, 8), ("upper_bridge_fault", 9, 9), ("lower_bridge_fault", 10, 10)),
        *(("encoder_error", 11, 11), ("mode", 12, 15), ("encoder", 16, 31)),
    ]
    mode, encoder = note.parts[-2:]
    assert list(mode.enum.items())[3:6] == [(4, "operating"), (5, "coast down"), (6, "error")]
    assert (mode.low_limit, mode.high_limit) == (1, 8)
    assert encoder.scale is not None
    assert encoder.scale * 4096 == 90
    assert all(part.flag for part in note.parts[:12])
    assert not any(part.tentative for part in note.parts)


def test_fault_word_of_the_packet_is_tentative(messages: dict[str, Message], packets: dict[str, Packet]) -> None:
    parts = packets["PUSHCAN.MotorStatus"].notes["fault"].parts
    assert [part.name for part in parts] == [
        part.name for part in messages["ESCStatus"].notes["error_count"].parts[:12]
    ]
    assert all(part.tentative for part in parts)


@pytest.mark.parametrize(
    ("name", "column", "raw", "value"),
    [
        ("RawCommand", "percent", 8191, 100),
        ("RawCommand", "percent", -8191, -100),
        ("RawCommand", "pulse_uav_us", 0, 1040),
        ("RawCommand", "pulse_uav_us", 8191, 1940),
        ("RawCommand", "pulse_spraying_us", 0, 1050),
        ("RawCommand", "pulse_spraying_us", 8191, 1950),
        ("ESCStatus", "channel", 4, 5),
        ("ESCStatus", "temperature_celsius", 199.875, 199.875),
        ("ESCStatus", "temperature_celsius", 200, -73.15),
        ("ESCStatus", "temperature_celsius", -20, -20),
        ("PUSHCAN.MotorStatus", "unit", 0xA9, 9),
        ("PUSHCAN.MotorStatus", "temperature_celsius", 4512, 45.12),
        ("PUSHCAN.MotorStatus", "temperature_celsius", 23314, 233.14),
        ("PUSHCAN.MotorStatus", "temperature_celsius", 23315, -40),
        ("PUSHCAN.MotorStatus", "temperature_celsius", 47315, 200),
        ("PUSHCAN.MotorStatus", "temperature_celsius", 65536 - 1000, -10),
    ],
)
def test_derived_columns(
    everything: dict[str, Message | Packet], name: str, column: str, raw: float, value: float
) -> None:
    assert derive(derived(everything[name], column), raw) == value


def test_readings(messages: dict[str, Message]) -> None:
    dialect, temperature = messages["ESCStatus"].readings
    assert (dialect.name, dialect.field, dialect.choices) == ("dialect", "error_count", ("tm", "dronecan"))
    assert dialect.evidence[1].sends == ("PUSHCAN", "ParamGet")
    assert [(one.choice, one.low, one.stop, one.every) for one in temperature.evidence] == [
        ("K", 200, 500, True),
        ("degC", -60, 200, True),
        ("degC", 100, 200, False),
    ]
    assert dialect.noted == "tm"
    assert messages["ESCStatus"].derived[0].by_choice == {"degC": 0, "K": Fraction("-273.15")}


def test_only_the_query_addresses_all_units(packets: dict[str, Packet]) -> None:
    """What all packets have in common stands once; a packet's own note of a field replaces it."""
    for name, packet in packets.items():
        note = packet.notes["unit_id"]
        assert (note.low, note.high) == (0xA1, 0xA9)
        assert note.special == ({0xFF: "all"} if name == "PUSHSCI.FocQuery" else {})


def test_set_point_follows_the_mode(packets: dict[str, Packet]) -> None:
    """All 14 modes are named; the ten that move something give the set point its unit."""
    notes = packets["PUSHSCI.OutputControl"].notes
    by = notes["set_point"].unit_by
    assert by is not None
    assert by.field == "control_mode"
    assert len(notes["control_mode"].enum) == 14
    assert set(notes["control_mode"].enum) - set(by.table) == {0x00, 0xEE, 0x22, 0x66}
    assert {measure.unit for measure in by.table.values()} == {"deg", "%", "A", "rpm"}
    full = {measure.unit: measure.high * (measure.scale or 1) for measure in by.table.values()}
    assert full == {"deg": 360, "%": 100, "A": 100, "rpm": 10000}


def test_no_change_is_not_a_number(messages: dict[str, Message]) -> None:
    """4.4.2: in a query every field of ParamCfg is all ones, and each of them says so."""
    note = messages["ParamCfg"].notes
    for member in messages["ParamCfg"].layout.fields:
        ones = -1 if member.type.kind == "int" else (1 << member.type.bits) - 1
        assert ones in note[member.name].special, member.name
    assert note["esc_id_set"].special == {0xFFFF: "no change"}
    assert messages["ParamGet"].notes["esc_id_req"].special == {0x00FF: "all", 0xFFFF: "all"}
    assert 0x00FF not in note["esc_fdb_rate"].special


def test_golden_packets_have_the_layout(messages: dict[str, Message], packets: dict[str, Packet]) -> None:
    """Header, id, length and checksum of every golden packet stand where the profile says."""
    seen = set()
    for vector in json.loads((VECTORS / "tm_golden.json").read_text()):
        family = messages[vector["type"]].packets
        data = bytes(vector["fields"].get("data", b""))
        if family is None or not data.startswith(family.header):
            continue
        packet = next(one for one in family.packets if one.id == data[family.id_at])
        seen.add(f"{vector['type']}.{packet.name}")
        assert packet.length == data[family.length_at] == len(data)
        assert any(sum(data[:end]) & 0xFF == data[-1] for end in packet.checksum_ends)
    assert seen == set(packets)


def test_deviations_are_marked_with_their_clause() -> None:
    texts = [path.read_text() for path in (BUILT_IN / "tmotor").rglob("*.toml")]
    marks = [mark for text in texts for mark in re.findall(r"DEVIATION(.*)", text)]
    assert len(marks) >= 15
    assert all(re.match(r" [45]\.\d(\.\d)?: \S", mark) for mark in marks)


def test_the_standard_profile_compiles_and_fits_every_type() -> None:
    standard = Profile.open(BUILT_IN / "dronecan").dissector()
    assert len(standard.messages) == 97 + 2 * 29
    by_table = {message.table: message for message in standard.messages}
    assert by_table["uavcan.protocol.NodeStatus"].notes["health"].enum[3] == "critical"
    info = by_table["uavcan.protocol.GetNodeInfo.Response"]
    assert info.notes["name"].text
    assert info.notes["status.mode"].enum[7] == "offline"
    assert info.notes["software_version.image_crc"].hex
