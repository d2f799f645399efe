"""Frames go out at their times, late ones no faster than the bus could carry, and failures are told apart."""

from __future__ import annotations

import errno
from itertools import pairwise

import can
import pytest
from kit.waiting import Clock

from analyzer.live.interfaces.naming import InterfaceError
from analyzer.live.replay.sender import BURST, LONGEST, MOST_BEHIND, PATIENCE, SLICE, Pacer, Sender
from dissectors.times import SECOND
from dissectors.traffic import SimulatedFrame

BIT = 1000  # ns at 1 Mbit/s
EMPTY = 67 * BIT  # of an extended frame without data


def frames(*times: int, data: bytes = b"") -> list[SimulatedFrame]:
    return [SimulatedFrame(1, data, t=t) for t in times]


def sent(clock: Clock, waiting: list[SimulatedFrame], delays: dict[int, int] | None = None) -> tuple[list[int], Pacer]:
    """When each frame is let through; `delays` are what the sender of a frame loses."""
    start, pace, times = clock.passed, Pacer(1_000_000, lambda: False, clock, clock.sleep), []
    for number, _ in enumerate(pace.over(waiting)):
        times.append(clock.passed - start)
        clock.passed += (delays or {}).get(number, 0)
    return times, pace


def test_each_at_its_time_without_drift() -> None:
    times = [k * 500_000 for k in range(1, 2000)]
    got, pace = sent(Clock(over=60_000), frames(*times))
    assert all(0 <= late <= 60_000 for late in (a - b for a, b in zip(got, times, strict=True)))
    assert pace.behind == 0


def test_a_delay_is_caught_up_with_at_the_speed_of_the_bus() -> None:
    times = [k * 200_000 for k in range(1, 200)]
    got, pace = sent(Clock(), frames(*times, data=b"12345678"), {49: 5_000_000})
    length = EMPTY + 64 * BIT
    assert got[:50] == times[:50]
    assert got[50] == got[49] + 5_000_000
    late = [a - b for a, b in zip(got, times, strict=True)]
    assert late[50] > late[60] > late[70] > 0
    assert late[-1] == pace.behind == 0
    assert all(b - a >= 20 * length - BURST for a, b in zip(got, got[20:], strict=False))


def test_sleeps_that_are_too_long_do_not_slow_a_full_bus_down() -> None:
    length = EMPTY + 64 * BIT
    times = [k * length for k in range(1, 2000)]
    got, pace = sent(Clock(over=100_000), frames(*times, data=b"12345678"))
    assert max(a - b for a, b in zip(got, times, strict=True)) <= 100_000
    assert pace.behind == 0


def test_a_long_delay_moves_the_rest() -> None:
    times = [k * SECOND // 100 for k in range(1, 100)]
    got, pace = sent(Clock(), frames(*times), {20: 3 * SECOND})
    assert got[:21] == times[:21]
    assert pace.elapsed == times[-1]
    assert pace.behind > MOST_BEHIND
    assert [b - a for a, b in pairwise(got[21:])] == [SECOND // 100] * 77


def test_no_bus_waits_for_another() -> None:
    waiting = [SimulatedFrame(1, b"12345678", bus=bus, t=0) for bus in (0, 0, 1, 2, 1)]
    assert sent(Clock(), waiting)[0] == [length * (EMPTY + 64 * BIT) for length in (1, 2, 2, 2, 2)]


def test_switched_data_take_less_time() -> None:
    waiting = [SimulatedFrame(1, bytes(64), fd=True, brs=brs, t=0) for brs in (False, True)]
    got, _ = sent(Clock(), waiting)
    assert [got[0], got[1] - got[0]] == [EMPTY + 512 * BIT, EMPTY + 64 * BIT]


def test_without_a_bit_rate_times_count_for_nothing() -> None:
    clock, seen = Clock(), list[int]()
    pace = Pacer(None, lambda: len(seen) == 3, clock, clock.sleep)
    for frame in pace.over(frames(0, SECOND, 5, 7, 9)):
        seen.append(frame.t)
    assert (seen, clock.slept, pace.behind) == ([0, SECOND, 5], [], 0)


def test_a_wait_is_cut_short_by_its_end() -> None:
    clock, stopped = Clock(), False

    def sleep(seconds: float) -> None:
        nonlocal stopped
        clock.sleep(seconds)
        stopped = len(clock.slept) == 3

    pace = Pacer(1_000_000, lambda: stopped, clock, sleep)
    got = list(pace.over(frames(SECOND // 100, 3600 * SECOND)))
    assert [frame.t for frame in got] == [SECOND // 100]
    assert clock.slept[1:] == [SLICE / SECOND] * 2


def test_nothing_is_let_through_after_the_end() -> None:
    pace = Pacer(1_000_000, lambda: True, clock := Clock(), clock.sleep)
    assert list(pace.over(frames(0, 1))) == []


class Bus:
    """Fails as often as it is told to."""

    def __init__(self, error: Exception, times: int) -> None:
        self.error, self.times, self.sent = error, times, 0

    def send(self, _: can.Message) -> None:
        if self.times:
            self.times -= 1
            raise self.error
        self.sent += 1


FULL = [
    can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS),
    can.CanOperationError("Transmit buffer full"),
    can.CanTimeoutError(),
    OSError(errno.EAGAIN, "Resource temporarily unavailable"),
]


@pytest.mark.parametrize("error", FULL)
def test_a_full_buffer_is_waited_for(error: Exception) -> None:
    clock, bus = Clock(), Bus(error, 9)
    Sender(bus, "can0", clock, clock.sleep).send(can.Message())
    assert (bus.sent, len(clock.slept)) == (1, 9)
    assert clock.slept == sorted(clock.slept)
    assert max(clock.slept) == LONGEST / SECOND


@pytest.mark.parametrize("error", FULL)
def test_but_not_for_ever(error: Exception) -> None:
    clock, bus = Clock(), Bus(error, 10**6)
    start = clock.passed
    with pytest.raises(InterfaceError) as caught:
        Sender(bus, "can0", clock, clock.sleep).send(can.Message())
    assert PATIENCE <= clock.passed - start <= PATIENCE + LONGEST
    assert str(caught.value) == (
        "can0: its transmit buffer stays full: does anybody acknowledge, is the controller bus-off?"
    )


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN), "is down (ip link set can0 up)"),
        (can.CanOperationError("Failed to transmit: No such device", errno.ENODEV), "has been removed"),
        (OSError(errno.ENXIO, "No such device or address"), "has been removed"),
        (can.CanOperationError("Failed\nin two lines", 12345), "Failed"),
        (can.CanOperationError(""), "CanOperationError"),
        (ValueError("too long"), "too long"),
    ],
)
def test_other_failures_end_it(error: Exception, said: str) -> None:
    clock, bus = Clock(), Bus(error, 1)
    with pytest.raises(InterfaceError) as caught:
        Sender(bus, "can0", clock, clock.sleep).send(can.Message())
    assert (str(caught.value), clock.slept) == (f"can0: {said}", [])
