"""Frames that were only asked for (TxRq): the first of two records of a frame that is sent, or the only one."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

T = TypeVar("T")

# Bytes of records from the first request on among which a frame must be that was sent, else none ever is; each record
# counts as so many at least.
MOST_HELD = 1 << 20
_LEAST = 64


class Way(Enum):
    """The way of a frame, as its record has it."""

    OTHER = 0
    SENT = 1
    REQUEST = 2


class Requests(Generic[T]):
    """Decides once for a capture whether requests count as frames: they do if it has no frames that were sent.

    Until that is known records wait, from the first request on; what stands before is passed on at once.
    """

    def __init__(self) -> None:
        self._held: list[tuple[T, Way]] = []
        self._bytes = 0
        self._count: bool | None = None
        self.taken = self.left = 0

    def sift(self, records: Iterable[tuple[T, Way, int]]) -> Iterator[tuple[T, bool]]:
        """Yield the records in their order, each with whether it is a request that does not count.

        They come with what they say of the way, and their size in bytes.
        """
        for record, way, size in records:
            self._held.append((record, way))
            self._bytes += max(size, _LEAST)
            if self._count is None and way is Way.SENT:
                self._count = False
            if self._count is None and self._held[0][1] is Way.REQUEST and self._bytes >= MOST_HELD:
                self._count = True
            if self._count is not None or self._held[0][1] is not Way.REQUEST:
                yield from self._release()

    def finish(self) -> Iterator[tuple[T, bool]]:
        """Yield what waited to the end."""
        self._count = self._count is not False
        yield from self._release()

    def notes(self) -> list[str]:
        """Return what is to be said of the requests."""
        taken = [f"frames that were asked for, none is said to be sent (TxRq): {self.taken}"] if self.taken else []
        return taken + ([f"requests of frames left out (TxRq): {self.left}"] if self.left else [])

    def _release(self) -> Iterator[tuple[T, bool]]:
        held, self._held, self._bytes = self._held, [], 0
        for record, way in held:
            left = way is Way.REQUEST and not self._count
            self.left += left
            self.taken += way is Way.REQUEST and not left
            yield record, left
