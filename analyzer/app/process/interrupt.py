"""Ctrl-C ends the reading at a line's end instead of tearing the output."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Protocol

from analyzer.sources import StopReading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

GRACE = 3.0  # seconds
_USUAL = (signal.SIG_DFL, signal.default_int_handler)
_ALARM = "SIGALRM"
_MOMENT = 0.005  # seconds: as soon as the finalizer is over


class Stoppable(Protocol):
    """Work that looks at `stopped` now and then, unless it `waits` for bytes."""

    stopped: bool

    @property
    def waits(self) -> bool:
        """True while it would not notice."""


@contextmanager
def graceful(work: Callable[[], Stoppable]) -> Iterator[None]:
    """Let the first Ctrl-C stop the work that `work` names, and a second one raise `KeyboardInterrupt`.

    SIGTERM and SIGHUP end the program as with `cleaning`.
    """

    def stop(*_: object) -> None:
        now = work()
        if now.stopped:
            raise KeyboardInterrupt
        now.stopped = True
        if now.waits:
            raise StopReading

    with handling({"SIGINT": stop, "SIGTERM": _leave, "SIGHUP": _leave}):
        yield


@contextmanager
def orderly(work: Callable[[], Stoppable]) -> Iterator[list[int]]:
    """Let the first Ctrl-C, SIGTERM or SIGHUP stop the work that `work` names, and a second signal end the program.

    Work that does not end within `GRACE` of SIGTERM or SIGHUP, such as a line for a terminal that takes none, is ended
    like that. Yields the numbers of the signals that came.
    """
    heard: list[int] = []
    here = threading.get_ident()
    timers: list[threading.Timer] = []

    def stop(number: int, _: object) -> None:
        heard.append(number)
        if len(heard) > 1:
            raise SystemExit(128 + number)
        work().stopped = True
        if number != signal.SIGINT and hasattr(signal, "pthread_kill"):
            # To this thread: only there it interrupts what waits.
            timers.append(threading.Timer(GRACE, signal.pthread_kill, (here, number)))
            timers[0].daemon = True
            timers[0].start()

    with handling({"SIGINT": stop, "SIGTERM": stop, "SIGHUP": stop}):
        try:
            yield heard
        finally:
            for timer in timers:
                timer.cancel()


@contextmanager
def cleaning() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the program at once, but not without cleaning up: `SystemExit` with 128 + signal."""
    with handling({"SIGTERM": _leave, "SIGHUP": _leave}):
        yield


def _leave(number: int, _: object) -> None:
    raise SystemExit(128 + number)


@contextmanager
def handling(handlers: Mapping[str, Callable[..., None]]) -> Iterator[None]:
    """Handle signals, by name, until the end.

    A signal that is ignored (a background job of a shell), that somebody else handles or that the system does not know
    stays as it is; so does each of them outside the main thread. What a handler raised as a finalizer ran is raised at
    the end at the latest.
    """
    lost = _Lost()
    before = {}
    with suppress(ValueError):  # not the main thread: signals are somebody else's
        for name, handler in {**handlers, _ALARM: lost.raise_it}.items():
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) in _USUAL:
                before[number] = signal.signal(number, handler)
    if getattr(signal, _ALARM, None) in before:
        sys.unraisablehook = lost.keep
    try:
        yield
    finally:
        try:
            lost.raise_it()  # not later: the alarm would meet the handler of before, and end the program
        finally:
            for number, usual in before.items():
                signal.signal(number, usual)
            sys.unraisablehook = lost.usual


class _Lost:
    """An exception of a handler that Python lost, as a finalizer ran: it is raised a moment later."""

    def __init__(self) -> None:
        self.usual = sys.unraisablehook
        self._exception: BaseException | None = None

    def keep(self, what: sys.UnraisableHookArgs) -> None:
        if isinstance(what.exc_value, (SystemExit, KeyboardInterrupt, StopReading)):
            self._exception = what.exc_value
            signal.setitimer(signal.ITIMER_REAL, _MOMENT, _MOMENT)
        else:
            self.usual(what)

    def raise_it(self, *_: object) -> None:
        exception, self._exception = self._exception, None
        if exception is not None:
            signal.setitimer(signal.ITIMER_REAL, 0)
            raise exception
