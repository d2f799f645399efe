"""What a worker on this machine does before its first capture: its process is all ours."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from analyzer.app.start import alone, keep_memory, plain_arrow

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

_HEARTBEAT = 5.0  # seconds; Dask's own half a second is for machines that vanish: here the scheduler sees workers end


def quick_start() -> None:
    """Make the process as quick as a command's, before anything heavy is imported."""
    alone()
    keep_memory()
    plain_arrow()


def dask_setup(worker: Any) -> None:
    """Prepare a worker; Dask calls this in each one of a cluster of ours."""
    quick_start()
    beat = worker.periodic_callbacks["heartbeat"]
    beat.callback = _seldom(beat.callback)


def _seldom(beat: Callable[[], Awaitable[None]]) -> Callable[[], Awaitable[None]]:
    last = time.monotonic() - _HEARTBEAT

    async def sometimes() -> None:
        nonlocal last
        if time.monotonic() - last >= _HEARTBEAT:
            last = time.monotonic()
            await beat()

    return sometimes
