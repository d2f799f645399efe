"""Fault flags, error mode and system faults as episodes: how long, how the ESC was at their onset, and at its worst."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES, encode
from kit.judged import registry, whole
from kit.traffic import MOTOR, STATUS, UNIT, log

import analyzer
from analyzer.decode.engine import Engine
from analyzer.report.formats import FORMATS
from analyzer.report.newest import Newest
from analyzer.rules.checking import Check
from analyzer.rules.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.formats import ReportFormat

IDLE, ERROR = 2 << 12, 6 << 12
OVER_VOLTAGE, UNDER_VOLTAGE, OVER_CURRENT, LOSS, HOT, STALL = 1, 2, 4, 8, 32, 128
RULES = ("TYP-305", "TYP-306", "PUSH-401", "PUSH-410")
START = (0.0, "RawCommand", {"cmd": [0]}, 10)

Row = tuple[float, str, dict[str, Any], int]


def text(rows: Iterable[Row]) -> str:
    """Transfers by time in ms; counters go on for each node and type."""
    count: dict[tuple[int, str], int] = {}
    sent = []
    for t, name, values, node in sorted(rows, key=lambda row: row[0]):
        number = count[node, name] = count.get((node, name), -1) + 1
        if name == "MotorStatus":
            whole_packet = encode.packet("PUSHCAN.MotorStatus", number, UNIT, **values)
            fields = {"data_sequence": number, "data": list(whole_packet)}
            sent.append((t, encode.transfer("PUSHCAN", fields, node, number)))
        else:
            sent.append((t, encode.transfer(name, values, node, number)))
    return log(*sent)


def status(t: float, bits: int = 0, node: int = 11, mode: int = IDLE, **fields: Any) -> Row:
    return t, "ESCStatus", STATUS | {"esc_index": 0, "error_count": mode | bits} | fields, node


def statuses(times: Iterable[float], bits: int = 0, **fields: Any) -> list[Row]:
    return [status(t, bits, **fields) for t in times]


def motor(t: float, node: int = 11, **fields: int) -> Row:
    return t, "MotorStatus", MOTOR | fields, node


def told(rows: Sequence[Row], *rules: str) -> list[tuple[str, int, str]]:
    """Rule, count and text, in one batch and in several."""
    return [(one.rule, one.count, one.text) for one in whole(text([START, *rows]), rules or RULES, (41,))]


def test_a_fault_is_told_with_its_length_its_onset_and_its_worst() -> None:
    rows = statuses(range(0, 1000, 50))
    rows += [
        status(1000, HOT, voltage=46.0, current=30.0, temperature=110.0, rpm=-4800),
        status(1500, HOT, voltage=44.0, current=-45.0, temperature=124.0, rpm=-300),
        status(2200, HOT, voltage=47.0, current=10.0, temperature=90.0, rpm=-5000),
    ]
    rows += statuses(range(2300, 4000, 50))
    assert told(rows) == [
        ("TYP-305", 3, ("MOS over temperature for 1.2 s: 46.0 V, 30.0 A, 110 degC, -4800 rpm at onset; "
                       "44.0 V, -45.0 A, 124 degC, -300 rpm at worst")),
    ]  # fmt: skip


def test_the_highest_voltage_is_the_worst_of_over_voltage() -> None:
    rows = [status(t, OVER_VOLTAGE, voltage=voltage) for t, voltage in ((100, 60.0), (200, 63.0), (300, 61.0))]
    ((_, _, said),) = told([*rows, status(2000)])
    assert "60.0 V" in said
    assert "; 63.0 V" in said
    assert "; 61.0 V" in told([status(one[0], UNDER_VOLTAGE, voltage=one[2]["voltage"]) for one in rows[1:]])[0][2]


def test_a_packet_tells_the_same() -> None:
    rows = [motor(t, fault=HOT | 1 << 12, voltage=4850 - t, current=-120) for t in range(0, 1000, 100)]
    rows += [motor(t) for t in range(1000, 3000, 100)]
    assert told(rows) == [
        ("PUSH-410", 10, ("MOS over temperature (0x0020), bit 12 (0x1000) for 0.90 s: 48.5 V, -1.2 A, "
                          "41 degC, 3011 rpm at onset; 39.5 V, -1.2 A, 41 degC, 3011 rpm at worst")),
    ]  # fmt: skip


def test_a_system_fault_and_error_mode_are_episodes() -> None:
    rows = [motor(t, system_status=0xCC) for t in range(0, 2100, 100)]
    rows += statuses(range(0, 1000, 100), mode=4 << 12) + statuses(range(1000, 2050, 50), STALL, mode=ERROR)
    found = {rule: said.partition(": 48")[0] for rule, _, said in told(rows)}
    assert found == {
        "TYP-305": "stall for 1.0 s to the end",
        "TYP-306": "after mode 4, faults: stall, for 1.0 s to the end",
        "PUSH-401": "system status 0xCC, fault, for 2.0 s to the end",
    }


def test_flickering_is_one_finding_that_says_how_often() -> None:
    rows = [row for k in range(60) for row in (status(k * 100, HOT), status(k * 100 + 50))]
    ((rule, count, said),) = told(rows)
    assert (rule, count) == ("TYP-305", 60)
    assert said.startswith("MOS over temperature 60 times in 5.9 s to the end: ")


def test_flags_that_come_and_go_together_are_one_finding_and_others_are_not() -> None:
    together = statuses(range(0, 500, 50), OVER_CURRENT | STALL) + statuses(range(500, 5000, 50))
    assert [one[2].partition(":")[0] for one in told(together)] == ["over current, stall for 0.45 s"]
    after = statuses(range(0, 500, 50), OVER_CURRENT | STALL) + statuses(range(500, 2000, 50), STALL)
    after += statuses(range(2000, 5000, 50))
    assert [one[2].partition(":")[0] for one in told(after)] == ["over current for 0.45 s", "stall for 1.9 s"]


def test_an_episode_ends_when_the_sender_is_silent() -> None:
    beside = statuses(range(0, 25_000, 500), node=12, esc_index=1)
    rows = statuses(range(0, 1000, 50), HOT) + statuses(range(12_000, 13_000, 50), HOT)
    said = [one[2].partition(":")[0] for one in told([*rows, *beside])]
    assert said == ["MOS over temperature for 0.95 s", "MOS over temperature for 0.95 s"]
    rows = statuses(range(0, 1000, 50), HOT) + statuses(range(10_000, 11_000, 50), HOT)
    assert [one[2].partition(":")[0] for one in told([*rows, *beside])] == ["MOS over temperature for 10.9 s"]


def test_a_number_that_is_none_is_never_the_worst() -> None:
    rows = [status(100, HOT, current=math.nan), status(200, HOT, current=7.0, temperature=math.nan), status(300)]
    ((_, _, said),) = told(rows)
    assert said.endswith("48.5 V, nan A, 40 degC, -5 rpm at onset; 48.5 V, 7.0 A, 40 degC, -5 rpm at worst")


def test_throttle_loss_before_the_first_command_stays_a_note_until_it_is_over() -> None:
    for make, rule in (
        (status, "TYP-305"),
        (lambda t, bits: motor(t, fault=bits), "PUSH-410"),
    ):
        rows = [make(t, LOSS) for t in range(0, 1000, 50)] + [make(t, 0) for t in range(1000, 1200, 50)]
        rows += [make(t, LOSS) for t in range(1200, 1400, 50)]
        commands: list[Row] = [(t, "RawCommand", {"cmd": [0]}, 10) for t in range(900, 1200, 10)]
        evidence = [status(t) for t in range(3, 1400, 50)] if rule == "PUSH-410" else []
        found = whole(text([*rows, *commands, *evidence]), (rule,), (41,))
        assert [(one.severity, one.count) for one in found] == [("note", 20), ("warning", 4)], rule


@pytest.mark.slow
@pytest.mark.parametrize("step", [1, 5, 50])
def test_it_is_the_same_however_the_capture_is_cut(step: int) -> None:
    rows = [row for k in range(20) for row in (status(k * 100, HOT | LOSS * (k % 3 > 0)), status(k * 100 + 50))]
    rows += [motor(t, fault=HOT | STALL, system_status=0xCC * (t > 500)) for t in range(0, 1000, 90)]
    rows += statuses(range(2000, 2500, 50), STALL, mode=ERROR) + statuses(range(14_000, 15_000, 50), STALL)
    assert len(whole(text([START, *rows]), RULES, (step,))) == 7


@pytest.mark.sampled(2)
@pytest.mark.parametrize("lines", [30, 1])
def test_live_tells_an_episode_while_it_lasts(lines: int) -> None:
    rows = statuses(range(0, 1000, 50)) + statuses(range(1000, 3050, 50), HOT)
    made = text([START, *rows]).splitlines(keepends=True)
    engine, check = Engine(registry()), Check(registry(), Settings(select=frozenset({"TYP-305"})))
    newest, said = Newest(check.judge, Settings(), now=lambda: 0.0), []
    for at in range(0, len(made), lines):
        for measured in check.measured([*engine.feed("".join(made[at : at + lines]).encode()), engine.flush()]):
            check.feed(measured)
        said += [(change.fresh, change.finding.text.partition(":")[0]) for change in newest.look(engine.buses)]
    assert [fresh for fresh, _ in said] == [True] + [False] * (len(said) - 1)
    assert said[-1][1] == "MOS over temperature for 2.0 s so far"


@pytest.mark.sampled(5)
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_every_report_tells_it(form: ReportFormat) -> None:
    report = analyzer.check(CAPTURES / "esc-failure.mcap", select=RULES, fail_on="device:warning")
    shown = " ".join(re.sub(r"&#x27;", "'", form.render(report, everything=True)).split())
    for words in (
        "MOS over temperature for 4.0 s to the end: 49.4 V", "MOS over temperature (0x0020) for 3.8 s to the end",
        "after mode 4, faults: MOS over temperature, for 3.8 s to the end", "0xCC, fault, for 3.6 s to the end: 49.4 V",
        "48.6 V, 0.1 A, 121 degC, 0 rpm at worst",
    ):  # fmt: skip
        assert words in shown
