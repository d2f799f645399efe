"""Times of a capture become times of a replay, and frames go where they are to go."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import pytest
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, Frame, piece
from kit.waiting import SECOND, Clock

from analyzer.live.interfaces.naming import Interface
from analyzer.live.replay.outlet import Outlet
from analyzer.live.replay.player import Player, ReplayBatch, ReplayFrame, RouteError, Routes, Timeline
from analyzer.live.replay.sender import Pacer
from analyzer.window.cut import frame_tables

if TYPE_CHECKING:
    from collections.abc import Iterable

MS = 1_000_000
START = 1_700_000_000 * SECOND


def times(given: Iterable[int | None], speed: str = "1", longest: int | None = None) -> tuple[list[int], Timeline]:
    line = Timeline(Fraction(speed), longest)
    return [line.at(None if t is None else START + t) for t in given], line


def test_times_count_from_the_first() -> None:
    got, line = times([5, 7, 7, 100])
    assert got == [0, 2, 2, 95]
    assert (line.backwards, line.timeless) == (0, 0)


@pytest.mark.parametrize(
    ("speed", "last"), [("1", 3 * 10**12), ("0.3", 10**13), ("7", 3 * 10**12 // 7), ("1000000", 3 * 10**6)]
)
def test_no_speed_drifts(speed: str, last: int) -> None:
    """Fifty minutes in steps of a second."""
    got, line = times(range(0, 3 * 10**12 + 1, 10**9), speed)
    assert got[-1] == last
    assert 0 <= 3 * 10**12 - line.recorded(got[-1]) <= Fraction(speed)


def test_long_silences_are_shortened() -> None:
    """In times of the capture, before the speed counts."""
    assert times([0, 10, 5 * SECOND, 5 * SECOND + 20, 90 * SECOND], "2", SECOND)[0] == [
        0, 5, 5 + SECOND // 2, 15 + SECOND // 2, 15 + SECOND,
    ]  # fmt: skip


def test_a_frame_out_of_order_moves_nothing() -> None:
    got, line = times([0, 10 * MS, 8 * MS, 12 * MS])
    assert got == [0, 10 * MS, 10 * MS, 12 * MS]
    assert line.backwards == 1


def test_a_clock_that_was_set_back_goes_on() -> None:
    got, line = times([0, SECOND, SECOND - 11 * MS, SECOND - 10 * MS])
    assert got == [0, SECOND, SECOND, SECOND + MS]
    assert line.backwards == 1


def test_frames_without_times_follow_at_once() -> None:
    got, line = times([None, None, 7, None, 9])
    assert got == [0, 0, 0, 0, 2]
    assert line.timeless == 3


def test_the_next_round_follows_at_once() -> None:
    _, line = times([0, 10])
    line.restart()
    assert [line.at(START), line.at(START + 5)] == [10, 15]


def test_maps_say_where_a_bus_goes() -> None:
    routes = Routes({"can0": [0, 2], "can1": [1]})
    assert [routes.of(name) for name in ("can0", "can1", "can2")] == [[0, 2], [1], ()]
    routes.check(["can2", "can1", "can0"])
    with pytest.raises(RouteError, match=r"^no frames of can1 \(there is can0, can9\)$"):
        routes.check(["can9", "can0"])


def test_without_maps_there_is_one_bus() -> None:
    routes = Routes({None: [0]})
    assert [routes.of("x"), routes.of("x")] == [[0], [0]]
    with pytest.raises(RouteError, match=r"^several buses \(x, y, ...\): name what goes where, as in vcan0=x$"):
        routes.of("y")


class Recording(Outlet):
    """Takes what it is given, and when."""

    def __init__(self, clock: Clock, fd: bool = True) -> None:
        super().__init__(Interface("virtual", "x"), None)
        self.clock, self.fd, self.seen = clock, fd, list[tuple[int, ReplayFrame]]()

    def send(self, frame: ReplayFrame, *, esi: bool = False) -> bool:
        assert esi == frame.esi
        self.seen.append((self.clock.passed, frame))
        return self.fd or not frame.fd


def parts(*frames: Frame) -> list[ReplayBatch]:
    return [
        ReplayBatch(each.frames, each.batch.buses, error_frames=2, lost=7) for each in frame_tables([piece(frames)])
    ]


def player(
    maps: dict[str | None, list[int]], most: int | None = None, **how: bool
) -> tuple[Player, list[Recording], int]:
    clock = Clock(over=60_000)
    outlets = [Recording(clock, **how), Recording(clock, **how)]
    pace = Pacer(1_000_000, lambda: False, clock, clock.sleep)
    return Player(outlets, Routes(maps), Timeline(Fraction(2), None), pace, most), outlets, clock.passed


def test_frames_go_out_as_they_are_recorded() -> None:
    flags = [0, EXTENDED, EXTENDED | REMOTE, EXTENDED | FD, FD | BRS | ESI]
    data = [b"12", b"", b"", bytes(12), bytes(64)]
    frames = [
        Frame(START + k * 20 * MS, "can0", 100 + k, flag, each, 5 if flag & REMOTE else 0)
        for k, (flag, each) in enumerate(zip(flags, data, strict=True))
    ]
    made, (outlet, other), start = player({None: [0]})
    made.play([parts(*frames)])
    sent = [frame for _, frame in outlet.seen]
    assert [frame.t for frame in sent] == [k * 10 * MS for k in range(5)]
    assert [(f.id, f.data, f.bus) for f in sent] == [(100 + k, each, 0) for k, each in enumerate(data)]
    assert [(f.extended, f.remote, f.fd, f.brs, f.esi) for f in sent] == [
        tuple(bool(flag & bit) for bit in (EXTENDED, REMOTE, FD, BRS, ESI)) for flag in flags
    ]
    assert sent[2].dlc == 5
    late = [at - start - frame.t for at, frame in outlet.seen]
    assert late[0] <= 131_000 + 60_000
    assert all(0 <= each <= 60_000 for each in late[1:])
    assert (made.sent, made.position, other.seen) == (5, 40 * MS, [])
    assert made.left_out == {
        "error frames, which only a controller makes": 2, "frames that the recording has lost": 7
    }  # fmt: skip


def test_each_bus_has_its_way() -> None:
    frames = [Frame(START + k, bus, k) for k, bus in enumerate(["can0", "can1", "can2", "can0"])]
    made, outlets, _ = player({"can0": [1], "can1": [0, 1]})
    made.play([parts(*frames)])
    assert [[frame.id for _, frame in outlet.seen] for outlet in outlets] == [[1], [0, 1, 3]]
    assert (made.sent, made.left_out["frames of can2, which no map names"]) == (4, 1)


def test_rounds_and_an_early_end() -> None:
    made, (outlet, _), _ = player({None: [0]}, most=5)
    made.play(iter([parts(Frame(START), Frame(START + 8 * MS, id=5))] * 9))
    assert [frame.id for _, frame in outlet.seen] == [0x123, 5, 0x123, 5, 0x123]
    assert [frame.t for _, frame in outlet.seen] == [0, 4 * MS, 4 * MS, 8 * MS, 8 * MS]


def test_rounds_without_frames_are_the_end() -> None:
    made, (outlet, _), _ = player({None: [0]})
    made.play(each for each in [parts(Frame(START)), parts(), parts(Frame(START))])
    assert len(outlet.seen) == 1


def test_what_an_outlet_does_not_take_is_not_sent() -> None:
    made, (outlet, _), _ = player({None: [0]}, most=1, fd=False)
    made.play([parts(Frame(START, flags=FD), Frame(START + MS), Frame(START + 2 * MS))])
    assert (len(outlet.seen), made.sent, made.position) == (2, 1, MS // 2)
