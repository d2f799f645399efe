"""Rows reach the recording whatever those do who judge and show; what they miss is counted."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import START, wait_until
from kit.rows import batch

from analyzer._native import Rows
from analyzer.live.autostop import Autostop, AutostopPlan
from analyzer.live.capture_loop import CaptureLoop, SessionControl

if TYPE_CHECKING:
    from analyzer._native import FrameBatch

SECOND = 10**9


def frames(first: int, count: int) -> FrameBatch:
    lines = (f"({START // SECOND}.{k:09d}) can0 1F040A0B#{k:08X}C0\n" for k in range(first, first + count))
    return batch("".join(lines))


class Hub:
    """Gives pieces one by one; `failing` raises."""

    def __init__(self, *pieces: FrameBatch, failing: bool = False) -> None:
        self.pieces, self.failing = list(pieces), failing
        self.more = threading.Semaphore(len(pieces))
        self.closed = self.ended = False
        self.comments: list[str] = []

    def take(self, seconds: float) -> FrameBatch | None:
        if self.failing:
            raise RuntimeError("no luck")
        if not self.more.acquire(timeout=seconds):
            return None
        return self.pieces.pop(0)

    def add_comment(self, text: str) -> None:
        self.comments.append(text)

    def notes(self) -> list[str]:
        return []

    def close(self) -> None:
        self.closed = True


class Recorder:
    def __init__(self) -> None:
        self.frames, self.pressed, self.closed = 0, list[str](), False

    def put(self, piece: FrameBatch) -> None:
        assert not self.closed
        self.frames += piece.frames

    def record_now(self, why: str) -> None:
        self.pressed.append(why)

    def take_findings(self, changes: Any) -> None:
        del changes

    def notes(self) -> list[str]:
        return []

    def close(self) -> None:
        self.closed = True


def loop(hub: Any, recorder: Recorder, plan: AutostopPlan | None = None, **more: Any) -> CaptureLoop:
    return CaptureLoop(hub, recorder, Autostop(plan or AutostopPlan()), SessionControl(), recorder.close, **more)


def test_recording_goes_on_while_nobody_takes_anything() -> None:
    recorder = Recorder()
    with loop(Hub(*(frames(100 * k, 100) for k in range(20))), recorder, most=500) as one:
        wait_until(lambda: one.unjudged == 1500)  # the last of these is recorded before it counts
        assert recorder.frames == 2000
        taken = one.take(0)
        assert sum(piece.frames for piece in taken) == 500
        assert one.unjudged == 1500
        assert sum(piece.lines["dropped_frames"] for piece in taken) == 1500
        assert one.notes() == ["judging is too slow: frames are recorded that are not judged"]
    assert recorder.closed


def test_losses_are_told_in_front_of_what_comes_after_them() -> None:
    recorder, hub = Recorder(), Hub(*(frames(100 * k, 100) for k in range(3)))
    with loop(hub, recorder, most=150) as one:
        wait_until(lambda: one.unjudged == 200)
        assert recorder.frames == 300
        first = one.take(0)
        assert [(piece.frames, piece.lines["drops"] > 0) for piece in first] == [(100, False), (0, True)]
        hub.pieces.append(frames(300, 100))
        hub.more.release()
        wait_until(lambda: one.behind > 0)
        assert recorder.frames == 400
        assert [(piece.frames, piece.lines["drops"]) for piece in one.take(0)] == [(100, 0)]
    assert one.unjudged == 200


def test_what_stops_it_finishes_the_recording_without_anybody_else() -> None:
    recorder, hub = Recorder(), Hub(frames(0, 10))
    one = loop(hub, recorder)
    with one:
        one.control.mark()
        wait_until(lambda: bool(hub.comments))
        one.control.stop()
        wait_until(lambda: one.ended)
        assert (hub.closed, recorder.closed, recorder.frames) == (True, True, 10)
    assert (hub.comments, recorder.pressed) == (["mark 1"], ["mark 1"])
    assert sum(piece.frames for piece in one.take(60)) == 10  # at once


def test_enough_is_enough() -> None:
    recorder = Recorder()
    with loop(Hub(frames(0, 60), frames(60, 60), frames(120, 60)), recorder, AutostopPlan(frames=100)) as one:
        wait_until(lambda: one.ended)
    assert (recorder.frames, one.frames) == (100, 100)
    assert one.notes() == ["enough: 100 frames"]


def test_a_failure_finishes_the_recording_and_is_told() -> None:
    recorder = Recorder()
    with loop(Hub(failing=True), recorder) as one:
        wait_until(lambda: one.ended)
    assert recorder.closed
    assert one.problem == "receiving has ended: RuntimeError: no luck: please report this as a bug"


@pytest.mark.parametrize("header", ["", "recorded with drops"])
def test_the_header_is_judged_too(header: str) -> None:
    one = loop(Hub(), Recorder(), header=header)
    assert [piece.lines["comments"] for piece in one.take(0)] == [1] * bool(header)


def test_what_no_recording_can_hold_is_counted() -> None:
    rows = Rows()
    rows.frame(START, "can0", 0x123, 0, b"")
    rows.unreadable("three bytes that are no frame")
    recorder = Recorder()
    with loop(Hub(rows.take()), recorder) as one:
        wait_until(lambda: recorder.frames == 1)
    assert one.left_out == {"what is no frame": 1}
