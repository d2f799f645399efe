"""Profiles: the built-in ones say what the document says, and every mistake is reported with file, line and remedy."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dissectors import template, toml_table
from dissectors.dsdl import DsdlError
from dissectors.profile import Profile, ProfileError
from dissectors.schema import Derived, Message, Packet

BUILT_IN = Path(find_spec("dissectors").origin).parent
VECTORS = Path(__file__).parent / "vectors"


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
    ]


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
    assert note["esc_id_set"].special == {0x00FF: "all", 0xFFFF: "all"}
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
    marks = re.findall(r"DEVIATION(.*)", (BUILT_IN / "tmotor" / "profile.toml").read_text())
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


GOOD = """\
name = "acme"

[enum.Colour]
1 = "red"

[message.Ping]
dsdl = "20100.Ping.uavcan"
type = "acme.Ping"
summary = "{a} {twice:.1f}"

[message.Ping.field.a]
enum = "Colour"
bits = { low = "x" }

[message.Ping.derived.twice]
source = "a"
scale = 2
"""


def write(folder: Path, profile: str, dsdl: str = "uint8 a\nfloat16 f\nbool b\nuint8[<=9] list\nvoid5") -> Path:
    folder.mkdir()
    (folder / "profile.toml").write_text(profile)
    (folder / "20100.Ping.uavcan").write_text(dsdl)
    (folder / "Bad.uavcan").write_text("uint7 a")
    (folder / "Good.uavcan").write_text("uint8[2] head\nuint8 id\nuint8 sum")
    return folder


FIELD = '[message.Ping]\ndsdl = "20100.Ping.uavcan"\ntype = "acme.Ping"\n\n[message.Ping.field.a]\n'
PACKETS = (
    FIELD.replace("field.a", "packets") + 'carrier = "list"\nheader = [1, 2]\nid_at = 2\ncount_at = 2\nunit_at = 2\n'
)


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("x", 1, "Expected '='"),
        ("name = 1", 1, "a text is expected, not 1"),
        ("\nnaem = 'x'", 2, "naem: unknown key (allowed: "),
        ("[enum.A]\nx = 'y'", 2, "whole number is expected"),
        ("[enum.A]\n1 = 'y'\n0x01 = 'z'", 3, "two texts"),
        ("[message.Ping]\ndsdl = 'gone.uavcan'", 2, "no such file"),
        ("[message.Ping]\n", 1, "no definition file for Ping"),
        ("[type.'a.B']", 1, "no definition file for a.B"),
        (FIELD.replace("field.a", "field.z"), 5, "no such field (allowed: a, f, b, list)"),
        (FIELD + "unti = 'V'", 6, "unti: unknown key (allowed: bits, clause, enum, hex"),
        (FIELD + "enum = 'Gone'", 6, "'Gone' is unknown"),
        (FIELD + "enum = { 256 = 'x' }", 6, "8 bits cannot hold"),
        (FIELD + "scale = 0", 6, "cannot be zero"),
        (FIELD + "scale = '1/0'", 6, "division by zero"),
        (FIELD + "scale = 'one'", 6, "is no number"),
        (FIELD + "scale = true", 6, "a number is expected, not True"),
        (FIELD + "low = 3\nhigh = 2", 6, "low is above high"),
        (FIELD + "text = true", 6, "only an array of uint8"),
        (FIELD + "[message.Ping.field.a.bits]\nstall = 8", 7, "bit 8 is outside the field's 8 bits"),
        (FIELD + "[message.Ping.field.a.bits]\nx = { at = '0-3' }\ny = 3", 8, "bit 3 belongs to x already"),
        (FIELD + "[message.Ping.field.a.bits]\nx = { at = '3-1' }", 7, "low to high"),
        (FIELD + "[message.Ping.field.a.bits]\nx = { at = 'a' }", 7, "'3' or '12-15'"),
        (FIELD + "[message.Ping.field.a.bits]\nx = { at = '0', enum = { 2 = 'z' } }", 7, "1 bits cannot hold"),
        (FIELD.replace("field.a", "field.f") + "bits = { x = 0 }", 6, "only a single unsigned number"),
        (FIELD.replace("field.a", "field.f") + "enum = { 0 = 'x' }", 6, "only a whole number"),
        (FIELD + "unit_by.z.1 = { unit = 'V' }", 6, "no unsigned field"),
        (FIELD.replace("field.a", "derived.d") + "scale = 1", 5, "source is missing"),
        (FIELD.replace("field.a", "derived.d") + "source = 'z'", 6, "is no number of acme.Ping"),
        (FIELD.replace("field.a", "derived.a") + "source = 'a'", 5, "a name of its own"),
        (FIELD.replace("field.a", "derived.d") + "source = 'a'\npieces = [{ start = 1 }]", 7, "add is missing"),
        (FIELD.replace("\n\n", "\nsummary = '{z}'\n"), 4, "no column 'z' (allowed: a, b, f, list)"),
        (FIELD.replace("\n\n", "\nsummary = '{a!r}'\n"), 4, "is not {column}"),
        (FIELD.replace("\n\n", "\nsummary = '{'\n"), 4, "summary: "),
        (FIELD.replace("\n\n", "\nsummary = '{f:x}'\n"), 4, "'x' does not suit f"),
        (FIELD.replace("\n\n", "\nsummary = '{a:.1f}'\n") + "enum = { 1 = 'x' }", 4, "'.1f' does not suit a"),
        (FIELD.replace("field.a", "reading.r") + "field = 'a'\nchoices = ['x', 'y']", 5, "and evidence"),
        (PACKETS + "length_at = 2\nfoo = 1", 12, "foo: unknown key"),
        (PACKETS, 5, "all needed"),
        (PACKETS.replace("list", "a") + "length_at = 2", 6, "no byte array"),
        (PACKETS + "length_at = 2\n[message.Ping.packet.P]\nid = 1\ndsdl = 'Bad.uavcan'", 14, "2 to 255 whole bytes"),
        (PACKETS + "length_at = 2\n[message.Ping.packet.P]\nid = 1\ndsdl = 'no.uavcan'", 14, "no such file"),
        (PACKETS + "length_at = 2\n[message.Ping.packet.P]\ndsdl = 'Good.uavcan'", 12, "id is missing"),
        (PACKETS + "length_at = 9\n[message.Ping.packet.P]\nid = 1\ndsdl = 'Good.uavcan'", 14, "shorter than"),
        (
            PACKETS + "length_at = 2\n[message.Ping.packet.P]\nid = 1\ndsdl = 'Good.uavcan'\nchecksum_ends = [4]",
            15,
            "1 to 3",
        ),
        (FIELD.replace("message", "request"), 1, "is a message"),
        ("tree = 'gone'", 1, "no such folder"),
        ("package = 'no_such_package_here/x'", 1, "no installed package"),
    ],
)
def test_mistakes_are_reported_with_line_and_remedy(tmp_path: Path, text: str, line: int, reason: str) -> None:
    folder = write(tmp_path / "acme", text)
    with pytest.raises(ProfileError) as caught:
        Profile.open(folder).dissector()
    assert caught.value.file == str(folder / "profile.toml")
    assert (caught.value.line, reason in caught.value.reason) == (line, True), str(caught.value)


def test_a_correct_profile_is_taken(tmp_path: Path) -> None:
    text = GOOD.replace('bits = { low = "x" }', "bits = { odd = 0, rest = { at = '1-7' } }")
    (ping,) = Profile.open(write(tmp_path / "acme", text)).dissector().messages
    assert (ping.name, ping.full_name, ping.type_id) == ("Ping", "acme.Ping", 20100)
    assert ping.notes["a"].enum == {1: "red"}
    assert [part.width for part in ping.notes["a"].parts] == [1, 7]
    assert ping.derived == (Derived("twice", "a", Fraction(2)),)


def test_scales_are_exact(tmp_path: Path) -> None:
    text = FIELD + "scale = 0.01\nlow = -1e-2\nhigh = '900/8191'"
    (ping,) = Profile.open(write(tmp_path / "acme", text)).dissector().messages
    note = ping.notes["a"]
    assert (note.scale, note.low, note.high) == (Fraction(1, 100), Fraction(-1, 100), Fraction(900, 8191))


TMOTOR = (BUILT_IN / "tmotor" / "profile.toml").read_text()


def parse_or_line(text: bytes) -> int:
    """The line of the error in a profile of the T-Motor folder, 0 if it has none."""
    try:
        Profile(BUILT_IN / "tmotor", toml_table.parse(text, "profile.toml"), None).dissector()
    except ProfileError as error:
        return error.line
    except DsdlError as error:
        return error.line
    return 0


@settings(deadline=None)
@given(st.data())
def test_damaged_profiles_give_a_dissector_or_a_located_error(data: st.DataObject) -> None:
    lines = TMOTOR.split("\n")
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        start = data.draw(st.integers(0, len(lines[at])))
        stop = data.draw(st.integers(start, len(lines[at])))
        lines[at] = lines[at][:start] + data.draw(st.text("[]{}=\".,0x9-'/ aé#", max_size=6)) + lines[at][stop:]
    assert 0 <= parse_or_line("\n".join(lines).encode()) <= len(lines)


@given(st.binary())
def test_arbitrary_bytes_give_a_table_or_a_profile_error(data: bytes) -> None:
    assert 0 <= parse_or_line(data) <= len(data) + 1


@pytest.mark.parametrize("text", ["a = " + "9" * 5000, "a = " + "[" * 100_000, "a = \xff"])
def test_toml_that_breaks_parsers(text: str) -> None:
    assert parse_or_line(text.encode("latin-1")) == 1


@given(st.text("{}:.!a0f%<>", max_size=12))
def test_templates_parse_or_say_why(text: str) -> None:
    """A format that is accepted can be applied to a number."""
    try:
        slots = template.parse(text)
    except ValueError:
        return
    for slot in slots:
        assert slot.fits(1.5)
