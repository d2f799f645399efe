"""Ctrl-C ends the reading at a line's end instead of tearing the output."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING

from analyzer.sources import StopReading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.sources import Source
    from analyzer.sources.merge import Merged


@contextmanager
def graceful(reading: Callable[[], Source | Merged]) -> Iterator[None]:
    """The first Ctrl-C stops the source that is being read, a second one raises `KeyboardInterrupt`.

    Where SIGINT is ignored (a background job of a shell) it stays so.
    """

    def stop(*_: object) -> None:
        source = reading()
        if source.stopped:
            raise KeyboardInterrupt
        source.stopped = True
        if source.waits:
            raise StopReading

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        yield
        return
    try:
        signal.signal(signal.SIGINT, stop)
    except ValueError:  # not the main thread: signals are somebody else's
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
