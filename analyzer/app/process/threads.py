"""Work ahead: one thread makes what another one uses, so that both go on at the same time."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from queue import SimpleQueue
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from concurrent.futures import Future

_Item = TypeVar("_Item")
THREADS = 2  # unless somebody asks for one
ROOM = 1
_WAITING = 2  # items that wait to be taken beside


@dataclass(frozen=True, slots=True)
class _End:
    """Nothing comes after it; `error` is why, if it was not simply the end."""

    error: BaseException | None = None


def beside(items: Iterable[_Item], take: Callable[[_Item], object]) -> Iterator[_Item]:
    """Yield the items, each taken in a thread beside; when the last one is through, all have been taken.

    What `take` raises is raised here.
    """
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - it brings logging, and commands judge in theirs

    waiting: deque[Future[object]] = deque()
    with ThreadPoolExecutor(1, "beside") as thread:
        for item in items:
            waiting.append(thread.submit(take, item))
            if len(waiting) > _WAITING:
                waiting.popleft().result()
            yield item
        for taken in waiting:
            taken.result()


def ahead(items: Iterable[_Item], room: int = ROOM) -> Iterator[_Item]:
    """Yield the items in their order, made in a thread of their own, at most `room` before they are asked for.

    What `items` raises is raised here behind the last item. When this iterator is closed early, `items` is closed too
    and the thread is gone: no later than the item that it was making is done.
    """
    source = iter(items)
    made: SimpleQueue[_Item | _End] = SimpleQueue()
    free = threading.Semaphore(room)
    stop = threading.Event()

    def make() -> None:
        error: BaseException | None = None
        try:
            while free.acquire() and not stop.is_set():
                try:
                    made.put(next(source))  # no name holds it: it may be large
                except StopIteration:
                    break
        except BaseException as problem:  # noqa: BLE001 - whoever uses the items has to know
            error = problem
        try:
            if (close := getattr(source, "close", None)) is not None:
                close()
        except BaseException as problem:  # noqa: BLE001 - likewise
            error = error or problem
        made.put(_End(error))

    worker = threading.Thread(target=make, name="ahead", daemon=True)
    worker.start()
    try:
        while not isinstance(item := made.get(), _End):
            free.release()
            yield item
            del item  # it may be large
        if item.error is not None:
            raise item.error
    finally:
        stop.set()
        free.release()
        worker.join()
