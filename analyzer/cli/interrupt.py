"""Ctrl-C ends the reading at a line's end instead of tearing the output."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from analyzer.sources import StopReading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_ENDING = (signal.SIGTERM, signal.SIGHUP) if hasattr(signal, "SIGHUP") else (signal.SIGTERM,)


class Stoppable(Protocol):
    """Work that looks at `stopped` now and then, unless it `waits` for bytes."""

    stopped: bool

    @property
    def waits(self) -> bool:
        """Whether it would not notice."""


@contextmanager
def graceful(reading: Callable[[], Stoppable]) -> Iterator[None]:
    """The first Ctrl-C stops the work that `reading` names, a second one raises `KeyboardInterrupt`.

    SIGTERM and SIGHUP end the program at once, but not without cleaning up: as `SystemExit` with 128 + signal. Where a
    signal is ignored (a background job of a shell) it stays so.
    """

    def stop(*_: object) -> None:
        source = reading()
        if source.stopped:
            raise KeyboardInterrupt
        source.stopped = True
        if source.waits:
            raise StopReading

    def leave(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    before: dict[int, Any] = {}
    try:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            before[signal.SIGINT] = signal.signal(signal.SIGINT, stop)
        for number in _ENDING:
            if signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, leave)
    except ValueError:  # not the main thread: signals are somebody else's
        pass
    try:
        yield
    finally:
        for kept, usual in before.items():
            signal.signal(kept, usual)
