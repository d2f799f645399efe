"""Findings on the board: one row a kind, the newest first, tallies by node, latched since the mark."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import TYPE_CHECKING, get_args

import pytest
from kit.command import START
from kit.judged import judge, registry
from kit.monitor import board_of, capture, status, text_of, trouble

from analyzer.board.board import Board
from analyzer.board.findings import MOST_FINDINGS
from analyzer.board.snapshot import RecordingState, Tally
from dissectors.kit import Severity

if TYPE_CHECKING:
    from analyzer.report.newest import Change

SECOND = 1_000_000_000


def board_with(*news: Change) -> tuple[Board, int]:
    board, now = board_of(text_of(status(22, 0, START)))
    for one in news:
        board.take_findings([one], now)
    return board, now


def test_what_comes_again_is_one_row_with_its_first_and_last_time() -> None:
    board, now = board_with(
        trouble("TRF-010", t=START),
        trouble("TRF-003", t=START + 1),
        trouble("TRF-010", t=START + 2, count=3, text="newer"),
    )
    first, second = board.snapshot(now).findings
    assert (first.rule, first.first, first.last, first.count, first.text) == (
        "TRF-010",
        START,
        START + 2,
        4,
        "something: newer",
    )
    assert (second.rule, second.bus, second.node) == ("TRF-003", "can0", 22)


def test_what_goes_on_is_counted_once() -> None:
    board, now = board_with(trouble("TRF-010", count=2), trouble("TRF-010", count=5, fresh=False))
    snapshot = board.snapshot(now)
    assert [row.count for row in snapshot.findings] == [7]
    assert (snapshot.found, snapshot.nodes[0].found) == (Tally(1, 0, 0), Tally(1, 0, 0))


def test_severities_are_counted_in_all_and_by_node() -> None:
    kinds = get_args(Severity)
    news = [trouble(f"TRF-{k:03}", kind, node=22 if k else None) for k, kind in enumerate((*kinds, *kinds[:1]))]
    board, now = board_with(*news)
    snapshot = board.snapshot(now)
    assert snapshot.found == Tally(2, 1, 1)
    assert snapshot.nodes[0].found == Tally(1, 1, 1)
    board.mark(now)
    assert board.snapshot(now).nodes[0].found == Tally()
    assert board.snapshot(now).found == Tally(2, 1, 1)


def test_the_device_of_a_node_shows_the_findings_of_the_node() -> None:
    board, now = board_of(capture("hover-4.log"))
    board.take_findings([trouble("TRF-010", node=13)], now)
    (table, *_) = board.snapshot(now).devices
    assert {row.label: row.found.errors for row in table.rows} == {"1": 0, "2": 0, "3": 1, "4": 0}


def test_findings_are_latched_until_the_mark() -> None:
    board, now = board_with(trouble("TRF-010", t=START), trouble("TRF-010", t=START + 5))
    (one,) = board.snapshot(now).latched
    assert (one.kind, one.subject, one.count, one.first, one.last) == ("finding", "can0 node 22", 2, START, START + 5)
    board.mark(now)
    assert board.snapshot(now).latched == ()
    assert len(board.snapshot(now).findings) == 1


def test_cleared_findings_are_gone_and_stay_counted() -> None:
    board, now = board_with(trouble("TRF-010"))
    board.clear(now)
    snapshot = board.snapshot(now)
    assert (snapshot.findings, snapshot.latched, snapshot.found.errors) == ((), (), 1)


def test_findings_are_bounded_and_the_newest_are_kept() -> None:
    board, now = board_with(*(trouble("TRF-010", type=f"type {k}") for k in range(MOST_FINDINGS + 10)))
    rows = board.snapshot(now).findings
    assert len(rows) == MOST_FINDINGS
    assert rows[0].type == f"type {MOST_FINDINGS + 9}"
    assert board.snapshot(now).found.errors == MOST_FINDINGS + 10


def test_the_findings_of_a_capture_go_to_the_nodes_that_the_rules_name() -> None:
    text = capture("mission-8-faults.log")
    said = [one for one in judge(text) if one.severity == "error"]
    board, now = board_of(text)
    nodes = [(one, None if one.node < 0 else one.node) for one in said]
    board.take_findings((trouble(one.rule, bus=f"can{one.bus}", node=node, type=one.type) for one, node in nodes), now)
    for row in board.snapshot(now).nodes:
        assert row.found.errors == sum(one.node == row.node for one in said)


def test_the_recording_is_shown_as_it_was_told() -> None:
    board = Board(registry(), {"can0": None})
    assert board.snapshot(START).recording is None
    board.take_recording(RecordingState("a.log", 10, 2, 1, "disk full"))
    assert board.snapshot(START).recording == RecordingState("a.log", 10, 2, 1, "disk full")


def test_a_snapshot_is_frozen_and_later_batches_do_not_change_it() -> None:
    board, now = board_of(capture("hover-4.log"))
    before = board.snapshot(now)
    kept = repr(before)
    board.mark(now)
    board.take_findings([trouble("TRF-010", node=13)], now)
    board.note("can0: link down", now)
    assert repr(before) == kept
    with pytest.raises(FrozenInstanceError):
        before.nodes[0].name = "x"  # type: ignore[misc]


def test_an_empty_board_has_a_snapshot() -> None:
    snapshot = Board(registry(), {}).snapshot(START)
    assert (snapshot.buses, snapshot.nodes, snapshot.devices, snapshot.latched) == ((), (), (), ())
    assert snapshot.now == snapshot.since == START
