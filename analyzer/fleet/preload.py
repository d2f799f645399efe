"""Prepare a worker on this machine before its first capture: its process is all ours."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from analyzer.app.process.start import alone, keep_memory, plain_arrow

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

_CALM = 5.0  # seconds between two looks at what changes with the cluster; work is balanced as often
_AS_IT_IS = ("memory_monitor", "tick", "heartbeat")
_HEARTBEAT = 5.0  # seconds; Dask's own half a second is for machines that vanish: here the scheduler sees workers end


def quick_start() -> None:
    """Make the process as quick as a command's, before anything heavy is imported.

    Captures are judged in a thread that is not the first one: with memory of its own it asks the system for each large
    column anew. All threads share what the first one has.
    """
    alone()
    keep_memory(arenas=1)
    plain_arrow()


def dask_setup(worker: Any) -> None:
    """Prepare a worker; Dask calls this in each one of a cluster of ours."""
    quick_start()
    calm(worker)
    beat = worker.periodic_callbacks["heartbeat"]
    beat.callback = _seldom(beat.callback)


def calm(server: Any) -> None:
    """Have a part of a cluster look after itself more seldom, but for its memory and for how late its own loop is."""
    for name, periodic in server.periodic_callbacks.items():
        if name not in _AS_IT_IS:
            periodic.callback_time = max(periodic.callback_time, _CALM * 1000)


def _seldom(beat: Callable[[], Awaitable[None]]) -> Callable[[], Awaitable[None]]:
    last = time.monotonic() - _HEARTBEAT

    async def sometimes() -> None:
        nonlocal last
        if time.monotonic() - last >= _HEARTBEAT:
            last = time.monotonic()
            await beat()

    return sometimes
