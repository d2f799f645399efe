"""Hostile filters end soon, in one line with its place, whatever they ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES

import dissectors
from analyzer.filter import FilterError, compile_filter

if TYPE_CHECKING:
    from collections.abc import Callable

HOSTILE = [
    ("(" * 10_000 + "can.id" + ")" * 10_000, "nested at most"),
    ("!" * 10_000 + "can.id", "nested at most"),
    ("-" * 10_000 + "can.id == 1", "nested at most"),
    ("abs(" * 10_000 + "can.id" + ")" * 10_000 + " == 1", "nested at most"),
    ("can.len" + " + 1" * 10_000 + " == 1", "steps"),
    ("can.len" + " < can.len" * 4_000, "steps"),
    ("can.id == 1 || " * 80_000 + "can.id", "at most 65536 characters"),
    ("can.id in {" + "1," * 15_000 + "1}", "words and marks"),
    ("can.id == " + "9" * 5_000, "at most 40 digits"),
    ("can.len == 1e99999999", "exponent"),
    ("can.len == 1e9999", "as large"),
    ("can.len == 1 * 9999999999999999999 * 9999999999999999999", "as large"),
    ('dronecan.type matches "' + "(a+)+" * 5_000 + '"', "at most 1000 characters"),
    ('dronecan.type matches "((a{1000}){1000}){1000}"', "no regular expression"),
    ("x" * 60_000, "no field or type has a name as long"),
    ("x." * 30_000 + "y", "a name as long"),
    ("ESCStatus." * 6_000 + "x", "a name as long"),
    ("frame.data[" + "0," * 30_000 + "1] == 00", "at most 64 pieces"),
    ("payload" + "[0:1]" * 5_000, "steps"),
    ("\x1b[31mcan.id", "has no meaning here"),
    ("can.id == 1 \x00", "has no meaning here"),
    ("\ud800", "has no meaning here"),
]


@pytest.mark.parametrize(("text", "reason"), HOSTILE, ids=range(len(HOSTILE)))
def test_it_is_refused_in_three_short_lines(text: str, reason: str) -> None:
    with pytest.raises(FilterError) as caught:
        compile_filter(text, dissectors.load())
    lines = str(caught.value).split("\n")
    assert reason in lines[0]
    assert len(lines) == 3
    assert [len(line) < most for line, most in zip(lines, (1_100, 200, 200), strict=True)] == [True] * 3
    assert "\x1b" not in str(caught.value)


def test_what_is_infinite_warns_of_nothing(command: Callable[..., Any], recwarn: pytest.WarningsRecorder) -> None:
    text = "max(ESCStatus.voltage, count(RawCommand.cmd)) % max(unit, ESCStatus.voltage) == 1"
    code, _, err = command("decode", CAPTURES / "faults.log", "-q", "-Y", text)
    assert (code, err.count("\n")) == (3, 2)  # the last line of the capture is damaged
    assert [str(one.message) for one in recwarn] == []


def test_a_pattern_takes_time_in_proportion(command: Callable[..., Any]) -> None:
    code, _, err = command("decode", CAPTURES / "hover.log", "-q", "-Y", 'payload matches "(.*.*)*(x+x+)+y$"')
    assert code == 0  # one that goes back and tries again would not end
    assert err.startswith("-- 0 of ")


def test_a_long_one_that_makes_sense_works(command: Callable[..., Any]) -> None:
    text = " || ".join(f"frame.number == {k}" for k in range(1, 1500))
    code, _, err = command("decode", CAPTURES / "hover.log", "-q", "-Y", text)
    assert code == 0
    assert "transfers match" in err


def test_the_command_says_it_once(command: Callable[..., Any]) -> None:
    code, out, err = command("decode", CAPTURES / "hover.log", "-Y", "(" * 10_000)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 3
    assert "Traceback" not in err
