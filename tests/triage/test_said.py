"""What an autopilot's own log says for and against the verdict of the bus, and what is like it and does not count."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES, dataflash
from kit.dataflash import battery, record
from kit.stories import excluded, without

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.flight.autopilot.track import OUTPUTS
from analyzer.flight.autopilot.words import SAID
from analyzer.flight.verdict.pages import VERDICTS
from analyzer.flight.verdict.said import entries
from analyzer.sources.dataflash import read_log
from analyzer.sources.origin import given

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.flight.verdict.model import Triage

BEFORE = 60.0  # seconds from the start of the autopilot to that of the capture
Row = tuple[int, bytes]


@cache
def capture(name: str) -> bytes:
    return (CAPTURES / name).read_bytes()


def micros(seconds: float) -> int:
    return round((BEFORE + seconds) * 1e6)


def outputs(until: float = 20, drop: float | None = None) -> list[Row]:
    """Four outputs 10 times a second that move a little, up to a time; all low from `drop` on."""
    times = [k / 10 for k in range(-100, round(until * 10) + 1)]
    pulses = [1000 if t < 0 or (drop is not None and t >= drop) else 1600 + 20 * (round(t * 10) % 3) for t in times]
    rows = [(micros(t), pulse) for t, pulse in zip(times, pulses, strict=True)]
    return [(at, record("RCOU", at, *(4 * [pulse] + 10 * [0]))) for at, pulse in rows]


def reports(chs: Iterable[int], start: float = 0, until: float = 20) -> list[Row]:
    """What its log has of ESCs: reports 10 times a second, channels from 1."""
    times = [micros(start + k / 10) for k in range(round((until - start) * 10))]
    return [(t, record("ESC", t, ch - 1, 3000, 3000, 48, 9, 30, 0, 25, 0)) for t in times for ch in chs]


def said(*words: tuple[Any, ...]) -> list[Row]:
    return [(micros(at), record(name, micros(at), *values)) for at, name, *values in words]


def told(name: str | bytes, *parts: list[Row]) -> Triage:
    file = io.BytesIO(dataflash.log(*parts))
    file.name = "flight.bin"  # type: ignore[misc]
    log = replace(read_log(file, (OUTPUTS, *SAID)), given=-round(BEFORE * 1e9))
    source = io.BytesIO(capture(name) if isinstance(name, str) else name)
    source.name = "crash.log"  # type: ignore[misc]
    run = Run(Request((given(source),)))
    looked = RunTriage(run, log)
    for _ in looked.over(run.inside()):
        pass
    return looked.found()


def own(lines: Iterable[str]) -> list[str]:
    return [line for line in lines if line.startswith("autopilot, ")]


# ---- words


@pytest.mark.parametrize(
    ("words", "counts"),
    [
        ([(2.5, "ERR", 16, 2)], True),
        ([(-20, "ERR", 16, 2)], True),  # and it was never over
        ([(4.5, "ERR", 16, 2)], False),  # behind it
        ([(-30, "ERR", 16, 2), (-20, "ERR", 16, 0)], False),  # long over
        ([(2.5, "ERR", 16, 0)], False),  # that something is over is no trouble
        ([(2.5, "ERR", 5, 1)], False),  # of another one
        ([(2.5, "MSG", "EKF variance")], False),  # people's words, which firmwares change
    ],
)
def test_what_was_not_sure_of_its_attitude_before_speaks_for_lost_control(words: list[Any], *, counts: bool) -> None:
    found = told("control-lost.log", said(*words), outputs())
    assert (found.first.kind, found.first.support) == ("control", "well supported" if counts else "likely")
    assert bool(own(found.first.reasons)) == counts
    assert own(found.first.against) == []


def test_and_against_an_esc_that_failed_first() -> None:
    found = told("propeller-lost.log", said((2, "ERR", 17, 1)), outputs())
    assert (found.first.kind, found.first.support) == ("propulsion", "likely")
    assert own(found.first.against) == ["autopilot, 1.3 s before: EKF failsafe: began"]


@pytest.mark.parametrize(("motor", "at", "counts"), [(4, 3.7, True), (2, 3.7, False), (4, 4.6, False)])
def test_the_motor_that_it_names(motor: int, at: float, *, counts: bool) -> None:
    words = said((at, "MSG", f"Potential Thrust Loss ({motor})"))
    found = told("propeller-lost.log", words, outputs())
    expected = ["autopilot, just then: Potential Thrust Loss (4)"] if counts else []
    assert own(found.first.reasons) == expected
    assert found.first.ch == 4


def test_who_decided_that_all_is_zero() -> None:
    found = told("zero-in-air.log", said((3.34, "ARM", 0, 0, 1, 2)), outputs(drop=3.3))
    assert found.first.kind == "commanded"
    assert "autopilot, just then: disarmed, forced, by: switch" in found.first.reasons
    assert "its own outputs (RCOU) go down to nothing then, too" in found.first.reasons
    assert "a failsafe or disarming before it" not in excluded(found)


def test_a_crash_check_speaks_against_zero_as_a_cause() -> None:
    found = told("zero-in-air.log", said((3.34, "ERR", 12, 1)), outputs())
    assert own(found.first.against) == ["autopilot, just then: crash check: crashed: motors are stopped"]
    assert "its own outputs (RCOU) stay at" in " ".join(found.first.against)
    assert found.first.support == "likely"


def test_a_gps_that_it_lost_too() -> None:
    words = said((17.1, "ERR", 11, 2), (17.2, "EV", 19), (17.1, "ERR", 18, 1))
    found = told("gps-restart.log", words, outputs(40))
    assert own(found.first.reasons) == [
        "autopilot, just then: GPS: glitch: its place jumped", "autopilot, just then: GPS lost",
    ]  # fmt: skip


def test_words_count_without_outputs_too() -> None:
    found = told("control-lost.log", said((2.5, "ERR", 16, 2)))
    assert own(found.first.reasons)
    assert not any("log" in one.seen for one in found.excluded)


def test_a_cause_that_nothing_proves_stays_possible() -> None:
    found = told("swapped-esc.log", said((1.0, "ERR", 16, 2)), outputs())
    assert (found.first.kind, found.first.support) == ("setup", "possible")


# ---- what it measured


def test_an_autopilot_that_lives_on_without_commands_on_the_bus() -> None:
    found = told("command-loss.log", outputs(12))
    assert found.first.kind == "commands-lost"
    assert "the autopilot lived: its log runs on for 9.5 s, outputs at 9" in " ".join(found.first.reasons)


def test_and_one_that_stops_with_them() -> None:
    found = told("command-loss.log", outputs(2.4))
    assert "the autopilot's log ends then, too: it stopped, or lost its power" in found.first.reasons


def test_a_log_that_ended_long_before_says_nothing_of_it() -> None:
    assert not any("autopilot" in reason for reason in told("command-loss.log", outputs(0.5)).first.reasons)


@pytest.mark.parametrize(
    ("until", "fits", "other"),
    [
        (4.1, "power of the vehicle", None),
        (12.0, "the recorder: its power", ("does not", "power of the vehicle: the autopilot's log runs on for 7.8 s")),
        (2.0, "the vehicle flew on", ("autopilot", "its log ends 2.2 s before: it says nothing of the end")),
    ],
)
def test_a_recording_that_ends_in_flight(until: float, fits: str, other: tuple[str, str] | None) -> None:
    found = told("power-cut.log", outputs(until))
    notes = found.first.notes
    assert found.first.kind == "unknown"
    assert dict(notes)["fits"].startswith(fits)
    assert other is None or other in notes
    assert len([label for label, _ in notes if label == "fits"]) == 1


def test_a_hole_of_the_recording_makes_its_log_no_longer() -> None:
    """The log ends with the recording, which lacks 1.6 s in its middle."""
    lines = capture("power-cut.log").decode().splitlines(keepends=True)
    start = float(lines[0][1 : lines[0].index(")")])
    torn = "".join(line for line in lines if not 1.5 < float(line[1 : line.index(")")]) - start < 3.1)
    notes = dict(told(torn.encode(), outputs(4.1)).first.notes)
    assert notes["fits"].startswith("power of the vehicle")


@pytest.mark.parametrize(
    ("chs", "until", "side", "text"),
    [
        ((1, 2, 3, 4), 20, "against", "the autopilot heard it on: "),
        ((1, 3, 4), 20, "reasons", "the autopilot's log has no report of ch2 then either, but of others"),
        ((), 3, "reasons", ""),
    ],
)
def test_an_esc_that_stopped_reporting(chs: tuple[int, ...], until: float, side: str, text: str) -> None:
    torn = without(capture("hover-4.log").decode(), lambda node, _, t: node == 12 and t > 3)
    found = told(torn.encode(), outputs(), reports([1, 2, 3, 4], until=3), reports(chs, 3, until))
    assert (found.first.kind, found.first.ch) == ("wiring", 2)
    lines = [line for line in getattr(found.first, side) if "the autopilot" in line]
    assert [line[: len(text)] for line in lines] == ([text] if text else [])


def test_reports_in_a_hole_speak_against_a_broken_bus() -> None:
    found = told("bus-break.log", outputs(), reports(range(1, 5)))
    assert found.first.kind == "bus"
    assert any("the autopilot heard ESCs meanwhile" in line for line in found.first.against)
    assert not any("meanwhile" in line for line in told("bus-break.log", outputs()).first.against)


def test_reports_in_holes_of_the_recorder_speak_for_it() -> None:
    found = told("recorder-overload.log", outputs(), reports(range(1, 5), until=40))
    assert found.first.kind == "recorder"
    assert found.first.against == ()


@pytest.mark.parametrize(("falls", "side"), [(True, "reasons"), (False, "against")])
def test_the_battery_monitor(side: str, *, falls: bool) -> None:
    volts = [(micros(k / 10), 48.0 if k < 48 or not falls else 36.0) for k in range(80)]
    found = told("pack-sag.log", outputs(), [(t, battery(t, volt)) for t, volt in volts])
    assert found.first.kind == "battery"
    (line,) = (one for one in getattr(found.first, side) if one.startswith("its battery monitor: 48.0 -> "))
    assert ("not the pack that it watches" in line) is not falls


# ---- what it rules out


def test_what_its_log_would_have_told_is_ruled_out() -> None:
    found = excluded(told("propeller-lost.log", outputs()))
    assert found["the autopilot stopping"].startswith("its log runs on, 16.")
    assert found["a failsafe or disarming before it"] == "its log has none in this flight"
    late = excluded(told("propeller-lost.log", outputs()[130:]))
    assert "a failsafe or disarming before it" not in late
    failed = excluded(told("propeller-lost.log", said((2, "ERR", 5, 1)), outputs()))
    assert "a failsafe or disarming before it" not in failed


# ---- the entries


def test_every_entry_speaks_of_kinds_and_records_that_there_are() -> None:
    for entry in entries():
        assert {*entry.for_, *entry.against} <= set(VERDICTS)
        assert entry.for_ or entry.against
        assert entry.type in SAID
        assert entry.why
        assert entry.when in {"before", "with"}


def test_nobody_is_called_ill_by_its_words_alone() -> None:
    """Every word that there is, all through a flight of which the bus tells nothing wrong."""
    words = [(0.2 * k, "ERR", k % 30, 1 + k % 3) for k in range(1, 24)] + [(2, "EV", 19), (3, "MODE", 14, 14, 3)]
    found = told("hover-4.log", said((-50, "MSG", "ArduCopter V4.5.7"), *words), outputs(20))
    assert found.first.kind == "unknown"
    assert [one.kind for one in found.verdicts] == ["unknown"]
    assert found.said
