"""Transfers of sessions that a filter cannot select make no rows; what it selects and every sum stay what they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from kit import CAPTURES

import dissectors
from analyzer.app.filtered.frames import MatchingFrames
from analyzer.app.filtered.run_filter import RunFilter
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.filter import compile_filter

if TYPE_CHECKING:
    from analyzer.decode.core import Totals

NAMES = (
    "faults.log", "mission-8-faults.log", "services.log", "startup.log", "bus-break.log", "fd.log",
    "duplicate-node.log", "hobbywing.log",
)  # fmt: skip
FILTERS = (
    "ESCStatus && node == 12", "!ESCStatus && node == 12", "node == 99", "src == 12 || dst == 12", "!(src == 1)",
    "dst", "!dst", 'dronecan.kind == "request"', 'dronecan.type == "NodeStatus" && src != 12', "GetNodeInfo",
    "ESCStatus || can.len < 8", 'dronecan.status != "ok"', '!(dronecan.status == "ok") && ESCStatus',
    "dronecan.src in {12, 14} && not RawCommand", "dronecan.type_id == 1030", "ESCStatus && dst", "count(node) == 2",
    "frame.number < 100 && node == 12", "can.id & 0x80", 'dronecan.type matches "^esc" && src > 12', "ParamGet",
)  # fmt: skip


class Found(NamedTuple):
    """What a filter selects in a capture, what is said of it, and every sum."""

    frames: list[int]
    events: list[int]
    matching: int
    transfers: int
    totals: Totals
    complaints: list[str]


def read(name: str, text: str, *, narrow: bool) -> tuple[Found, int]:
    """Return what is found, and how many transfers made rows."""
    complaints: list[str] = []
    run = Run(Request((str(CAPTURES / name),), filter=text), complaints.append)
    chosen, found, rows, frames, events = RunFilter(run), MatchingFrames(), 0, 0, []
    if narrow:
        chosen.only(run)
    else:
        run.unpack_only(chosen.filter.tables)
    for batch in chosen.over(run.batches()):
        found.feed(batch)
        rows, frames = rows + len(batch.transfers), frames + len(batch.frames)
        assert batch.selected is not None
        events += np.asarray(batch.events.column("line"))[batch.selected.events].tolist()
    found.finish()
    chosen.conclude()
    selected = np.flatnonzero(found.holds(np.arange(frames))).tolist()
    return Found(selected, events, chosen.transfers, run.transfers, run.totals, complaints), rows


@pytest.mark.parametrize("name", NAMES)
def test_what_is_selected_does_not_depend_on_rows_that_are_not_made(name: str) -> None:
    for text in FILTERS:
        (whole, every), (narrow, some) = read(name, text, narrow=False), read(name, text, narrow=True)
        assert narrow == whole, text
        assert some <= every, text


def test_rows_of_sessions_that_cannot_match_are_the_first_ones_alone() -> None:
    found, rows = read("hover-4.log", "ESCStatus && node == 12", narrow=True)
    assert found.matching > 0
    assert rows < found.matching + 40 < found.transfers / 10


def test_a_type_that_others_send_is_seen() -> None:
    for narrow in (True, False):
        found, _ = read("hover-4.log", "ESCStatus && node == 99", narrow=narrow)
        assert (found.matching, found.complaints) == (0, [])


@pytest.mark.parametrize("text", ["ESCStatus.voltage < 44 V && node == 12", "ch == 1", "frame.time_delta > 1 ms"])
def test_filters_that_look_at_more_than_what_they_select_see_all_sessions(text: str) -> None:
    assert compile_filter(text, dissectors.load()).sessions({}) is None
