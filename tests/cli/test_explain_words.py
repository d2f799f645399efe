"""What explain says of words that are no rules: clauses, types, fields, values, what the document prints."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.judged import registry
from kit.strategies import examples

import dissectors
from analyzer.facts.meaning import meaning
from analyzer.report.topics.finding import Lexicon
from analyzer.report.topics.page import Pages
from analyzer.rules.catalogue import load
from analyzer.views.terminal import display_width
from dissectors.printed import printed
from dissectors.toml_table import ProfileError

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

TMOTOR = Path(dissectors.__file__).with_name("tmotor")


def heads(out: str) -> list[str]:
    """The first words of each block."""
    return [line.split("  ")[0] for block in out.split("\n\n") for line in block.splitlines()[:1]]


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["Oversupply"], ["ESCStatus.error_count.over_voltage"]),
        (["low bridge"], ["ESCStatus.error_count.lower_bridge_fault"]),
        (["low", "bridge"], ["ESCStatus.error_count.lower_bridge_fault"]),
        (["Operational amplifier"], ["ESCStatus.error_count.amplifier_fault"]),
        (["Operational amplifier fault"], ["ESCStatus.error_count.amplifier_fault"]),
        (["voltage"], ["ESCStatus.voltage", "PUSHCAN.MotorStatus.voltage"]),
        (["ESCStatus.voltage"], ["ESCStatus.voltage"]),
        (["ESCStatus.status.mode"], ["ESCStatus.error_count.mode"]),
        (["escstatus.error_count.mode"], ["ESCStatus.error_count.mode"]),
        (["temperature_celsius"], ["ESCStatus.temperature_celsius", "PUSHCAN.MotorStatus.temperature_celsius"]),
        (["uptime_sec"], ["uavcan.protocol.NodeStatus.uptime_sec"]),
        (["TRF-010", "Oversupply"], ["TRF-010", "Checks", "Origin", "ESCStatus.error_count.over_voltage"]),
    ],
)
def test_a_page_each(command: Command, words: list[str], found: list[str]) -> None:
    status, out, err = command("explain", *words)
    assert (status, err) == (0, "")
    assert [head.split(" ")[0] for head in heads(out)] == found


def test_what_a_bit_is(command: Command) -> None:
    assert command("explain", "Oversupply")[1].splitlines() == [
        "ESCStatus.error_count.over_voltage  bit 0                           4.4.3 no 1-4",
        "In        ESCStatus, message 1034, 14 bytes",
        "Name      over voltage",
        "Printed   Oversupply",
    ]


def test_what_a_value_is(command: Command) -> None:
    _, out, _ = command("explain", "blade retraction")
    assert re.findall(r"Value +(\d+) \((0x\w+)\): (\w+ fold)", out) == [
        ("238", "0xEE", "forward fold"), ("34", "0x22", "reverse fold"),
    ]  # fmt: skip
    assert "PUSH-301" in out


@pytest.mark.parametrize("word", ["ESCStatus", "uavcan.equipment.esc.Status", "1034", "escstatus"])
def test_a_type(command: Command, word: str) -> None:
    status, out, _ = command("explain", word)
    lines = out.splitlines()
    assert status == 0
    assert lines[0].split() == ["ESCStatus", "message", "1034,", "14", "bytes", "4.4.3"]
    assert "Signature A9AF28AEA2FBB254" in lines
    assert [line.split() for line in lines if line.startswith("  voltage")] == [
        ["voltage", "float16", "V", "no", "5-6"]
    ]
    assert any(line.startswith("    stall") and "bit 7" in line for line in lines)
    assert lines[-1].startswith("Rules ")


def test_a_packet_and_both_halves_of_a_service(command: Command) -> None:
    assert command("explain", "MotorStatus")[1].startswith("PUSHCAN.MotorStatus  packet 0x15, 28 bytes")
    _, out, _ = command("explain", "GetNodeInfo")
    assert [head for head in heads(out) if "GetNodeInfo" in head] == [
        "uavcan.protocol.GetNodeInfo.Request", "uavcan.protocol.GetNodeInfo.Response",
    ]  # fmt: skip


def test_a_clause(command: Command) -> None:
    status, out, _ = command("explain", "4.4.3")
    assert status == 0
    assert out.startswith("Clause 4.4.3\n\nESCStatus  message 1034")
    assert "\nTYP-305   Fault bit set\n" in out
    assert "TYP-401" not in out  # of 4.4.6
    whole = command("explain", "4.4")[1]
    assert "\nPUSHCAN.MotorStatus  packet 0x15, 28 bytes " in whole
    assert "\nTYP-401 " in whole
    assert command("explain", "4.4.4 table 4")[1].startswith("Clause 4.4.4 table 4\n\nPUSHSCI.OutputControl")
    assert "No capture can show 4.2 topology" in command("explain", "4.2")[1]


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (["Oversuply"], "Oversupply"),
        (["ESCStaus"], "ESCStatus"),
        (["voltge"], "voltage"),
        (["4.4.9"], "4.4."),
        (["low", "brigde"], "Low bridge fault"),
        (["retractoin"], "retraction"),
    ],
)
def test_what_there_is_not(command: Command, words: list[str], near: str) -> None:
    status, out, err = command("explain", *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "did you mean " in err
    assert near in err.partition("did you mean")[2]


def test_lists_and_documents_are_of_rules(command: Command) -> None:
    for option in ("--list", "--markdown"):
        status, out, err = command("explain", option, "ESCStatus")
        assert (status, out) == (2, "")
        assert "no rule is called 'ESCStatus'" in err


@pytest.mark.slow
def test_every_printed_word_has_something_it_stands_for() -> None:
    types, lexicon = registry(), Lexicon(registry(), load(registry()))
    words = list(printed(TMOTOR))
    assert len(words) > 80
    for path, value, text in words:
        of = types.definition(types.table_of(path))
        column = path.removeprefix(f"{types.table_of(path)}.")
        assert of is not None, path
        about = meaning(of, column)
        assert about.note is not None or about.part is not None, path
        assert value is None or value in {**(about.part.enum if about.part else about.note.enum)}, path
        assert any((topic.table, topic.column) == (types.table_of(path), column) for topic in lexicon.find(text)), text


@pytest.mark.parametrize("width", [40, 60, 80, 200])
@pytest.mark.parametrize("word", ["4.4", "ESCStatus", "OutputControl", "NodeStatus", "low", "esc_id_set"])
def test_pages_fit(word: str, width: int) -> None:
    rules = load(registry())
    lexicon = Lexicon(registry(), rules)
    text = Pages(lexicon, registry(), rules, width=width).write(lexicon.find(word))
    assert text
    assert max(map(display_width, text.splitlines())) <= max(width, 60)


@examples(30)
@given(st.text(max_size=30))
def test_any_word_is_found_or_not(word: str) -> None:
    lexicon = Lexicon(registry(), load(registry()))
    for topic in lexicon.find(word):
        assert topic.clause or registry().definition(topic.table) is not None
    assert all(isinstance(name, str) for name in lexicon.near(word))


def test_another_vendors_words(tmp_path: Path, command: Command) -> None:
    (tmp_path / "profile.toml").write_text(
        'name = "Acme"\n[message.Pump]\ndsdl = "20777.Pump.uavcan"\ntype = "acme.Pump"\nclause = "7"\n'
        'field.state = { enum = { 2 = "spinning" }, clause = "7.1" }\n'
    )
    (tmp_path / "20777.Pump.uavcan").write_text("uint8 state\n")
    words = '[name]\n"Pump.state" = "Rotor condition"\n[value]\n"Pump.state" = { 2 = "Rotates\x07 well" }\n'
    (tmp_path / "printed.toml").write_text(words.replace("\x07", "\\u0007"))
    _, out, _ = command("explain", "--dissector", str(tmp_path), "rotor condition")
    assert "Pump.state  uint8" in out
    assert "Printed   Rotor condition" in out
    _, out, _ = command("explain", "--dissector", str(tmp_path), "rotates")
    assert 'Value     2: spinning (printed "Rotates\\x07 well")' in out
    (tmp_path / "printed.toml").write_text("[name]\nx = 1\n")
    status, _, err = command("explain", "--dissector", str(tmp_path), "rotates")
    assert status == 2
    assert "printed.toml:2: " in err
    with pytest.raises(ProfileError):
        list(printed(tmp_path))
