"""Nodes on the board: rates, health, names, restarts, silences, and transfers that nothing closes."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.command import START
from kit.judged import registry
from kit.monitor import batches, board_of, capture, named, shown, status, text_of

from analyzer.board.board import Board
from analyzer.board.nodes import MOST_NODES
from analyzer.decode.engine import Engine

if TYPE_CHECKING:
    from analyzer.board.snapshot import NodeRow, Snapshot

MS, SECOND = 1_000_000, 1_000_000_000
SLICE = 250 * MS


def node(snapshot: Snapshot, number: int) -> NodeRow:
    return next(row for row in snapshot.nodes if row.node == number)


def test_rates_are_those_of_the_last_two_seconds() -> None:
    text = capture("hover-4.log")
    board, now = board_of(text)
    (batch,) = batches(text, 1 << 20)
    end = now // SLICE * SLICE
    transfers, frames = Counter[int](), Counter[int]()
    for row in batch.transfers.to_pylist():
        if end - 2 * SECOND <= row["t_end"].value < end:
            transfers[row["src"]] += 1
            frames[row["src"]] += len(row["frame"])
    assert len(transfers) == 6
    for row in board.snapshot(now).nodes:
        assert (row.transfers, row.frames) == (transfers[row.node] / 2, frames[row.node] / 2)


def test_a_rate_falls_to_nothing_when_the_bus_is_silent() -> None:
    board, now = board_of(capture("hover-4.log"))
    assert node(board.snapshot(now), 10).frames > 100
    assert node(board.snapshot(now + 3 * SECOND), 10).frames == 0


def test_a_rate_at_the_start_is_not_a_share_of_two_seconds() -> None:
    frames = [one for k in range(60) for one in status(7, 0, START + k * 20 * MS)]
    assert node(shown(text_of(frames)), 7).frames == pytest.approx(50, rel=0.15)


def test_health_mode_uptime_and_the_longest_pause() -> None:
    times = [START, START + 900 * MS, START + 2000 * MS, START + 3000 * MS]
    frames = [one for k, t in enumerate(times) for one in status(7, k + 5, t, health=2, mode=3)]
    row = node(shown(text_of(frames), after=10 * MS), 7)
    assert (row.health, row.mode, row.uptime, row.gap) == ("error", "software update", 8, 1100 * MS)
    assert row.age == 10 * MS


def test_an_unknown_mode_is_a_number() -> None:
    assert node(shown(text_of(status(7, 0, START, mode=5))), 7).mode == "5"


@pytest.mark.parametrize("step", [1, 100])
def test_an_uptime_that_goes_back_is_a_restart(step: int) -> None:
    uptimes = [10, 11, 12, 0, 1, 2, 1]
    frames = [one for k, up in enumerate(uptimes) for one in status(7, k, START + k * SECOND, uptime_sec=up)]
    board, now = board_of(text_of(frames), step)
    snapshot = board.snapshot(now)
    assert node(snapshot, 7).restarts == 2
    (one,) = (one for one in snapshot.latched if one.kind == "restart")
    assert (one.subject, one.count, one.first, one.last) == ("can0 node 7", 2, START + 3 * SECOND, START + 6 * SECOND)
    assert one.text == "began anew after 2 s"
    board.mark(now)
    assert node(board.snapshot(now), 7).restarts == 0


def test_names_come_from_answers_that_were_seen() -> None:
    snapshot = shown(capture("hover-4.log"))
    assert {row.name for row in snapshot.nodes} == {"", "com.tmotor.esc", "org.example.ground_station"}
    assert node(shown(text_of(named(9, b"one\xffname"))), 9).name == "one\\xffname"


def test_a_damaged_answer_gives_no_name() -> None:
    frames = named(9, b"wrong")
    broken = frames[3].data[:2] + bytes([frames[3].data[2] ^ 1]) + frames[3].data[3:]
    frames = [*status(9, 0, START - SECOND), *frames]
    frames[4] = encode.Frame(frames[4].id, broken, frames[4].t)
    assert [row.name for row in shown(text_of(frames)).nodes] == [""]


def test_silence_is_latched_while_it_lasts_and_when_it_is_over() -> None:
    before = [one for k in range(3) for one in status(7, k, START + k * SECOND)]
    board, now = board_of(text_of(before))
    lasting = board.snapshot(now + 4 * SECOND)
    (one,) = (one for one in lasting.latched if one.kind == "silence")
    assert (one.subject, one.first, one.last, one.now) == ("can0 node 7", now, now + 4 * SECOND, True)
    assert node(lasting, 7).stale
    after = [*before, *status(7, 3, START + 8 * SECOND)]
    (one,) = (one for one in shown(text_of(after)).latched if one.kind == "silence")
    assert (one.text, one.first, one.now) == ("no status for 6.0 s", START + 2 * SECOND, False)


def test_the_longest_pause_is_that_of_the_table() -> None:
    text = capture("bus-break.log")
    (batch,) = batches(text, 1 << 20)
    times: dict[int, list[int]] = {}
    for row in batch.messages["uavcan.protocol.NodeStatus"].to_pylist():
        times.setdefault(row["src"], []).append(row["t"].value)
    for row in shown(text).nodes:
        assert row.gap == max(after - before for before, after in pairwise(times[row.node]))


def test_a_transfer_that_nothing_closes_times_out_by_the_clock_and_only_then() -> None:
    frames = [*status(7, 0, START), *named(9, b"name", START + 10 * MS)[:3]]
    board, now = board_of(text_of(frames))
    assert [row.node for row in board.snapshot(now).nodes] == [7]  # nothing of node 9 has come to an end
    frames += status(9, 0, START + 20 * MS)
    board, now = board_of(text_of(frames))
    assert node(board.snapshot(now + 1900 * MS), 9).overdue == 0
    assert node(board.snapshot(now + 2100 * MS), 9).overdue == 1
    frames += status(7, 1, START + 5 * SECOND)  # a frame that closes it
    board, now = board_of(text_of(frames))
    assert node(board.snapshot(now + 3 * SECOND), 9).overdue == 0


@pytest.mark.parametrize("step", [1, 3, 100])
def test_a_transfer_that_is_complete_is_not_overdue(step: int) -> None:
    board, now = board_of(text_of([*named(9, b"a name of several frames")]), step)
    assert node(board.snapshot(now + 5 * SECOND), 9).overdue == 0


def test_nodes_are_bounded_and_the_rest_is_counted() -> None:
    pairs = [(bus, number) for bus in range(9) for number in range(1, 128)]
    frames = [
        one for k, (bus, number) in enumerate(pairs) for one in status(number, 0, START + k * 100_000, bus=f"can{bus}")
    ]
    snapshot = shown(text_of(frames))
    assert len(snapshot.nodes) == MOST_NODES
    assert snapshot.beyond == len(pairs) - MOST_NODES
    assert shown(text_of(frames), 11) == snapshot


def test_anonymous_frames_belong_to_no_node() -> None:
    snapshot = shown(capture("startup.log"))
    assert 0 not in {row.node for row in snapshot.nodes}
    assert len(snapshot.nodes) >= 5


def test_a_clock_that_is_set_back_does_not_stop_the_rates() -> None:
    early = [one for k in range(100) for one in status(7, k, START + k * 20 * MS)]
    late = [one for k in range(100) for one in status(7, k, START + 3600 * SECOND + k * 20 * MS)]
    engine, board = Engine(registry()), Board(registry(), {"can0": None})
    for text in (text_of(late), text_of(early)):
        list(engine.feed(text))
        batch = engine.flush()
        board.feed(batch, 1)
    assert node(board.snapshot(1), 7).frames == pytest.approx(50, rel=0.1)
