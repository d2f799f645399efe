"""Captures to be replayed, and a clock for what waits: time passes only in its sleeps."""

from __future__ import annotations

import os
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from analyzer.cli.replay import playing as replay_run
from analyzer.sinks import open_sink
from kit.rows import EXTENDED, Fault, Frame, piece

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pytest

SECOND = 1_000_000_000


class Clock:
    """Each sleep is a little too long, as real ones are."""

    def __init__(self, over: int = 0) -> None:
        self.now, self.over = 1_000_000_000_000, over
        self.slept: list[float] = []

    def __call__(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        self.now += round(seconds * SECOND) + self.over


MS = 1_000_000
START = 1_700_000_000 * SECOND
STATUS, RAW = 0x1F040A0B, 0x0A040601


def replays_wait_by(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(replay_run, "Pacer", partial(replay_run.Pacer, clock=clock, sleep=clock.sleep))
    return clock


def frames(*ids: int, step: int = MS, bus: str = "can0", flags: int = EXTENDED) -> list[Frame]:
    return [Frame(START + k * step, bus, number, flags, bytes([k & 0xFF, 0xC0])) for k, number in enumerate(ids)]


def log(path: str, found: Sequence[Frame | Fault]) -> str:
    with Path(path).open("wb") as file:
        sink = open_sink("candump", file)
        sink.write(piece(found))
        sink.close()
    return path


@contextmanager
def standard_input() -> Iterator[BinaryIO]:
    """Another end for it."""
    end, begin = os.pipe()
    before = os.dup(0)
    os.dup2(end, 0)
    os.close(end)
    try:
        with os.fdopen(begin, "wb", buffering=0) as pipe:
            yield pipe
    finally:
        os.dup2(before, 0)
        os.close(before)
