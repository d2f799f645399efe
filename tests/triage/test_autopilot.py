"""The autopilot's log on the time axis of a capture: found where it belongs, with an error that holds, or refused."""

from __future__ import annotations

import io
import json
import random
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import dataflash
from kit.dataflash import rcou, record, words
from kit.simulated import flown
from kit.strategies import examples

from analyzer.flight.autopilot.track import OUTPUTS
from analyzer.flight.autopilot.words import SAID
from analyzer.flight.autopilot.words import words as said_of
from analyzer.flight.finder import EventFinder
from analyzer.sources.dataflash import AutopilotLog, read_log
from analyzer.tables import raw_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dissectors import Registry

SECOND, MICROS = 10**9, 1000
BEFORE = 100 * SECOND + 123_456  # from the start of the autopilot to that of the capture
_Told = tuple[list[dict[str, Any]], dict[str, Any], list[str]]


@cache
def flight(plan: str = "hover", seed: int = 1, seconds: float = 10, escs: int = 4) -> tuple[str, list[Any], int]:
    """Candump text, commands with the times of the capture, and its start."""
    made = flown(seconds, flight=plan, seed=seed, escs=escs)
    zero = made.simulation.settings.start
    commands = [(zero + one.frames[0].t, one.values["cmd"]) for one in made.of("RawCommand")]
    return made.text, commands, zero


def log(*parts: Sequence[tuple[int, bytes]], cut: float = 1.0) -> AutopilotLog:
    data = dataflash.log(*parts)
    file = io.BytesIO(data[: max(3, round(cut * len(data)))])
    file.name = "flight.bin"  # type: ignore[misc]
    return read_log(file, (OUTPUTS, *SAID))


@pytest.fixture
def told(decode: Callable[..., Any], registry: Registry) -> Callable[..., _Told]:
    """Gives the events that the autopilot tells, what became of its log, and notes."""

    def run(text: str, log: AutopilotLog) -> _Told:
        finder = EventFinder(registry, log)
        for batch in decode(text.encode()).batches:
            finder.feed(batch)
        rows = [row for row in raw_rows(finder.finish()) if row["source"] == "autopilot"]
        assert finder.autopilot is not None
        return rows, finder.autopilot, finder.notes

    return run


def off(found: dict[str, Any], boot: int) -> tuple[int, int]:
    """How far off the start of the autopilot's clock is, and how far it may be; in ns."""
    (part,) = found["parts"]
    return abs(part["offset_ns"] - boot), part["error_ns"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("plan", "hz", "first"), [("hover", 10, 1), ("hover", 50, 5), ("mission", 10, 1)])
