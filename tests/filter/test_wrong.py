"""Wrong filters: each says why in words that a stranger understands, with a caret under the place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES
from rich.cells import cell_len

import dissectors
from analyzer.filter import FilterError, compile_filter
from analyzer.filter.fields import MEANT

if TYPE_CHECKING:
    from collections.abc import Callable

# The filter with « » around the place, and a part of the reason.
WRONG = [
    ("ESCStatus.«voltge» > 40", "did you mean ESCStatus.voltage"),
    ("can.id == «1F01550A»", "a number in hexadecimal is written 0x1F01550A"),
    ("ESCStatus.«temp» > 40", "did you mean ESCStatus.temperature"),
    ("«ESCStaus»", "did you mean ESCStatus"),
    ('«_ws.col.Info» contains "ESC"', "what a column says is made of fields"),
    ('«frame.comment» contains "x"', "no filter asks for them"),
    ("«frame.marked» == 1", "marks are of `view`"),
    ("«_ws.malformed»", "did you mean dronecan.status"),
    ("«frame.numbr» == 1", "did you mean frame.number"),
    ("«voltage» > 40", "did you mean ESCStatus.voltage"),
    ("«Status»", "may be any of these: dronecan.status, ESCStatus"),
    ("«esc» == 5", "no field or type is called 'esc'; did you mean ch?"),
    ("ESCStatus.voltage > «44 A»", "A does not fit: the field is in V"),
    ("ESCStatus.esc_index == «4 V»", "the field has no unit"),
    ("ESCStatus.temperature > «100 degC»", "did you mean ESCStatus.temperature_celsius"),
    ("finding.rule == «TRF-003»", "put what it is compared with in double quotes"),
    ("ESCStatus.mode == «'idle'»", "one character stands between single quotes"),
    ("«hobbywing»", "did you mean com.hobbywing.esc."),
    ("PUSHSCI.«FocControl.mode» == 3", "it has: SetZero, FocParameters, FocQuery, OutputControl"),
    ("frame.number == «10 %»", "for the remainder write mod"),
    ("frame.number == 10 «%» 3", "for the remainder write mod"),
    ('ESCStatus.voltage == «"high"»', "the field is a number in V, not text"),
    ('ESCStatus.mode == «"flying"»', "1 off, 2 idle"),
    ("ESCStatus.mode == «flying»", "4 operating"),
    ("ESCStatus.mode == «77»", "77 is none of its values"),
    ("ESCStatus.mode in {1, «99»}", "none of its values"),
    ('dronecan.status == «"okay"»', "ok, unchecked, bad crc"),
    ("dronecan.src == «300»", "the field holds 0 to 127"),
    ("can.flags.rtr == «7»", "it is 1 or 0, true or false"),
    ("can.len «=» 8", "write =="),
    ("src == «abc»", "'abc' is neither a field nor a value: the field is a number"),
    ("ESCStatus.voltage == «true»", "the field is a number in V"),
    ("frame.data[0:2] == 0a«:»fg", "a colon joins bytes of two hexadecimal digits each"),
    ("frame.number in {«100-200»}", "a range is written 3..5"),
    ("ip.src == «10.0.0.1»", "what has several dots is text, in double quotes"),
    ("ESCStatus «voltage» < 44", "(or the dot of a name) is expected"),
    ("can.len «=>» 8", "write >="),
    ("can.len «<>» 8", "write !="),
    ("can.len == 8 «|» can.len == 7", "write ||"),
    ("can.len ==« »", "the filter ends here, but a field, a value or a parenthesis is expected"),
    ("(can.len == 8« »", "a closing parenthesis is expected"),
    ("can.len == 8«)»", "an operator such as && or == is expected"),
    ("can.len «8»", "an operator such as && or == is expected, not a number"),
    ("can.len in «{}»", "the set is empty"),
    ("can.len in «8»", "a set in braces, such as {1, 3..5}"),
    ("can.len in {«5..3»}", "the range ends below its start"),
    ("can.len in {1 «2»}", "a comma or a closing brace is expected"),
    ('dronecan.type == «"ESC»', "has no quote at its end"),
    ('dronecan.type == "a«\\q»"', "a backslash is written"),
    ('dronecan.type matches «"(ab"»', "this is no regular expression"),
    ('dronecan.type matches «"(?=a)"»', "this is no regular expression"),
    ('«can.id» contains "a"', "contains looks into text and bytes only"),
    ('«can.id» matches "a"', "matches looks into text and bytes only"),
    ("«ESCStatus» == 5", "compare one of its fields, ESCStatus.FIELD"),
    ("«5 == 5»", "one side has to be a field"),
    ("«5»", "a value alone is no condition"),
    ("«can.len + 1»", "compare it with something"),
    ("can.len / «0» == 1", "nothing is divided by 0"),
    ("«ESCStatus.voltage» & 1", "bits are taken of whole numbers only"),
    ("«ESCStatus.voltage == ESCStatus.current»", "one side is in V, the other in A"),
    ("«ESCStatus.voltage + ESCStatus.current» > 1", "V and A cannot be added"),
    ("frame.data[«a»] == 1", "brackets hold [4]"),
    ("frame.data[0:2] == «700»", "they are written 0a:ff"),
    ("frame.data[0:2] == «0a»", "the piece has 2 bytes, this has 1: a piece of 1 is [4:1] (start:length)"),
    ("frame.data[0] != «0a:ff»", "the piece has 1 byte, this has 2: a piece of 2 is [4:2] (start:length)"),
    ("frame.data[0-2,-1] in {0a:ff:00:01, «0a:ff:00»}", "the piece has 4 bytes, this has 3"),
    ("«RawCommand.cmd[20]» > 0", "there are at most 20 elements: the first is [0], the last [19]"),
    ("«RawCommand.percent[-21:2]» > 0", "there are at most 20 elements"),
    ("1 < «RawCommand.cmd[0,25]»", "there are at most 20 elements"),
    ("«frame.data[62:4]» == 0a:ff:00:01", "there are at most 64 bytes: the first is [0], the last [63]"),
    ("«payload[-2:4]» == 0a:ff:00:01", "[-2:4] goes on behind the end: up to there is [-2:]"),
    ("«GetNodeInfo.hardware_version.unique_id[16]» == 00", "there are at most 16 bytes"),
    ("«ESCStatus.voltage[1]» > 40", "this is a number in V: only bytes, text and lists have pieces"),
    ("«frame.time[0]» > 3", "this is a time: only bytes, text and lists have pieces"),
    ("«ESCStatus[0]» == 3", "ESCStatus is a type: only its fields have pieces"),
    ("«frame.data == can.id»", "bytes cannot be compared with a number"),
    ("«lenght»(payload) > 3", "did you mean len"),
    ("«len(payload, 3)» > 3", "len() takes 1 value"),
    ("len(«can.len») > 3", "only text and bytes have a length"),
    ('upper(«can.len») == "A"', "not text"),
    ("lag(«can.len», 5 s) > 3", "a number of a message"),
    ("lag(ESCStatus.voltage, «2 h») > 3", "at most 600 s"),
    ("lag(ESCStatus.voltage, «5 V») > 3", "V does not fit"),
    ('within(ESCStatus.voltage, 44 V, «"x"»)', "the tolerance is a number"),
    ('frame.time > «"yesterday"»', "is not a time"),
    ("frame.time > «12:49:54»", "with the quotes"),
    ("can.len == «09»", "octal"),
    ("can.len == «99999999999999999999»", "no field holds a number as large"),
    ("«»", "the filter is empty"),
    ("can.id in {«can.len»}", "a value is expected here, not a field"),
    ("«type» == ESCStatus", "did you mean dronecan.type"),
    ("«status» == ok", "may be any of these: dronecan.status, ESCStatus"),
    ("«frame.len» > 8", "did you mean can.len?"),
    ("«expert.severity» == error", "did you mean finding.severity?"),
    ("«eth.addr» == 1", "; tailbyte fields lists them"),
    ('can.id == «"0x1F"»', "not text; a number stands without quotes"),
    ('frame.time_relative >= «"00:00:01"»', "a time in s, not text, such as 1.5 s"),
    ("src == «11 & dst» == 12", "& takes bits of numbers: to join conditions write &&"),
    ("frame.number in {0..«18446744073709551615»}", "the field holds 0 to 9223372036854775807"),
    ('dronecan.type matches «"(?<=a)"»', "look-ahead and look-behind are not known here"),
    ("«ESCStatus.rpm > RawCommand.cmd»", "no row has both ESCStatus and RawCommand: a rule in a vehicle file"),
    ("1 < «ESCStatus.rpm < RawCommand.cmd»", "lag() with what the same field was before"),
    ("«ESCStatus.rpm - RawCommand.cmd[0] > 5»", "no row has both"),
    ("ESCStatus && «within(ESCStatus.rpm, NodeStatus.mode, 10 %)»", "no row has both"),
    ('dronecan.type == «"Nonsense"»', "no type is called 'Nonsense'; tailbyte fields lists them"),
    ("dronecan.type in {RawCommand, «ESCStat»}", "did you mean ESCStatus?"),
    ("dronecan.type == «esc»", "did you mean ESCStatus"),
    ('dronecan.type != «"Status"»', "did you mean ESCStatus, ardupilot.gnss.Status"),
    ("dronecan.src == «1.5»", "1.5 is not possible: this is a whole number"),
    ("dronecan.src in {1, «2.5»}", "this is a whole number"),
    ("can.len / 2 != «0.5»", "this is a whole number"),
    ("ch == «0»", "the field holds 1 to 255"),
    ("unit == «255»", "the field holds 1 to 254"),
    ("frame.number == 5/«0»", "nothing is divided by 0"),
    ("frame.number < 1e999 mod «0»", "nothing is divided by 0"),
    ("«a.b.c»", "no field or type is called 'a.b.c'"),
    ("RawCommand.«nothing»", "it has: cmd, percent"),
    ("ESCStatus.«nothing»", "it has: error_count, status, voltage, current"),
    ("can.len == 8 «AND» can.id", "AND is written and"),
    ("can.len «IN» {8}", "IN is written in"),
    ("«NOT» can.id", "NOT is written not"),
    ("ESCStatus.voltage «≥» 4", "write >="),
    ("ESCStatus.voltage «≠» 4", "write !="),
    ("dronecan.type == «“»ESCStatus”", 'text stands between straight quotes: "text"'),
    ("can.id == «0xZZ»", "digits of a hexadecimal number are 0 to 9 and a to f"),
    ("can.len == 8 &&«&» can.id", "a field, a value or a parenthesis is expected, not &"),
    ("(«)»", "a field, a value or a parenthesis is expected, not )"),
    ("can.id == 5 and not« »", "the filter ends here, but a field"),
    ("«and» can.id", "a field, a value or a parenthesis is expected, not and"),
    ("1 < «x» < 5", "no field or type is called 'x'"),
    ('1 < can.len < «"a"»', "the field is a number, not text"),
    ("can.len >= «1 <= 8»", "two values are compared here"),
    ("can.len in {1,«,»2}", "a field, a value or a parenthesis is expected, not ,"),
    ("can.len in {1..«}»", "a field, a value or a parenthesis is expected, not }"),
    ("can.len in «(»1,2)", "a set in braces, such as {1, 3..5} is expected"),
    ("frame.data[7] & «zz»", "no field or type is called 'zz'"),
    ("frame.data[«-1:0»] == 00", "a length of at least 1"),
    ("node.label == «5»", "put what it is compared with in double quotes"),
    ('dronecan.type matches «"["»', "a closing bracket is missing"),
    ("«can.len» contains 8", "contains looks into text and bytes only"),
    ("ESCStatus.voltage > «44 km»", "km does not fit: the field is in V"),
    ("node == 11 or «12»", "a value alone is no condition: write node in {11, 12}"),
    ("can.id && (src == 11 || «12» || 13)", "write src in {11, 12, 13}"),
    ("node in {11«...»13}", "a range has two dots, such as 3..5"),
    ("any («ESCStatus.voltage > 3»)", "any stands in front of a field, without parentheses"),
    ("all («can.id && can.len») == 3", "all stands in front of a field"),
    ("ESCStatus «not» RawCommand", "not stands in front of a condition (&& not x == 3) or of in (x not in {1, 3..5})"),
    ("ESCStatus«!»", "not stands in front of a condition"),
    ("dst == «broadcast»", "broadcast is the type uavcan.tunnel.Broadcast: compare one of its fields"),
    ('MotorStatus.fault == «"stall"»', "a number, not text; did you mean MotorStatus.fault.stall?"),
    ("PUSHCAN.MotorStatus.fault != «stall»", "did you mean PUSHCAN.MotorStatus.fault.stall?"),
    ('MotorStatus.fault in {1, «"over voltage"»}', "did you mean MotorStatus.fault.over_voltage?"),
    ('ESCStatus.status == «"error"»', 'did you mean ESCStatus.status.mode == "error"?'),
    ("ESCStatus.voltage «between» 1 and 2", "an operator such as && or == is expected, not a name"),
]  # fmt: skip


def marked(text: str) -> tuple[str, int, int]:
    """Return a filter without its marks, and where they stood."""
    start, end = text.index("«"), text.index("»") - 1
    plain = text.replace("«", "").replace("»", "")
    return (plain.rstrip(), start, end) if plain[start:end].isspace() else (plain, start, end)


def test_there_are_enough() -> None:
    assert len(WRONG) >= 40


@pytest.mark.parametrize("name", sorted({name for names in MEANT.values() for name in names}))
def test_what_is_offered_for_a_habit_exists(name: str) -> None:
    assert compile_filter(f"exists({name})", dissectors.load()).text


def test_nothing_is_offered_for_a_letter() -> None:
    with pytest.raises(FilterError) as caught:
        compile_filter("a.b.c", dissectors.load())
    assert caught.value.candidates == ()


LONG = "can.len == 8 && " * 30
PLACES = [
    'GetNodeInfo.name == "漢字" && «can.lne» == 8',
    'GetNodeInfo.name == "e\u0301\u0301x\ufe0f" && «can.lne» == 8',
    'GetNodeInfo.name\t==\t"\x1b[31m\u202e\U0001f600" && «can.lne» == 8',
    LONG + "«can.lne» == 8",
    "«can.lne» == 8 && " + LONG + "can.len",
    LONG + "«can.lne» == 8 && " + LONG + "can.len",
    'dronecan.type matches "' + "漢" * 200 + '" && «can.lne» == 8',
    'dronecan.type matches "' + "\x01" * 200 + '" && «can.lne» == 8 && frame.data contains "' + "漢" * 80 + '"',
    'dronecan.type matches "' + "\u0301" * 990 + '" && «can.lne» == 8',
    "can.len == 8 &&\n" * 30 + "«can.lne» == 8 ||\n can.len",
]


@pytest.mark.parametrize("text", PLACES, ids=range(len(PLACES)))
def test_the_caret_is_right_on_a_terminal(text: str) -> None:
    """Somebody else's count of columns: the carets are below the name."""
    with pytest.raises(FilterError) as caught:
        compile_filter(text.replace("«", "").replace("»", ""), dissectors.load())
    said, line, carets = str(caught.value).split("\n")
    assert said.startswith("no field or type is called 'can.lne'")
    assert cell_len(line) <= 80
    assert carets == " " * cell_len(line[: line.index("can.lne")]) + "^" * len("can.lne")


