"""Findings that are told late: a window holds their frames as long as there is room for them, and says what is gone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.live import MS, START, Note, made, taken, traffic
from kit.reports import change as changed
from live.test_trigger import ENDS, PLAN, change, numbers, sent, why

from analyzer.live.recording import trigger as module
from analyzer.live.recording.trigger import Trigger

if TYPE_CHECKING:
    from analyzer.report.newest import Change


def test_a_finding_may_come_late() -> None:
    """An hour later its frames are still there, if there is room."""
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(60)))
    trigger.feed(made(traffic(3, first=3_600_000)))
    rows = numbers(taken(trigger.take_findings([change(50)])))
    assert rows == ["40 frames before this are left out", why(1, 50), *range(40, 56), ENDS]


def test_findings_that_come_together_open_their_windows_by_time() -> None:
    """They come by severity; none of them must drop the rows of another one."""
    trigger = Trigger(PLAN)
    trigger.feed(made(traffic(200)))
    rows = sent(taken(trigger.take_findings([change(150), change(50), change(100)])))
    assert rows == [*range(40, 56), *range(90, 106), *range(140, 156)]


@pytest.mark.parametrize(
    ("limits", "held"), [({"most": 5}, 5), ({"most_bytes": 4 * ((72 + 1024) + 8)}, 4)], ids=["rows", "bytes"]
)
def test_memory_is_bounded(limits: dict[str, int], held: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """What could not be held is said, in the recording and to people."""
    monkeypatch.setattr(module, "_PIECE", 3 * 1024)
    trigger = Trigger(PLAN, **limits)
    for n in range(0, 60, 3):
        trigger.feed(made(traffic(3, first=n)))
    rows = numbers(taken(trigger.take_findings([change(59)])))
    lost = f"trigger 1, its first 0.00{10 - held} s are no longer held"
    assert rows[0] == f"{60 - held} frames before this are left out"
    assert str(rows[1]).startswith(f"{lost}: TRF-010")
    assert rows[2:] == [*range(60 - held, 60)]
    assert trigger.notes() == [lost]
    assert trigger.notes() == []


def test_frames_that_are_forgotten_are_said_to_be() -> None:
    trigger = Trigger(PLAN, most=5)
    for n in range(0, 60, 3):
        trigger.feed(made(traffic(3, first=n)))
    (row,) = taken(trigger.take_findings([change(20)]))
    assert isinstance(row, Note)
    assert row.text.startswith("trigger, told late, its frames are no longer held: TRF-010")


@pytest.mark.parametrize(
    ("found", "first"),
    [
        (replace(change(50), since=START + 30 * MS), 20),
        (changed(t=START + 50 * MS, frames=(36, 51), text="wrong CRC"), 25),
        (changed(t=START + 50 * MS, frames=(36, 51), fresh=False, text="wrong CRC"), 40),
    ],
    ids=["several occurrences", "a long transfer", "known already"],
)
def test_a_window_holds_the_frames_of_its_finding(found: Change, first: int) -> None:
    """All of them, not only the last one."""
    trigger = Trigger(PLAN)
    for n in range(0, 60, 7):
        trigger.feed(made(traffic(7, first=n)))
    rows = sent(taken(trigger.take_findings([found])))
    assert rows == [*range(first, 56)]