def test_its_clock_is_found(plan: str, hz: float, first: int, told: Callable[..., _Told]) -> None:
    text, commands, start = flight(plan, 2, 20) if plan == "mission" else flight()
    boot = start - BEFORE
    rows, found, notes = told(text, log(rcou(commands, boot, hz, first=first), words(BEFORE // MICROS, (5, "EV", 28))))
    far, error = off(found, boot)
    assert far <= error < 6_000_000
    assert found["by"] == "outputs"
    (row,) = rows
    true = boot + (BEFORE // MICROS + 5_000_000) * MICROS
    assert row["t"] <= true <= row["t_end"]
    assert (row["kind"], row["type"], row["text"]) == ("autopilot event", "EV", "not landed any more")
    assert [row[name] for name in ("bus", "node", "ch", "frame", "until")] == [None] * 5
    assert len(notes) == 1


@given(
    st.integers(-400 * SECOND, 2 * SECOND), st.sampled_from([10, 25]), st.floats(0.3, 1), st.floats(0, 0.5),
    st.floats(0.5, 1), st.integers(0, 2**20),
)  # fmt: skip
@examples(15)
def test_any_shift_is_found_again_from_any_cut(
    told: Callable[..., _Told], shift: int, hz: float, cut: float, low: float, high: float, seed: int
) -> None:
    """What both have in common may be too little to be sure: then it is refused, but never wrong."""
    text, commands, start = flight()
    lines = text.splitlines(keepends=True)
    part = "".join(lines[int(low * len(lines)) : int(high * len(lines))])
    boot = start + shift
    _, found, _ = told(part, log(rcou(commands, boot, hz, seed=seed), cut=cut))
    if found["parts"]:
        far, error = off(found, boot)
        assert far <= error
    assert found["parts"] or cut < 0.95 or high - low < 0.8


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("noise", "drift"), [(0.5, 0), (1, 5e-5), (0, -1e-4)])
def test_noise_and_drift_are_in_its_error(noise: float, drift: float, told: Callable[..., _Told]) -> None:
    text, commands, start = flight("mission", 2, 20)
    outputs = rcou(commands, start - SECOND, noise=noise, drift=drift)
    middle = len(outputs) // 2
    (row,), _, _ = told(text, log(outputs, [(outputs[middle][0], record("EV", outputs[middle][0], 17))]))
    true = start - SECOND + outputs[middle][0] * MICROS / (1 + drift)
    assert row["t"] <= true <= row["t_end"]
    assert row["t_end"] - row["t"] < 60_000_000


def test_frames_that_the_recorder_lost_are_no_hindrance(told: Callable[..., _Told]) -> None:
    text, commands, start = flight()
    dice = random.Random(5)
    thinned = "".join(line for line in text.splitlines(keepends=True) if dice.random() > 0.3)
    _, found, _ = told(thinned, log(rcou(commands, start - BEFORE)))
    far, error = off(found, start - BEFORE)
    assert far <= error < 20_000_000


def test_wrong_times_in_the_log_hide_nothing(told: Callable[..., _Told]) -> None:
    """Records have no checksum: a flipped bit may be a time in years from now."""
    text, commands, start = flight()
    outputs = rcou(commands, start - BEFORE)
    for at, micros in ((20, 2**51), (40, 0), (41, 2**40), (70, 2**51)):
        outputs[at] = (outputs[at][0], outputs[at][1][:3] + micros.to_bytes(8, "little") + outputs[at][1][11:])
    _, found, _ = told(text, log(outputs))
    far, error = off(found, start - BEFORE)
    assert far <= error < 6_000_000


@pytest.mark.slow
def test_no_other_flight_is_taken_for_it(told: Callable[..., _Told]) -> None:
    flights = [flight(), flight(seed=2), flight("mission", 2, 20)]
    for text, _, start in flights:
        for _, commands, other in flights:
            rows, found, notes = told(text, log(rcou(commands, other - BEFORE), words(BEFORE // MICROS, (5, "EV", 28))))
            if start == other and commands is next(c for t, c, _ in flights if t is text):
                assert found["parts"]
            else:
                assert (rows, found["parts"], notes) == ([], [], [])
                assert "nowhere the commands on the bus" in found["text"]


def test_what_cannot_be_proven_is_not_told(told: Callable[..., _Told]) -> None:
    text, commands, start = flight()
    boot = start - BEFORE
    still = [(t, [4000] * 4) for t, _ in commands]
    said = words(BEFORE // MICROS, (5, "EV", 28))
    for capture, outputs, why in (
        (text, [], "has no outputs (RCOU)"),
        (text, rcou(still, boot), "its outputs do not move"),
        (text_of_others(text), rcou(commands, boot), "no throttles are commanded on the bus"),
        (text, rcou(commands, boot)[22:34], "nowhere the commands on the bus"),
    ):
        rows, found, _ = told(capture, log(outputs, said))
        assert (rows, found["parts"]) == ([], [])
        assert why in found["text"]


def text_of_others(text: str) -> str:
    """The capture without what the autopilot sends."""
    return "".join(line for line in text.splitlines(keepends=True) if not line.split("#")[0].endswith("0A"))


def test_a_given_start_is_taken(told: Callable[..., _Told]) -> None:
    text, _, start = flight()
    said = words(0, (-0.0, "EV", 10), (3.5, "EV", 11))
    rows, found, notes = told(text, replace(log(said), given=2 * SECOND))
    first = min(t for t in (row["t"] for row in rows)) - 2 * SECOND
    assert start <= first < start + SECOND
    assert [(row["t"] - first, row["t_end"] - first) for row in rows] == [(2 * SECOND,) * 2, (5_500_000_000,) * 2]
    assert (found["by"], found["parts"][0]["error_ns"]) == ("given", 0)
    assert "2.0000 s behind the first frame, as it is given" in notes[0]


def test_a_clock_that_is_set_in_flight(told: Callable[..., _Told]) -> None:
    """The autopilot's clock runs on: both parts are found, and each word is by the clock of its own."""
    text, commands, start = flight("mission", 2, 20)
    middle = start + 11 * SECOND
    moved = []
    for line in text.splitlines(keepends=True):
        stamp, _, rest = line[1:].partition(")")
        whole, _, fraction = stamp.partition(".")
        t = int(whole) * SECOND + int(fraction.ljust(9, "0"))
        t += 7213 * SECOND * (t > middle)
        moved.append(f"({t // SECOND}.{t % SECOND:09d}){rest}")
    boot = start - BEFORE
    said = words(BEFORE // MICROS, (8, "EV", 28), (15, "EV", 18))
    rows, found, _ = told("".join(moved), log(rcou(commands, boot), said))
    assert len(found["parts"]) == 2
    for row, true in zip(rows, (start + 8 * SECOND, start + 7228 * SECOND), strict=True):
        assert row["t"] - 1000 <= true <= row["t_end"] + 1000


def test_words_keep_their_order(told: Callable[..., _Told]) -> None:
    text, commands, start = flight()
    said = words(
        BEFORE // MICROS, (-90, "MSG", "ArduCopter V4.5.7 (2a3dc4b7)"), (-5, "MODE", 0, 0, 1), (2, "ARM", 1, 0, 1, 1),
        (6, "ERR", 6, 1), (6, "MODE", 9, 9, 4), (6, "MSG", "Battery 1 is low \x1b[31m"), (8, "MODE", 9, 9, 4),
        (9, "ERR", 12, 1), (9, "ARM", 0, 0, 0, 12), (9, "EV", 11), (9, "EV", 99), (9, "ERR", 99, 7),
        (9, "MODE", 77, 77, 99),
    )  # fmt: skip
    rows, _, notes = told(text, log(rcou(commands, start - BEFORE), said))
    assert [(row["kind"], row["type"], row["text"]) for row in rows] == [
        ("mode", "MODE", "Stabilize (the pilot tilts and gives thrust), why: the pilot's switch"),
        ("arming", "ARM", "armed, forced, by: ground station"),
        ("autopilot error", "ERR", "battery failsafe: began: voltage or charge too low"),
        ("mode", "MODE", "Stabilize -> Land (comes down), why: battery failsafe"),
        ("message", "MSG", "Battery 1 is low \x1b[31m"),
        ("autopilot error", "ERR", "crash check: crashed: motors are stopped"),
        ("arming", "ARM", "disarmed, by: crash check"),
        ("autopilot event", "EV", "event 99"),
        ("autopilot error", "ERR", "subsystem 99: code 7"),
        ("mode", "MODE", "Land -> mode 77"),
    ]
    assert json.loads(rows[2]["values"]) == {"subsystem": 6, "code": 1}
    assert notes[-1].endswith("more than 60 s before or behind the capture: 1")


def test_modes_of_a_vehicle_that_nobody_names_are_numbers(told: Callable[..., _Told]) -> None:
    text, commands, start = flight()
    said = words(BEFORE // MICROS, (1, "MSG", "MyFirmware V4.5.7"), (2, "MODE", 10, 10, 2), (3, "EV", 10))
    rows, _, _ = told(text, log(rcou(commands, start - BEFORE), said))
    assert [row["text"] for row in rows] == ["MyFirmware V4.5.7", "mode 10, why: the ground station", "armed"]


@pytest.mark.parametrize(
    ("firmware", "mode", "name"),
    [
        ("ArduCopter V4.5.7 (2a3dc4b7)", 5, "Loiter (holds its place)"),
        ("ArduPlane V4.5.7", 5, "FBWA (the pilot tilts it within limits)"),
        ("APM:Plane 3.9", 21, "QRTL (flies home and lands by hovering)"),
        ("ArduRover V4.5.7", 4, "Hold (stops, or drifts as a boat)"),
        ("ArduSub V4.1.2", 9, "Surface (comes up)"),
        ("ArduSub V4.1.2", 5, "mode 5"),
        ("Blimp V4.2", 0, "mode 0"),
    ],
)
def test_a_number_of_a_mode_is_that_of_its_vehicle(firmware: str, mode: int, name: str) -> None:
    said = words(BEFORE // MICROS, (1, "MSG", firmware), (2, "MODE", mode, mode, 2), (3, "ERR", 10, mode))
    _, told, refused = said_of(log(said))
    assert told.text == f"{name}, why: the ground station"
    assert refused.text == f"flight mode: refused: mode {name.partition(' (')[0].removeprefix('mode ')}"


def test_an_error_is_over_when_its_subsystem_says_so() -> None:
    said = words(0, (1, "ERR", 16, 2), (2, "ERR", 6, 1), (3, "ERR", 16, 2), (4, "ERR", 16, 0), (5, "ERR", 12, 1),
                 (6, "ERR", 10, 4), (7, "ERR", 10, 0))  # fmt: skip
    ends = [word.until for word in said_of(log(said))]
    assert ends == [4_000_000, None, 4_000_000, None, None, None, None]


def test_a_low_battery_by_the_parameters_of_the_log(told: Callable[..., _Told]) -> None:
    text, commands, start = flight()
    zero = BEFORE // MICROS
    volts = [50 - abs(k - 50) * -0.1 if k > 50 else 50 - 0.1 * k for k in range(100)]  # 45 V at 5 s, then up
    readings = [(zero + k * 100_000, dataflash.battery(zero + k * 100_000, volt)) for k, volt in enumerate(volts)]
    settings = [
        (1, record("PARM", 1, name, value, 0)) for name, value in {"BATT_LOW_VOLT": 48, "BATT_LOW_TIMER": 2}.items()
    ]
    rows, _, _ = told(text, log(rcou(commands, start - BEFORE), readings, settings))
    (row,) = rows
    assert (row["kind"], row["text"]) == ("low battery", "battery 1 low: below 48.0 V")
    assert json.loads(row["values"])["voltage"] == pytest.approx(45.1, abs=0.15)
    assert row["t_end"] - start == pytest.approx(2.1 * SECOND, abs=0.2 * SECOND)
    assert told(text, log(rcou(commands, start - BEFORE), readings))[0] == []


def test_records_of_another_shape_are_no_words(told: Callable[..., _Told]) -> None:
    """A log may describe its records as it likes: a text where a number belongs says nothing."""
    text, commands, start = flight()
    dice = random.Random(3)
    outputs = rcou(commands, start - BEFORE)
    head = dataflash.HEAD + b"".join(
        dataflash.description(kind, name, form, columns)
        for kind, name, form, columns in (
            (120, "ERR", "QZB", "TimeUS,Subsys,ECode"), (121, "EV", "Qn", "TimeUS,Id"),
            (122, "MSG", "QB", "TimeUS,Message"), (123, "BAT", "QB", "TimeUS,Inst"),
            (124, "MODE", "Qf", "TimeUS,ModeNum"),
        )
    )  # fmt: skip
    rows = [
        b"\xa3\x95" + bytes([kind]) + (BEFORE // MICROS + 10**6).to_bytes(8, "little") + dice.randbytes(size)
        for kind, size in ((120, 65), (121, 4), (122, 1), (123, 1))
    ]
    rows.append(b"\xa3\x95\x7c" + (BEFORE // MICROS + 10**6).to_bytes(8, "little") + b"\0\0\xc0\x7f")
    file = io.BytesIO(dataflash.log(outputs, head=head) + b"".join(rows))
    file.name = "flight.bin"  # type: ignore[misc]
    found, _, _ = told(text, read_log(file, (OUTPUTS, *SAID)))
    assert [(row["text"], row["values"]) for row in found] == [("mode nan", '{"reason": 0}')]
