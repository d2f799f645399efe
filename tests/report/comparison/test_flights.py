"""Flights compared: what broke first, how they ended, with how much throttle the vehicle flew."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import changed as flight

import analyzer
from analyzer.cli import main
from analyzer.report.comparison.rows import headline

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer import CaptureDiff
    from dissectors.traffic import Sending

    Compare = Callable[..., CaptureDiff]

CAPTURES = Path(__file__).resolve().parents[3] / "captures"


@cache
def found(good: str, bad: str) -> CaptureDiff:
    return analyzer.diff(CAPTURES / good, CAPTURES / bad)


@pytest.mark.parametrize(
    ("bad", "weight", "who", "what"),
    [
        ("zero-in-air.log", "error", 10, "all motors were commanded to stop in the air"),
        ("propeller-lost.log", "error", 14, "lost the load of its motor: propeller"),
        ("heavy-lift.log", "error", None, "all motors were at their limit"),
        ("swapped-esc.log", "warning", 14, "it tipped over at take-off"),
        ("recorder-overload.log", "warning", None, "the recorder lost frames"),
    ],
)
def test_what_broke_first_is_a_difference(bad: str, weight: str, who: int | None, what: str) -> None:
    (one, *_) = (one for one in found("hover-4.log", bad).differences if one.kind == "flight")
    assert (one.weight, one.node, one.good, one.bad) == (weight, who, "no", "yes")
    assert one.what.startswith(what)
    assert one.command == f"tailbyte triage {CAPTURES / bad}"
    assert headline(found("hover-4.log", bad))[0] == "DIFFERENT"


def test_where_it_began() -> None:
    (one,) = (one for one in found("hover-4.log", "zero-in-air.log").differences if one.weight == "error")
    assert (one.frame, one.since, one.support) == (3218, "first", "well supported")
    assert one.remark.startswith("commands go from 68 % to 0 at once")


def test_what_only_the_first_flight_had_is_no_likeness() -> None:
    back = found("heavy-lift.log", "hover-4.log")
    (one,) = (one for one in back.differences if one.kind == "flight")
    assert (one.weight, one.eased, one.good, one.bad, one.t_ns) == ("note", True, "yes", "no", None)
    assert headline(back) == ("DIFFERENT", "nothing worse than it was, 2 notes")


@pytest.mark.parametrize("bad", ["hover-4.log", "recording-ends.log", "power-cut.log"])
def test_recordings_that_end_in_calm_flight_are_alike(bad: str) -> None:
    assert not [one for one in found("hover-4.log", bad).differences if one.kind == "flight" or one.weight != "note"]


def test_no_flight_where_there_was_one() -> None:
    (one,) = (one for one in found("hover-4.log", "startup.log").differences if one.kind == "flight")
    assert (one.what, one.weight, one.good, one.bad) == ("flights", "warning", "1", "none")
    assert "how flights went: the second capture has none" in found("hover-4.log", "startup.log").cannot


def pushed(sending: Sending, _: int) -> dict[str, Any]:
    """The third ESC is commanded 15 % more than it would be."""
    if sending.name != "RawCommand" or sending.values["cmd"][2] <= 0:
        return {}
    first, second, third, *more = sending.values["cmd"]
    return {"cmd": [first, second, third + 1200, *more]}


def test_what_one_esc_is_commanded_beyond_the_others(compare: Compare) -> None:
    (one,) = (one for one in compare(flight(), flight(pushed)).differences if one.what == "command, median")
    assert (one.who, one.weight, one.remark) == ("ch3", "warning", "")
    assert one.bad_value - one.good_value == pytest.approx(15, abs=2)
    (back,) = (one for one in compare(flight(pushed), flight()).differences if one.what == "command, median")
    assert (back.good, back.bad) == (one.bad, one.good)


def test_what_all_are_commanded() -> None:
    (one,) = (d for d in found("hover-4.log", "heavy-lift.log").differences if d.what == "command, median")
    assert (one.who, one.weight, one.node) == ("all 4 ESCs", "note", None)


def test_a_beginning_ends_as_it_likes(tmp_path: Path) -> None:
    lines = (CAPTURES / "zero-in-air.log").read_text().splitlines(keepends=True)
    part = tmp_path / "part.log"
    part.write_text("".join(lines[: len(lines) // 2]))
    some = analyzer.diff(CAPTURES / "zero-in-air.log", part).differences
    assert [(one.what, one.eased) for one in some if one.kind == "flight"] == [
        ("all motors were commanded to stop in the air", True)
    ]


@pytest.mark.parametrize(("options", "code"), [([], 1), (["-Y", "ESCStatus"], 0)])
def test_fails_on_flights(options: list[str], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [str(CAPTURES / name) for name in ("hover-4.log", "zero-in-air.log")]
    assert main(["diff", *paths, "--fail-on", "flight", *options]) == code
    assert ("in the air" in capsys.readouterr().out) is (code == 1)


def test_where_a_recording_ended_is_no_trouble_that_was_over() -> None:
    notes = [one for one in found("hover-4.log", "zero-in-air.log").differences if one.rule == "CAP-005"]
    assert [(one.good, one.bad, one.weight, one.eased) for one in notes] == [("1x", "none", "note", False)]
