"""Captures in which something lacks or stands in the wrong place: what is not heard is not called well."""

from __future__ import annotations

from random import Random

import pytest
from kit.stories import crash_log, said, told, triaged, without

from analyzer.report.triage.text import render

STALL = "motor-stall:tail=no:twin=no"
AUTOPILOT = 10
SHORT = 8  # digits of a frame's data


def shifted(text: str, seconds: float) -> str:
    rows = (line[1:].partition(")") for line in text.splitlines(keepends=True))
    return "".join(f"({float(t) + seconds:.6f}){rest}" for t, _, rest in rows)


def test_the_bus_of_the_other_escs_was_not_recorded() -> None:
    """One of them stalls: here control is lost and all that are heard obey."""
    text = without(crash_log(STALL, seed=4, escs=8, rate=50), lambda node, _, __: 15 <= node <= 18)
    found = triaged(text)
    assert found.first.kind == "unknown"
    assert "ch5 ch6 ch7 ch8 are commanded, and nobody reports as these" in found.first.title
    assert "a motor, propeller or ESC that is not heard here" in said(found)
    assert [one.kind for one in found.primary] == ["spread"]


def test_commands_alone_do_not_tell_that_no_esc_failed() -> None:
    found = triaged(without(crash_log(STALL, seed=4, escs=8, rate=50), lambda node, _, __: 11 <= node <= 18))
    assert (found.first.kind, found.first.title) == ("unknown", "cannot tell: control was lost, and no ESC reports")


def test_nobody_obeyed_who_is_not_heard() -> None:
    text = crash_log("zero-in-air:twin=no:tail=no", seed=18)
    assert "every ESC obeyed" in said(triaged(text))
    found = triaged(without(text, lambda node, _, __: node == 12))
    assert found.first.kind == "commanded"
    assert "obeyed" not in said(found)


def test_a_channel_of_another_flight_is_not_missed() -> None:
    text = crash_log(STALL, seed=3, escs=6, rate=50) + shifted(crash_log("landing", seed=5), 100)
    found = triaged(text)
    assert (found.first.kind, [one.end for one in found.flights]) == ("none", ["lost", "landed"])
    assert "nobody reports as that" not in said(found)
    assert found.commands[-1] == "tailbyte triage crash.log --flight 1"
    assert "in all flights 4 ESCs" in " ".join(found.looked)


def test_an_older_part_behind_a_newer_one_is_no_clock_that_was_set() -> None:
    text = crash_log("propeller-lost:tail=yes:twin=no", seed=12, rate=50)
    half = text.index("\n", len(text) // 2) + 1
    found = triaged(text[half:] + text[:half])
    assert found.first.title == "cannot tell: parts of the recording are in the wrong order"
    assert [label for label, _ in found.lines] == ["Clock"]
    assert "and uptimes with it" in found.lines[0][1]


def test_lines_in_reverse_order() -> None:
    lines = crash_log("landing", seed=5).splitlines(keepends=True)
    found = triaged("".join(reversed(lines)))
    assert found.judged.endswith("its times go backwards: are its lines in reverse order?")


def test_error_frames_alone() -> None:
    found = triaged("".join(f"({k / 100:.6f}) can0 20000088#0000040000000028\n" for k in range(100)))
    assert found.judged == "not judged: error frames, and no other"


def test_what_several_lack_at_once_is_one_hole() -> None:
    found = triaged(without(crash_log("landing", seed=5), lambda node, _, t: 11 <= node <= 18 and 12 < t < 13))
    assert found.lines == [
        ("Recorder", "lost frames of several senders together, once: nothing in there is evidence")
    ]  # fmt: skip


def test_motors_that_go_on_without_commands_were_commanded() -> None:
    found = triaged(without(crash_log("landing", seed=5), lambda node, _, t: node == AUTOPILOT and t > 12))
    assert (found.first.kind, found.first.support) == ("commands-lost", "possible")
    assert "motors turned for 9 s more, as if they got commands: not recorded?" in found.first.against


@pytest.mark.slow
def test_they_did_not_if_they_coast() -> None:
    found = told("command-loss", seed=41)
    assert (found.first.kind, found.first.support) == ("commands-lost", "well supported")


def test_motors_that_stop_with_something_wrong_did_not_land() -> None:
    """Nobody knows it without commands: the head says what was seen."""
    text = crash_log("propeller-lost:tail=yes:twin=no", seed=12, rate=50)
    found = triaged(without(text, lambda node, _, __: node == AUTOPILOT))
    assert found.first.kind == "unknown"
    assert render(found).splitlines()[0].endswith("1 flight, motors stopped")


def test_reports_that_are_broken_say_nothing() -> None:
    """The first byte of each frame of one ESC's reports, that of the sum among them, is another one."""
    text = crash_log("landing", seed=5)
    rows = (line.partition(" 1F040A0C#") for line in text.splitlines(keepends=True))
    torn = (before + sign + (f"FF{rest[2:]}" if len(rest) > SHORT else rest) for before, sign, rest in rows)
    found = triaged("".join(torn))
    assert found.first.kind == "none"
    assert "broken transfers of " in said(found)


def test_two_who_command_are_both_named() -> None:
    text = crash_log("landing", seed=5)
    other = "".join(
        line.replace("060A#", "0609#", 1) for line in text.splitlines(keepends=True) if " 1F04060A#" in line
    )
    found = triaged("".join(sorted((text + other).splitlines(keepends=True), key=lambda line: line[1:20])))
    assert any("Hz of nodes 9 and 10" in one for one in found.looked)


def test_what_was_seen_without_a_flight_is_shown() -> None:
    found = triaged(without(crash_log("gps-restart", seed=1), lambda node, _, __: node != 42))
    assert found.judged == "not judged: no ESC reports, nobody was armed"
    assert "restart" in {one.kind for one in found.earlier}
    assert any(row.startswith("Seen ") for row in render(found).splitlines())


def unevenly(text: str, often: int) -> str:
    """Leave reports of ESCs in a tenth of the time alone: nobody can say how evenly they come."""
    return without(text, lambda node, _, t: 11 <= node <= 18 and int(t * 10) % often > 0)


def test_who_fell_silent_unnoticed_is_not_said_to_obey() -> None:
    text = crash_log("esc-power:tail=yes:twin=no", seed=9)
    assert triaged(text).first.kind == "wiring"
    found = triaged(unevenly(text, 5))
    assert found.first.kind == "unknown"
    assert found.first.title == "cannot tell: control was lost, and ch3 reports nothing any more"


@pytest.mark.parametrize("torn", ["lost frames", "few reports"])
def test_a_recorder_that_loses_frames_hides_no_commands_that_stop_for_longer(torn: str) -> None:
    text = crash_log("autopilot-reboot:tail=yes:twin=no", seed=77)
    dice = Random(9)
    lines = text.splitlines(keepends=True)
    some = "".join(line for line in lines if dice.random() > 0.2) if torn == "lost frames" else unevenly(text, 5)
    found = triaged(some)
    assert found.first.kind == "commands-lost"
    assert "ESCs say that they get no commands" in said(found)
