"""Windows around findings, each row once and in its order, and comments that say what is missing."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.command import wait_until
from kit.live import MS, START, Lost, Note, Row, cut, made, plan, stored, taken, traffic
from kit.reports import change as changed
from kit.rows import Fault, Frame
from live.test_autostop import RULES

from analyzer.live.patterns import FindingPattern
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.pre_trigger import PreTriggerRecorder
from analyzer.live.recording.trigger import Trigger, TriggerPlan, parse_trigger
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from analyzer.report.model import Severity
    from analyzer.report.newest import Change

PLAN = TriggerPlan((FindingPattern("error"),), 10 * MS, 5 * MS)
TRF_010, PROTOCOL = FindingPattern(rule="TRF-010"), FindingPattern("note", "protocol")
ENDS = "the trigger's window ends, a gap follows"


@pytest.mark.parametrize(
    ("given_", "found"),
    [
        (([],), None),
        ((["error"],), TriggerPlan((FindingPattern("error"),), 10 * SECOND, 5 * SECOND)),
        ((["trf-010", "protocol:note"], "2min"), TriggerPlan((TRF_010, PROTOCOL), 120 * SECOND, 5 * SECOND)),
        ((["TRF"], None, "250ms"), TriggerPlan((FindingPattern(rule="TRF"),), 10 * SECOND, 250 * MS)),
    ],
)  # fmt: skip
def test_arguments(given_: tuple, found: TriggerPlan | None) -> None:
    assert parse_trigger(*given_, rules=RULES) == found


@pytest.mark.parametrize(
    ("given_", "why"),
    [
        ((["XYZ-1"],), "--trigger XYZ-1: no such rule (give error, warning, note, a rule or its first letters)"),
        (([], "3s"), "--pre is of no use without --trigger"),
        (([], None, "3s"), "--post is of no use without --trigger"),
        ((["error"], "0"), "--pre pre:0: no time at all"),
    ],
)
def test_arguments_that_are_none(given_: tuple, why: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        parse_trigger(*given_, rules=RULES)


def change(at: int, fresh: bool = True, severity: Severity = "error") -> Change:
    """A finding at the time of a frame of `traffic`."""
    return changed(severity=severity, fresh=fresh, t=START + at * MS, text="wrong CRC")


def numbers(rows: Sequence[Row]) -> list[int | str]:
    """The frames of `traffic` by their numbers, comments by their texts."""
    return [int.from_bytes(row.data, "big") if isinstance(row, Frame) else row.text for row in rows]  # type: ignore[union-attr]


def why(window: int, at: int) -> str:
    return f"trigger {window}: TRF-010 (error), {stamp(at)}: wrong CRC"


def stamp(at: int) -> str:
    return f"2026-03-14 08:02:10.{at:03}000 UTC"


def test_a_window_says_why_it_is_there() -> None:
    trigger = Trigger(PLAN)
    assert trigger.feed(made(traffic(100))) == []
    rows = taken(trigger.take_findings([change(50)]))
    assert numbers(rows) == ["40 frames before this are left out", why(1, 50), *range(40, 56), ENDS]
    assert [row.t for row in rows[:2]] == [START + 40 * MS] * 2
    assert rows[-1] == Note(START + 99 * MS, ENDS)


def test_a_window_goes_on_with_what_comes() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(51)))
    assert numbers(taken(trigger.take_findings([change(50)])))[2:] == [*range(40, 51)]
    assert numbers(taken(trigger.feed(made(traffic(3, first=51))))) == [51, 52, 53]
    assert numbers(taken(trigger.feed(made(traffic(3, first=54))))) == [54, 55, ENDS]
    assert trigger.feed(made(traffic(3, first=57))) == []
    assert trigger.finish() == []


def test_windows_that_overlap_are_one() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(51)))
    rows = taken(trigger.take_findings([change(50)]))
    rows += taken(trigger.feed(made(traffic(3, first=51))))
    rows += taken(trigger.take_findings([change(53), change(54, fresh=False)]))
    rows += taken(trigger.feed(made(traffic(20, first=54))))
    too = f"trigger, too: TRF-010 (error), {stamp(53)}: wrong CRC"
    assert numbers(rows)[2:] == [*range(40, 54), too, *range(54, 60), ENDS]
    assert trigger.windows == 1


def test_a_window_that_follows_begins_where_the_last_one_ended() -> None:
    """The rows in front of it that have gone out do not go out again."""
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    trigger.take_findings([change(50)])
    rows = taken(trigger.take_findings([change(58)]))
    assert numbers(rows) == ["0 frames before this are left out", why(2, 58), 56, 57, 58, 59]
    assert numbers(taken(trigger.feed(made(traffic(10, first=60))))) == [60, 61, 62, 63, ENDS]


def test_what_is_told_too_late_is_said() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    trigger.take_findings([change(50)])
    late = f"trigger, told late: TRF-010 (error), {stamp(45)}: wrong CRC"
    assert numbers(taken(trigger.take_findings([change(45), change(46, fresh=False)]))) == [late]
    assert trigger.windows == 1


def test_other_findings_open_nothing() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    assert trigger.take_findings([change(50, severity="warning")]) == []


def test_a_finding_without_a_time_is_one_of_now() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    rows = taken(trigger.take_findings([changed()]))
    assert numbers(rows)[2:] == [*range(49, 60)]


def test_somebody_may_press_a_key() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    assert numbers(taken(trigger.record_now("mark 1")))[1:] == [f"trigger 1: mark 1, {stamp(59)}", *range(49, 60)]


def test_a_silent_bus_ends_a_window() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(53)))
    trigger.take_findings([change(50)])
    assert trigger.tick(3 * MS) == []
    assert numbers(taken(trigger.tick(3 * MS + 1))) == [ENDS]
    assert trigger.tick(9 * MS) == []


def test_a_session_that_ends_ends_a_window() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(53)))
    trigger.take_findings([change(50)])
    assert numbers(taken(trigger.finish())) == [ENDS]


def test_times_that_jump_back_keep_their_order() -> None:
    rows = [*traffic(50), *traffic(5), *traffic(5, first=50), Frame(None, "can0", data=bytes([0] * 7 + [255]))]
    trigger = Trigger(PLAN)
    trigger.feed(made(rows))
    assert numbers(taken(trigger.take_findings([change(54)])))[2:] == [*range(44, 50), *range(5), *range(50, 55), 255]


def sent(rows: Sequence[Row]) -> list[int]:
    """The numbers of the frames."""
    return [number for number in numbers(rows) if isinstance(number, int)]


def test_a_clock_that_is_set_back_does_not_stop_it() -> None:
    """Be it inside a piece or between two, before a window or within."""
    before = traffic(20, first=20_000)
    for pieces in ([*before, *traffic(20)],), (before, traffic(20)):
        trigger = Trigger(PLAN)
        for rows in pieces:
            trigger.feed(made(rows))
        assert numbers(taken(trigger.take_findings([change(4)])))[2:-1] == [*range(20_013, 20_020), *range(10)]
    trigger = Trigger(PLAN)
    trigger.feed(made(before))
    assert numbers(taken(trigger.take_findings([change(20_018)])))[2:] == [*range(20_008, 20_020)]
    assert numbers(taken(trigger.feed(made(traffic(20))))) == [*range(5), ENDS]


@pytest.mark.sampled(14)
@pytest.mark.parametrize("skew", [0, 400 * MS, 2 * SECOND, -5 * SECOND, -START])
@pytest.mark.parametrize("bus", ["can0", "can1"])
@pytest.mark.parametrize("size", [100, 2000])
def test_interfaces_with_clocks_of_their_own(skew: int, bus: str, size: int) -> None:
    """Batch by batch, one interface behind the other: the window is there for both of them, wherever the finding is."""
    trigger = Trigger(TriggerPlan((FindingPattern("error"),), 4 * SECOND, 3 * SECOND))
    out: list[Row] = []
    for n in range(0, 20_000, size):
        other = [replace(row, bus="can1", t=START + i * MS + skew) for i, row in enumerate(traffic(size, first=n), n)]
        out += taken(trigger.feed(made([*traffic(size, first=n), *other], ["can0", "can1"])))
        if n == 10_000:
            t = START + n * MS + (skew if bus == "can1" else 0)
            out += taken(trigger.take_findings([changed(bus=bus, t=t)]))
    late = 400 if abs(skew) < SECOND else 2  # such clocks are taken for one
    for name in ("can0", "can1"):
        got = [int.from_bytes(row.data, "big") for row in out if isinstance(row, Frame) and row.bus == name]
        assert got == [*range(got[0], got[-1] + 1)]
        assert 10_000 - 4_000 - 2 * size - late <= got[0] <= 10_000 - 4_000 + late
        assert 10_000 + 3_000 - late <= got[-1] <= 10_000 + 3_000 + 2 * size + late
    assert trigger.windows == 1


def test_what_the_host_says_does_not_move_the_clock_of_a_controller() -> None:
    """Comments have the time of this machine."""
    trigger = Trigger(PLAN)
    rows: list[Row] = [replace(row, t=row.t - START) for row in traffic(100)]  # type: ignore[operator]
    rows[45:45] = [Note(START, "can0: link up after 0.1 s"), Fault(START + MS, "can0"), Lost(START + 2 * MS, "can0", 3)]
    trigger.feed(made(rows[:30]))
    trigger.feed(made(rows[30:]))
    out = taken(trigger.take_findings([changed(t=50 * MS)]))
    frames = [row for row in out if isinstance(row, Frame)]
    assert [row.t for row in frames] == [n * MS for n in range(40, 56)]
    assert len(out) - len(frames) == 3 + 3
    assert (out[0].t, out[-1].t) == (40 * MS, 99 * MS)


def test_a_clock_that_jumps_ahead_takes_the_others_with_it() -> None:
    trigger = Trigger(PLAN)
    ahead = 600 * SECOND
    for n in range(0, 60, 5):
        jumped = [replace(row, bus="can1", t=row.t + ahead * (n >= 30)) for row in traffic(5, first=n)]  # type: ignore[operator]
        trigger.feed(made([*traffic(5, first=n), *jumped], ["can0", "can1"]))
    out = taken(trigger.take_findings([change(57)]))
    assert [n for n in numbers(out) if isinstance(n, int)][:3] == [47, 48, 49]


def test_a_finding_of_before_does_not_shorten_a_window() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(51)))
    trigger.take_findings([change(50), change(48)])
    assert numbers(taken(trigger.feed(made(traffic(20, first=51))))) == [51, 52, 53, 54, 55, ENDS]


def test_rows_without_times_may_come_first() -> None:
    trigger = Trigger(PLAN)
    trigger.feed(made([replace(row, t=None) for row in traffic(3)]))
    trigger.feed(made(traffic(3, first=3)))
    assert trigger.take_findings([change(5)])[2:]
    trigger = Trigger(PLAN)
    trigger.feed(made([replace(traffic(1)[0], t=None), *traffic(4, first=1)]))
    assert numbers(taken(trigger.take_findings([change(4)])))[2:] == [0, 1, 2, 3, 4]


@given(
    cuts=st.lists(st.integers(0, 200), max_size=6),
    found=st.dictionaries(st.integers(0, 199), st.integers(0, 40), max_size=5),
    steps=st.lists(st.sampled_from([0, MS // 2, MS, 3 * MS, 30 * MS]), min_size=200, max_size=200),
)
def test_rows_go_out_once_in_order_and_only_around_findings(
    cuts: list[int], found: dict[int, int], steps: list[int]
) -> None:
    """Wherever pieces are cut, and however late findings are told."""
    t, rows = START, []
    for n, step in enumerate(steps):
        t += step
        rows.append(Frame(t, "can0", n, 0, n.to_bytes(8, "big")))
    pieces = cut(rows, cuts)
    trigger, fed = Trigger(PLAN), 0
    out: list[Row] = []
    told: set[int] = set()
    due = sorted((at + late, at) for at, late in found.items())
    for piece in pieces:
        out += taken(trigger.feed(piece))
        fed += piece.frames
        for when, at in list(due):
            if when < fed:
                due.remove((when, at))
                last = max(sent(out), default=-1)
                out += taken(trigger.take_findings([changed(t=rows[at].t)]))
                told |= {at}
                assert at in sent(out) or last > at
    out += taken(trigger.finish())
    got = sent(out)
    assert got == sorted(set(got))
    near = {
        n for n, row in enumerate(rows) if any(rows[at].t - PLAN.pre <= row.t <= rows[at].t + PLAN.post for at in told)
    }  # type: ignore[operator]
    assert set(got) <= near
    texts = [row.text for row in out if isinstance(row, Note)]
    assert sum(text.startswith("trigger ") for text in texts) == texts.count(ENDS) == trigger.windows
    left = sum(int(text.split()[0]) for text in texts if text.endswith("left out"))
    assert len([n for n in range(max(got, default=-1) + 1) if n not in got]) == left


def test_a_dashcam_records_windows(tmp_path: Path) -> None:
    now = [0]
    path = tmp_path / "a.pcapng"
    with FileRecorder(plan(path)) as recorder:
        pre_trigger = PreTriggerRecorder(recorder, Trigger(PLAN), lambda: now[0])
        pre_trigger.put(made(traffic(53)))
        pre_trigger.take_findings([change(50)])
        now[0] += 4 * MS
        assert pre_trigger.notes() == []
        pre_trigger.put(made(traffic(1, first=80)))
        pre_trigger.record_now("mark 7")
        pre_trigger.close()
    rows = stored(path)
    assert numbers(rows)[:13] == ["40 frames before this are left out", why(1, 50), *range(40, 51)]
    assert numbers(rows)[13:] == [51, 52, ENDS, "0 frames before this are left out",
                                  f"trigger 2: mark 7, {stamp(80)}", 80, ENDS]  # fmt: skip
    assert recorder.problem is None


def test_silence_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    now = [0]
    with FileRecorder(plan(path), flushed=0.0) as recorder:
        pre_trigger = PreTriggerRecorder(recorder, Trigger(PLAN), lambda: now[0])
        pre_trigger.put(made(traffic(51)))
        pre_trigger.take_findings([change(50)])
        now[0] += 5 * MS + 1
        pre_trigger.notes()
        wait_until(lambda: stored(path)[-1:] == [Note(START + 50 * MS, f"# {ENDS}")])