def test_only_the_line_of_the_place_is_shown() -> None:
    with pytest.raises(FilterError) as caught:
        compile_filter("can.len == 8\n  && can.lne == 8\n|| can.len", dissectors.load())
    assert str(caught.value).split("\n")[1:] == ["    && can.lne == 8", "       ^^^^^^^"]


@pytest.mark.parametrize(
    "text",
    [
        "frame.number < 1e999 mod 1e999",
        "can.len == 7/2",
        "ch > 0",
        "ESCStatus || RawCommand",
        "ESCStatus && !(RawCommand)",
        "max(ESCStatus.rpm, RawCommand.cmd) > 5",
        "PUSHCAN.data_sequence > PUSHCAN.MotorStatus.unit_id",
        "5 / ESCStatus.voltage > 1",
        "RawCommand.cmd[19:5] > 0",
        "RawCommand.cmd[-20] > 0 && RawCommand.percent[19] > 0",
        "frame.data[60:4] == 0a:ff:00:01 || frame.data[-64] == 00",
        "frame.data[0:2] > 0a",
        "frame.data[-2:] == 0a && payload[0:2] contains 0a",
        'payload[60000] == 00 && GetNodeInfo.name[0:3] == "abcd"',
        "GetNodeInfo.hardware_version.unique_id[15] == 00",
        "dronecan.src > 1.5",
    ],
)
def test_what_is_near_to_that_is_right(text: str) -> None:
    assert compile_filter(text, dissectors.load()).apart == ""


