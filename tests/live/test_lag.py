"""A session that is slower than its bus says so, and who is not heard any more looks dead all the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from kit.command import wait_until
from kit.judged import registry
from kit.live import START, Frame, made
from kit.monitor import batches, capture
from kit.rows import EXTENDED
from live.test_capture_loop import Hub, Recorder, frames, loop

from analyzer.app.live.lag import BEHIND, Lag
from analyzer.app.live.list import TransferList
from analyzer.board.board import Board
from analyzer.decode.engine import Engine
from analyzer.live import capture_loop
from analyzer.live.heard import HeardSenders
from analyzer.rules.checking import Measured
from analyzer.terminal.bar import top
from analyzer.views.options import WriterOptions

if TYPE_CHECKING:
    import pytest

    from analyzer.board.snapshot import Snapshot

SECOND = 10**9


def test_what_waits_is_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is taken piece by piece, so that there is something to show in between."""
    monkeypatch.setattr(capture_loop, "PIECE", 250)
    now = [0]
    recorder, hub = Recorder(), Hub(*(frames(100 * k, 100) for k in range(5)))
    with loop(hub, recorder, clock=lambda: now[0]) as one:
        assert one.behind == 0.0
        wait_until(lambda: one._rows == 500)
        now[0] += 4 * SECOND
        assert one.behind == 4.0
        assert sum(piece.frames for piece in one.take(60)) == 300  # at once
        assert one.behind == 4.0
        assert sum(piece.frames for piece in one.take(0)) == 200
        assert one.behind == 0.0


def test_how_far_it_is_behind_is_told() -> None:
    """Not each time that somebody looks: when it begins, when it has doubled, when it is over."""
    lines: list[str] = []
    lag = Lag(lines.append)
    for behind in (0.1, BEHIND - 0.1, 4.2, 4.3, 8.3, 8.4, 1.0, 0.6, 0.4, 0.1, 3.0):
        lag.look(SimpleNamespace(loop=SimpleNamespace(behind=behind)))  # type: ignore[arg-type]
    why = "frames come faster than they are judged"
    assert lines == [
        f"behind by 4.2 s: {why}",
        f"behind by 8.4 s: {why}",
        "no longer behind",
        f"behind by 3.0 s: {why}",
    ]


def test_a_list_that_is_read_slowly_says_so() -> None:
    """Its reader gets old lines, though judging keeps up."""
    engine = Engine(registry())
    (batch, *_) = [*engine.feed(capture("hover-4.log")), engine.flush()]
    printer = SimpleNamespace(put=lambda _: None, behind=4.2)
    told: list[str] = []
    shown = TransferList(WriterOptions(), registry(), printer, several=False, say=told.append)  # type: ignore[arg-type]
    shown.batch(Measured(batch, np.empty(0)))
    printer.behind = 0.0
    shown.batch(Measured(batch, np.empty(0)))
    assert told == [
        "-- the list is behind by 4.2 s: whoever reads it is slow\n", "-- the list is no longer behind\n",
    ]  # fmt: skip


def test_senders_are_heard_as_their_frames_come() -> None:
    now = [0]
    heard = HeardSenders(lambda: now[0])
    heard.feed(made([Frame(START, "can0", 0x1501550A, EXTENDED), Frame(START, "can1", 0x0B, EXTENDED)]))
    now[0] += 3
    heard.feed(made([Frame(START, "can1", 0x0B, EXTENDED), Frame(START, "can1", 0x0C)], ["can0", "can1"]))
    heard.feed(made([], ["can0"]))
    now[0] += 1
    assert heard.ages() == {("can0", 10): 4, ("can1", 11): 1}


def test_an_esc_that_no_longer_sends_looks_dead_under_load() -> None:
    """Its last frames are judged only now, but it is known that it has sent none since."""
    board = Board(registry(), {"can0": None})
    now = 0
    for batch in batches(capture("hover-4.log")):
        now = batch.frames.column("t")[-1].value
        board.feed(batch, now)

    def escs(snapshot: Snapshot) -> dict[str, Any]:
        (table,) = (one for one in snapshot.devices if one.kind == "esc")
        return {row.label: row for row in table.rows}

    def nodes(snapshot: Snapshot) -> dict[int, Any]:
        return {row.node: row for row in snapshot.nodes}

    before = board.snapshot(now)
    node = escs(before)["1"].node
    ages = {("can0", number): 20_000_000 for number in nodes(before)} | {("can0", node): 25 * SECOND}
    board.take_lag(30 * SECOND, ages)
    after = board.snapshot(now)
    assert [(row.label, row.stale) for row in escs(before).values()] == [(str(k), False) for k in range(1, 5)]
    dead = [row.label for row in escs(after).values() if row.stale]
    assert dead == [row.label for row in escs(before).values() if row.node == node]
    assert "1" in dead
    assert escs(after)["1"].age == nodes(after)[node].age == 25 * SECOND
    assert nodes(after)[node].stale
    assert " BEHIND 30s" in "".join(text for text, _ in top(after, None, 80))
    assert "BEHIND" not in "".join(text for text, _ in top(before, None, 80))
    board.take_lag(0, {})
    assert not escs(board.snapshot(now))["1"].stale
