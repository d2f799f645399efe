"""What of a capture is to be played is looked through once, and there for every round."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest
from kit.rows import Fault, Frame, Rows, piece

from analyzer.app import reel as replay_reel
from analyzer.app.reel import Reel
from analyzer.live.interfaces.filters import parse_filters

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch

SECOND = 10**9


@dataclass
class Capture:
    """Stands in for a run: pieces of ten frames, 1 s apart, on two buses; every piece has an error frame."""

    readings: list[bool] = field(default_factory=list)
    stopped: bool = False

    def frame_batches_inside(self, *, again: bool) -> Iterator[FrameBatch]:
        self.readings.append(again)
        made = Rows()
        for part in range(3):
            numbers = range(10 * part, 10 * part + 10)
            yield piece([*(Frame(k * SECOND, f"can{k % 2}", k) for k in numbers), Fault(error=1 << part)], made)


def looked(capture: Capture, *, far: bool, filters: str = "", longest: int | None = None) -> tuple[Reel, int]:
    reel, seen = Reel(capture, parse_filters([filters]), longest), []  # type: ignore[arg-type]
    for _ in reel.look(lambda part: seen.append(len(part.frames)), far=far):
        pass
    return reel, sum(seen)


def ids(reel: Reel, rounds: int) -> list[list[int]]:
    return [
        [number for part in parts for number in part.frames.column("id").to_pylist()] for parts in reel.rounds(rounds)
    ]  # fmt: skip


def test_what_is_kept_is_read_once() -> None:
    reel, seen = looked(capture := Capture(), far=False)
    assert (seen, reel.frames, reel.whole, reel.buses) == (30, 30, True, ["can0", "can1"])
    assert (reel.length, reel.silence) == (29 * SECOND, SECOND)
    assert ids(reel, 3) == [[*range(30)]] * 3
    assert capture.readings == [False]


@pytest.mark.parametrize(("most", "seen"), [(10, 20), (15, 20), (20, 30), (29, 30)])
def test_what_is_too_long_is_read_as_it_is_played(monkeypatch: pytest.MonkeyPatch, most: int, seen: int) -> None:
    monkeypatch.setattr(replay_reel, "MOST_HELD", most)
    reel, got = looked(capture := Capture(), far=False)
    assert (got, reel.whole) == (seen, False)
    assert ids(reel, 3) == [[*range(30)]] * 3
    assert capture.readings == [False, True, True]


def test_and_before_that_if_all_of_it_has_to_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_reel, "MOST_HELD", 15)
    reel, seen = looked(capture := Capture(), far=True)
    assert (seen, reel.whole, reel.length) == (30, True, 29 * SECOND)
    assert ids(reel, 2) == [[*range(30)]] * 2
    assert capture.readings == [False, True, True]


def test_what_is_not_looked_at_is_played_at_once() -> None:
    capture = Capture()
    assert ids(Reel(capture, parse_filters([])), 1) == [[*range(30)]]  # type: ignore[arg-type]
    assert capture.readings == [False]


def test_filters_and_silences() -> None:
    reel, seen = looked(Capture(), far=False, filters="009:01F,018:01F,#3", longest=SECOND * 3)
    assert (seen, ids(reel, 1)) == (2, [[9, 24]])
    assert (reel.length, reel.silence, reel.buses) == (3 * SECOND, 3 * SECOND, ["can1", "can0"])
    assert [part.error_frames for part in next(reel.rounds(1))] == [1, 1, 0]


def test_nothing_is_played_after_the_end() -> None:
    capture = Capture()
    reel, _ = looked(capture, far=False)
    rounds = reel.rounds(None)
    next(rounds)
    capture.stopped = True
    assert next(rounds, None) is None