@pytest.mark.parametrize(("text", "name"), [
    ("dronecan.type == RawCommand", "RawCommand"), ('dronecan.type == "nodestatus"', "uavcan.protocol.NodeStatus"),
    ("dronecan.type in {NodeStatus}", "uavcan.protocol.NodeStatus"),
])  # fmt: skip
def test_a_type_has_any_of_its_names(text: str, name: str, command: Callable[..., Any]) -> None:
    code, out, _ = command("decode", CAPTURES / "hover.log", "-Y", text, "-T", "fields", "-e", "dronecan.type")
    assert code == 0
    assert set(out.splitlines()) == {name}


@pytest.mark.parametrize("step", ["+ 1", "& 10", "- can.len"])
def test_what_is_nested_is_read_in_no_time(step: str) -> None:
    """Each level was read twice or three times: 40 of them would not have ended."""
    text = "(" * 40 + "frame.data[0]" + f" {step})" * 40 + " > 3"
    assert compile_filter(text, dissectors.load()).text == text


@pytest.mark.parametrize(("text", "reason"), WRONG)
def test_the_caret_is_under_the_place(text: str, reason: str) -> None:
    plain, start, end = marked(text)
    with pytest.raises(FilterError) as caught:
        compile_filter(plain, dissectors.load())
    error = caught.value
    assert reason in error.reason
    said, line, carets = str(error).split("\n")
    assert said == error.reason
    assert line == f"  {plain}"
    assert carets == f"  {' ' * start}{'^' * max(1, end - start)}"
