"""What a recorder says and lacks: CAP-001 to -004, CAN-004 and BUS-005."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.encode import Frame, drop_line
from kit.judged import Said, judge, whole
from kit.simulated import flight
from kit.traffic import MS, SECOND, START, at, lines, status, throttle
from witness import finder
from witness.reader import Log

import analyzer
from analyzer.facts.error_frames import kind_of

if TYPE_CHECKING:
    from pathlib import Path

RULES = ("CAP", "CAN-004", "BUS-005")


def seen(log: str | bytes, *rules: str) -> list[Said]:
    """What is found, in one piece and in small ones."""
    return whole(log, rules or RULES)


def frames(*times: int, bus: str = "can0") -> list[Frame]:
    return [replace(at(t, throttle(k).frames()[0]), bus=bus) for k, t in enumerate(times)]


def error(t: int, error_class: int, data: str = "0000000000000000") -> Frame:
    return Frame(error_class, bytes.fromhex(data), START + t, error=True)


def test_a_step_back_in_time() -> None:
    (one,) = seen(lines(frames(10 * MS, 20 * MS, 19 * MS, 21 * MS)), "CAP-001")
    assert (one.frames, one.text, one.severity) == ((3,), "1.000 ms backward at frame 3", "warning")


def test_interfaces_have_clocks_of_their_own() -> None:
    mixed = lines(frames(10 * MS, 20 * MS), frames(12 * MS, 13 * MS, bus="can1"))
    assert seen(mixed, "CAP-001") == []


def test_a_gap_of_all_interfaces() -> None:
    log = lines(frames(0, 10 * MS), frames(20 * MS, bus="can1"), frames(2620 * MS, 2630 * MS))
    (one,) = seen(log, "CAP-002")
    assert (one.first, one.text, one.severity, one.bus) == (3, "2.6 s without a frame", "note", 1)


def test_no_gap_while_another_interface_has_frames() -> None:
    first = frames(0, bus="can1")
    assert seen(lines(first, frames(600 * MS, 1200 * MS, 1800 * MS), frames(1900 * MS, bus="can1")), "CAP-002") == []
    assert seen(lines(frames(0, SECOND)), "CAP-002") == []
    assert len(seen(lines(frames(0, SECOND + 1)), "CAP-002")) == 1


def test_a_late_frame_makes_no_gap() -> None:
    assert seen(lines(frames(0, 900 * MS, 300 * MS, 1400 * MS)), "CAP-002") == []


def test_without_times_there_are_no_rules_about_times() -> None:
    assert seen(lines(status(0).frames(), status(1).frames(), timed=False)) == []


def test_lines_that_cannot_be_read() -> None:
    good = lines(frames(0, MS)).decode()
    (one,) = seen(good + "(1700000000.2 can0 1F0406\n" + good.replace("(17000", "(17001"), "CAP-003")
    assert (one.count, one.severity) == (1, "error")
    assert one.text.startswith("line 3: ")


def test_frames_that_the_recorder_lost() -> None:
    log = lines(frames(0, MS)).decode().replace("\n", "\n" + drop_line("can0", 3, 3) + "\n", 1)
    (one,) = seen(log, "CAP-004")
    assert (one.text, one.bus, one.count) == ("3 frames dropped", 0, 1)


def test_an_overflow_mark_is_a_loss_and_no_error() -> None:
    log = lines(frames(0), error(MS, 0x004, "0001000000000000"), frames(2 * MS))
    found = [(one.rule, one.text) for one in seen(log) if one.rule != "CAP-005"]
    assert found == [("CAP-004", "some frames dropped")]


def test_error_frames_by_their_kind() -> None:
    stuffing = "0000040000000008"
    errors = [error(MS, 0x288, stuffing), error(2 * MS, 0x288, stuffing), error(3 * MS, 0x040)]
    log = lines(frames(0), errors, frames(9 * MS))
    said = {one.key: (one.count, one.text) for one in seen(log, "CAN-004")}
    assert said == {
        "kind=stuffing error": (2, "stuffing error, error counters tx 0 rx 8"),
        "kind=bus-off": (1, "bus-off, error counters tx ? rx ?"),
    }


@pytest.mark.parametrize(
    ("error_class", "data", "text"),
    [
        (0x020, "", "no acknowledge"),
        (0x008, "000001", "bit error"),
        (0x008, "000002", "form error"),
        (0x008, "00000008", "CRC error"),
        (0x008, "00000019", "no acknowledge"),
        (0x008, "", "protocol violation"),
        (0x004, "0004", "receive warning"),
        (0x004, "0020", "transmit passive"),
        (0x080, "", "bus error"),
        (0x048, "000004", "bus-off and stuffing error"),
        (0x400, "", "class 0x400"),
    ],
)
def test_error_classes_in_words(error_class: int, data: str, text: str) -> None:
    assert kind_of(error_class, bytes.fromhex(data)) == text


def burst(count: int, gap: int) -> bytes:
    errors = [error(10 * MS + k * gap, 0x088 if k % 3 else 0x020, "0000040000000000") for k in range(count)]
    return lines(frames(0), errors, frames(9 * SECOND))


def test_many_error_frames() -> None:
    (one,) = seen(burst(11, MS), "BUS-005")
    assert (one.count, one.text, one.severity) == (1, "11 error frames in 1 s, most: stuffing error", "error")
    assert seen(burst(10, MS), "BUS-005") == []
    assert seen(burst(30, 101 * MS), "BUS-005") == []
    (one,) = seen(burst(30, 100 * MS), "BUS-005")
    assert one.count == 2


@pytest.mark.slow
def test_flights_with_and_without_error_frames() -> None:
    text = flight("CAN-004@1")
    assert sum(one.count for one in seen(text, "CAN-004")) == len(finder("CAN-004")(Log(text))) == 1
    assert {one.rule for one in judge(flight(seconds=2), RULES)} == {"CAP-005"}


@pytest.mark.parametrize("ahead", [False, True])
def test_a_drop_explains_a_loss_beside_it_after_the_clock_went_back_too(tmp_path: Path, *, ahead: bool) -> None:
    overflow = "can0 20000004#0001000000000000"
    rows = [f"(100.0) {overflow}"] if ahead else []
    for k in range(60):
        rows += [f"(11.95) {overflow}"] if k == 20 else []
        rows.append(f"({10 + k / 10:.1f}) can0 1801550A#{k // 10:02X}000000000000{0xC0 | (k + 4 * (k >= 20)) % 32:02X}")
    path = tmp_path / "back.log"
    path.write_text("\n".join(rows) + "\n")
    report = analyzer.check(path, select=["TRF-016"])
    assert [(one.rule, one.severity) for one in report.findings] == [("TRF-016", "note")]
