"""Every mistake in a profile is reported with file, line and remedy, and nothing else is ever raised."""

from __future__ import annotations

from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import template, toml_table
from dissectors.dsdl import DsdlError
from dissectors.profile import Profile, ProfileError
from dissectors.schema import Derived

BUILT_IN = Path(find_spec("dissectors").origin).parent


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
PACKETS = 'carrier = "list"\nheader = [1, 2]\nid_at = 2\ncount_at = 2\nunit_at = 2\n'


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
        (FIELD.replace("field.a", "derived.d") + "source = 'a'\nelement = 0", 7, "'a' has no such element"),
        (FIELD.replace("field.a", "derived.d") + "source = 'list'\nelement = 9", 7, "'list' has no such element"),
        (FIELD.replace("field.a", "derived.d") + "source = 'a'\npieces = [{ start = 1 }]", 7, "add is missing"),
        (FIELD.replace("\n\n", "\nsummary = '{z}'\n"), 4, "no column 'z' (allowed: a, b, f, list)"),
        (FIELD.replace("\n\n", "\nsummary = '{a!r}'\n"), 4, "is not {column}"),
        (FIELD.replace("\n\n", "\nsummary = '{'\n"), 4, "summary: "),
        (FIELD.replace("\n\n", "\nsummary = '{f:x}'\n"), 4, "'x' does not suit f"),
        (FIELD.replace("\n\n", "\nsummary = '{a:.1f}'\n") + "enum = { 1 = 'x' }", 4, "'.1f' does not suit a"),
        (FIELD.replace("\n\n", "\nturns = 'list'\n"), 4, "'list' is no number of acme.Ping"),
        (FIELD.replace("\n\n", "\nactuates = 'yes'\n"), 4, "true or false is expected, not 'yes'"),
        (FIELD.replace("field.a", "reading.r") + "field = 'a'\nchoices = ['x', 'y']", 5, "and evidence"),
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


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        (PACKETS + "length_at = 2\nfoo = 1", 7, "foo: unknown key"),
        (PACKETS, 1, "all needed"),
        (PACKETS.replace("list", "a") + "length_at = 2", 1, "no byte array"),
        (PACKETS + "length_at = 2\n[packet.P]\nid = 1\ndsdl = 'Bad.uavcan'", 9, "2 to 255 whole bytes"),
        (PACKETS + "length_at = 2\n[packet.P]\nid = 1\ndsdl = 'no.uavcan'", 9, "no such file"),
        (PACKETS + "length_at = 2\n[packet.P]\ndsdl = 'Good.uavcan'", 7, "id is missing"),
        (PACKETS + "length_at = 9\n[packet.P]\nid = 1\ndsdl = 'Good.uavcan'", 9, "shorter than"),
        (PACKETS + "length_at = 2\n[packet.P]\nid = 1\ndsdl = 'Good.uavcan'\nchecksum_ends = [4]", 10, "1 to 3"),
        (PACKETS + "length_at = 2\n[packet.P]\nid = 1\ndsdl = 'Good.uavcan'\nfield.z = {}", 10, "no such field"),
        (
            PACKETS + "length_at = 2\n" + "\n".join(f"[packet.{p}]\nid = 1\ndsdl = 'Good.uavcan'" for p in "PQ"),
            11,
            "second",
        ),
    ],
)
def test_mistakes_in_a_packet_file_are_reported_in_that_file(tmp_path: Path, text: str, line: int, reason: str) -> None:
    folder = write(tmp_path / "acme", FIELD.replace("\n\n", "\npackets = 'packets.toml'\n\n"))
    with pytest.raises(ProfileError, match="no such file") as caught:
        Profile.open(folder).dissector()
    assert (Path(caught.value.file).name, caught.value.line) == ("profile.toml", 4)
    (folder / "packets.toml").write_text(text)
    with pytest.raises(ProfileError) as caught:
        Profile.open(folder).dissector()
    assert caught.value.file == str(folder / "packets.toml")
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
