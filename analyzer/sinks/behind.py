"""Work behind: what is made here is written by other threads, while the next is made."""

from __future__ import annotations

from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

AT_ONCE = 2


class Behind:
    """Does jobs while whoever asks for them goes on: `AT_ONCE` at the same time, those of one key in their order.

    Who asks for more than that waits. What a job raises is raised by a later call. Without `threaded` each job is done
    at once.
    """

    def __init__(self, *, threaded: bool) -> None:
        self._pool = ThreadPoolExecutor(AT_ONCE, "behind") if threaded else None
        self._going: dict[str, Future[None]] = {}

    def do(self, key: str, job: Callable[[], None]) -> None:
        """Have a job done. Raises what an earlier one has raised."""
        if self._pool is None:
            job()
            return
        if key in self._going:
            self._going.pop(key).result()
        elif len(self._going) >= AT_ONCE:
            done, _ = wait(self._going.values(), return_when=FIRST_COMPLETED)
            for name in [name for name, one in self._going.items() if one in done]:
                self._going.pop(name).result()
        self._going[key] = self._pool.submit(job)

    def finish(self) -> None:
        """Wait until all jobs are done. Raises what one of them has raised."""
        while self._going:
            self._going.popitem()[1].result()

    def close(self) -> None:
        """End the threads, no later than the jobs that they are at."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
