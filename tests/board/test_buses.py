"""Interfaces on the board: load to the bit, losses, what error frames say, notes."""

from __future__ import annotations

from collections import Counter

import pytest
from kit import encode
from kit.command import START
from kit.judged import registry
from kit.monitor import batches, board_of, capture, shown, status, text_of, trouble

from analyzer.board.board import Board
from analyzer.rules.load import bit_times
from dissectors.kit import FrameTable

MS, SECOND = 1_000_000, 1_000_000_000
ERROR = 0x20000000


def error_frame(t: int, error_class: int, data: str) -> str:
    return f"({encode.seconds(t, 9, 10)}) can0 {ERROR | error_class:08X}#{data}\n"


def bus_of(text: str | bytes, step: int = 800):
    (row,) = shown(text.encode() if isinstance(text, str) else text, step).buses
    return row


def test_the_load_is_that_of_the_bits_of_two_seconds() -> None:
    text = capture("hover-4.log")
    (batch,) = batches(text, 1 << 20)
    frames = FrameTable(batch.frames)
    end = int(frames.t[-1]) // (250 * MS) * (250 * MS)
    inside = (frames.t >= end - 2 * SECOND) & (frames.t < end)
    bits = int(bit_times(frames)[inside].sum())
    row = bus_of(text)
    assert row.load == pytest.approx(100 * bits / 2 / 1e6)
    assert row.frames == inside.sum() / 2
    assert (row.received, row.silent) == (len(frames), False)


def test_the_bit_rate_that_is_known_counts_and_an_assumed_one_is_called_so() -> None:
    board, slow = Board(registry(), {"can0": None}), Board(registry(), {"can0": 500_000})
    for batch in batches(capture("hover-4.log")):
        now = batch.frames.column("t")[-1].value
        board.feed(batch, now)
        slow.feed(batch, now)
    (one,), (other,) = board.snapshot(now).buses, slow.snapshot(now).buses
    assert (one.bit_rate, one.assumed, other.bit_rate, other.assumed) == (1_000_000, True, 500_000, False)
    assert other.load == pytest.approx(2 * one.load)


def test_an_interface_is_there_before_its_first_frame_and_when_it_is_silent() -> None:
    board = Board(registry(), {"can0": None, "can1": 250_000})
    assert [(row.name, row.silent) for row in board.snapshot(START).buses] == [("can0", True), ("can1", True)]
    board, now = board_of(capture("hover-4.log"))
    assert [row.silent for row in board.snapshot(now + 3 * SECOND).buses] == [True]


def test_several_interfaces_have_a_row_each() -> None:
    frames = [one for k in range(10) for one in status(7, k, START + k * MS, bus=f"can{k % 2}")]
    board, now = board_of(text_of(frames))
    assert [(row.name, row.received) for row in board.snapshot(now).buses] == [("can0", 5), ("can1", 5)]
    assert [(row.bus, row.node) for row in board.snapshot(now).nodes] == [("can0", 7), ("can1", 7)]


def test_counts_of_the_receiver_stand_in_place_of_what_was_seen() -> None:
    board, now = board_of(capture("hover-4.log"))
    board.take_counts("can0", 10_000, 17, 3)
    (batch,) = batches(text_of(status(7, 0, now)))
    board.feed(batch, now)
    (row,) = board.snapshot(now).buses
    assert (row.received, row.dropped, row.here) == (10_000, 17, 3)


@pytest.mark.parametrize("step", [1, 800])
def test_the_controller_follows_its_error_frames(step: int) -> None:
    """Class bits and data bytes as in linux/can/error.h; bytes 6 and 7 are the counters."""
    told = [
        (0x204, "0008000000006200", "error-warning", 0x62),
        (0x204, "0020000000008100", "error-passive", 0x81),
        (0x040, "0000000000000000", "bus-off", 0x81),
        (0x280, "000000000000FF10", "bus-off", 0xFF),
        (0x100, "0000000000000000", "error-active", None),
        (0x280, "0000000000000A00", "error-active", 0x0A),
        (0x280, "0000000000008200", "error-passive", 0x82),
        (0x204, "0040000000000700", "error-active", 0x07),
    ]
    text = ""
    for k, (error_class, data, state, tx) in enumerate(told):
        text += error_frame(START + k * MS, error_class, data)
        row = bus_of(text, step)
        assert (row.controller, row.tx_errors) == (state, tx), k
        assert row.error_frames == k + 1


def test_kinds_of_error_frames_are_latched() -> None:
    snapshot = shown(capture("bus-break.log"))
    sums = {one.text: one.count for one in snapshot.latched if one.kind == "error"}
    assert sum(sums.values()) == snapshot.buses[0].error_frames == 26
    assert {"stuffing error", "bit error", "form error", "restarted"} <= set(sums)


def test_losses_in_the_data_are_latched_and_counted() -> None:
    lines = [encode.log_line(one, 9) for one in status(7, 0, START)]
    text = "\n".join([*lines, encode.drop_line("can0", 12, 12), encode.drop_line("can0", 5, 17), ""])
    snapshot = shown(text.encode())
    assert snapshot.buses[0].dropped == 17
    assert [(one.text, one.count) for one in snapshot.latched if one.kind == "drop"] == [("frames lost", 17)]


def test_an_overflow_of_the_receiver_is_a_loss_and_no_error_of_the_bus() -> None:
    snapshot = shown(error_frame(START, 0x004, "0001000000000000").encode())
    assert snapshot.buses[0].error_frames == 0
    assert [one.kind for one in snapshot.latched] == ["drop"]


def test_a_note_belongs_to_its_interface_and_is_latched_by_its_text() -> None:
    board, now = board_of(capture("hover-4.log"))
    for k, text in enumerate(("can0: link down", "can0: link up", "can0: link down", "receive buffer 4 MiB")):
        board.note(text, now + k)
    snapshot = board.snapshot(now + 10)
    assert snapshot.buses[0].note == "link down"
    assert snapshot.notes[0][1] == "receive buffer 4 MiB"
    found = {(one.subject, one.text): one.count for one in snapshot.latched if one.kind == "note"}
    assert found == {("can0", "link down"): 2, ("can0", "link up"): 1, ("", "receive buffer 4 MiB"): 1}


def test_notes_are_bounded() -> None:
    board = Board(registry(), {"can0": None})
    for k in range(2000):
        board.note(f"note {'x' * k}", START + k)
    board.take_findings([trouble("TRF-010", t=START)], START)
    snapshot = board.snapshot(START)
    assert snapshot.notes[0][1] == f"note {'x' * 1999}"
    assert len(snapshot.notes) < 100
    kinds = Counter(one.kind for one in snapshot.latched)
    assert kinds == {"note": 32, "finding": 1}
    assert snapshot.beyond == 2000 - 32
    board.mark(START)
    board.note("can0: link down", START)
    assert len(board.snapshot(START).latched) == 1


def test_notes_that_differ_in_numbers_alone_are_one() -> None:
    board = Board(registry(), {"can0": None, "can1": None})
    for k in range(600):
        board.note(f"can{k % 2}: link up after {k / 10:.1f} s", START + k)
        board.note(f"running for {k} s; since the last line: {k:,} frames", START + k)
    snapshot = board.snapshot(START)
    found = {(one.subject, one.text, one.count, one.first) for one in snapshot.latched}
    assert found == {
        ("can0", "link up after 59.8 s", 300, START),
        ("can1", "link up after 59.9 s", 300, START + 1),
    }
    assert snapshot.notes[0][1].startswith("running for 599 s")
