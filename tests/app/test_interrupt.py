"""A signal ends the work at once and lets it clean up, wherever Python is when it comes."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from analyzer.app.process import interrupt
from analyzer.app.process.interrupt import cleaning, graceful, orderly
from analyzer.sources import StopReading

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

pytestmark = pytest.mark.timeout(600, method="thread")  # the alarm clock is needed here

ENDING = [signal.SIGTERM, signal.SIGHUP]


@dataclass
class Work:
    waits: bool = False
    stopped: bool = False


class Finalizer:
    """Python runs `__del__` where nothing can be raised."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)


def last_words(number: int) -> None:
    """Lose the last reference to an object whose finalizer is interrupted, and then wait."""
    Finalizer(number)
    signal.pause()


def twice(work: Work) -> None:
    signal.raise_signal(signal.SIGINT)
    assert work.stopped
    signal.raise_signal(signal.SIGINT)


def deaf(number: int, file: int) -> None:
    """Write for ever, whatever somebody asks for."""
    with orderly(Work):
        signal.raise_signal(number)
        while True:
            os.write(file, bytes(1 << 16))


@pytest.mark.parametrize("number", ENDING)
def test_work_ends_in_order(number: int) -> None:
    work = Work()
    with orderly(lambda: work) as heard:
        signal.raise_signal(number)
        assert (work.stopped, heard) == (True, [number])
    assert signal.getsignal(number) is signal.SIG_DFL


@pytest.mark.parametrize("number", ENDING)
def test_work_that_does_not_end_is_ended(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe that is full stands in for a terminal that takes nothing."""
    monkeypatch.setattr(interrupt, "GRACE", 0.05)
    ends = os.pipe()
    with pytest.raises(SystemExit) as leave:
        deaf(number, ends[1])
    assert leave.value.code == 128 + number
    for end in ends:
        os.close(end)


@pytest.mark.parametrize("number", ENDING)
def test_it_ends_at_once(number: int) -> None:
    with pytest.raises(SystemExit) as leave, cleaning():
        signal.raise_signal(number)
    assert leave.value.code == 128 + number
    assert signal.getsignal(number) is signal.SIG_DFL


@pytest.mark.parametrize("number", ENDING)
@pytest.mark.parametrize("handled", [cleaning, lambda: graceful(Work)])
def test_it_ends_even_if_it_came_while_a_finalizer_ran(number: int, handled: object) -> None:
    """It was lost there once, and the program went on as if nothing had been sent."""
    hook = sys.unraisablehook
    with pytest.raises(SystemExit) as leave, handled():
        last_words(number)
    assert leave.value.code == 128 + number
    assert sys.unraisablehook is hook


def finalizer_last(number: int, handled: Callable[[], AbstractContextManager[None]]) -> None:
    """Let a finalizer be interrupted by the very last statement; an alarm that is left would kill the tests."""
    try:
        with handled():
            Finalizer(number)
    finally:
        assert signal.setitimer(signal.ITIMER_REAL, 0) == (0.0, 0.0)


@pytest.mark.parametrize("number", ENDING)
@pytest.mark.parametrize("handled", [cleaning, lambda: graceful(Work)])
def test_it_ends_even_if_the_work_is_over_before_the_alarm(
    number: int, handled: Callable[[], AbstractContextManager[None]]
) -> None:
    """The alarm came after all handlers were gone once, and killed the program."""
    before = sys.unraisablehook, signal.getsignal(number), signal.getsignal(signal.SIGALRM)
    with pytest.raises(SystemExit) as leave:
        finalizer_last(number, handled)
    assert leave.value.code == 128 + number
    assert (sys.unraisablehook, signal.getsignal(number), signal.getsignal(signal.SIGALRM)) == before


def test_a_wait_ends_even_if_ctrl_c_came_while_a_finalizer_ran() -> None:
    work = Work(waits=True)
    with pytest.raises(StopReading), graceful(lambda: work):
        last_words(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), graceful(lambda: work):
        last_words(signal.SIGINT)


def test_the_first_ctrl_c_stops_and_the_second_one_interrupts() -> None:
    work = Work()
    with pytest.raises(KeyboardInterrupt), graceful(lambda: work):
        twice(work)


def test_a_signal_that_is_ignored_or_somebody_elses_stays_so() -> None:
    def mine(*_: object) -> None:
        pass

    usual = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, mine)
        with graceful(Work):
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) is mine
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
