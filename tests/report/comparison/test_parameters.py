"""Parameters of the standard, by name: other values, values that change meanwhile, what only one capture tells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import SECOND, START, alive, log

import analyzer
from analyzer.report.comparison.parameters import MOST_VALUES, ToldParameter

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer import CaptureDiff

    Compare = Callable[..., CaptureDiff]

RESPONSE = "uavcan.protocol.param.GetSet.Response"
EMPTY = {"empty": {}}


def told(name: str, value: dict[str, Any], at: float = 0.0) -> tuple[float, str, dict[str, Any]]:
    return at, name, value


def capture(*parameters: tuple[float, str, dict[str, Any]]) -> str:
    sent = [(1000.0 * k, alive(k, 42, k % 32)) for k in range(12)]
    for number, (at, name, value) in enumerate(parameters):
        fields = {"value": value, "default_value": value, "max_value": EMPTY, "min_value": EMPTY,
                  "name": list(name.encode())}  # fmt: skip
        whole = encode.transfer(RESPONSE, fields, 42, number % 32, dst=127)
        sent.append((1000 * at + 5.0 * (number + 1), whole))
    return log(*sent)


@pytest.fixture
def compare(tmp_path: Path) -> Compare:
    def run(good: str, bad: str) -> CaptureDiff:
        paths = tmp_path / "good.log", tmp_path / "bad.log"
        for path, text in zip(paths, (good, bad), strict=True):
            path.write_text(text)
        return analyzer.diff(*paths, select=["TRF-010"])

    return run


RATE, GAIN, NAME = ({"integer_value": 10}, {"real_value": 0.5}, {"string_value": list(b"left")})


def test_another_value(compare: Compare) -> None:
    good = capture(told("RATE", RATE), told("GAIN", GAIN), told("NAME", NAME))
    bad = capture(
        told("GAIN", {"real_value": 0.75}), told("NAME", {"string_value": list(b"right")}), told("RATE", RATE)
    )
    found = compare(good, bad)
    assert [(one.kind, one.what, one.good, one.bad) for one in found.differences] == [
        ("parameter", "GAIN", "0.5", "0.75"),
        ("parameter", "NAME", "left", "right"),
    ]
    assert {one.what: one.count for one in found.compared}["parameters"] == 3


def test_a_value_that_changes_meanwhile(compare: Compare) -> None:
    steady, changing = (
        capture(told("RATE", RATE)),
        capture(told("RATE", RATE), told("RATE", {"integer_value": 20}, 6.0)),
    )
    (one,) = compare(steady, changing).differences
    assert (one.weight, one.since, one.good, one.bad) == ("warning", "from", "10", "20")
    assert one.t_ns is not None
    assert (one.t_ns - START) / SECOND == pytest.approx(6, abs=0.1)
    (one,) = compare(changing, steady).differences
    assert (one.weight, one.good, one.bad, one.remark) == ("note", "20", "10", "changed while the first capture ran")


def test_what_changes_after_the_other_capture_has_ended_is_no_difference(compare: Compare) -> None:
    rate, other = told("RATE", RATE), told("RATE", {"integer_value": 20}, 9.0)
    whole = capture(rate, other)
    short = "".join(line for line in whole.splitlines(keepends=True) if float(line[1:18]) * SECOND - START < 8 * SECOND)
    assert compare(whole, short).differences == compare(short, whole).differences == ()


def test_both_had_both_values(compare: Compare) -> None:
    other = {"integer_value": 20}
    one = capture(told("RATE", RATE), told("RATE", other, 6.0))
    back = capture(told("RATE", other), told("RATE", RATE, 3.0))
    assert compare(one, back).differences == compare(back, one).differences == ()


def test_a_parameter_keeps_few_values_and_always_the_last() -> None:
    kept = ToldParameter({"0": 0}, "0")
    for k in range(1, 100):
        kept.take(str(k), k)
    assert (len(kept.values), kept.last, kept.values["99"], kept.values["0"]) == (MOST_VALUES, "99", 99, 0)


def test_what_only_one_capture_tells_is_no_difference(compare: Compare) -> None:
    found = compare(capture(told("RATE", RATE)), capture(told("GAIN", GAIN)))
    assert found.differences == ()
    assert "parameters: no node reported the same ones in both" in found.cannot
