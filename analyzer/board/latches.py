"""Events since the mark, seen by somebody or not: one entry a thing, with first, last and count."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from analyzer.board.snapshot import Latched, LatchKind
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

# How a note begins that says how it goes, which is nothing that happened.
PROGRESS = "running for "
# Places, so that no kind takes those of another.
_PLACES: dict[LatchKind, int] = {"finding": 256, "restart": 128, "error": 64, "drop": 32, "note": 32}
MOST_LATCHED = sum(_PLACES.values())


@dataclass(slots=True)
class _Entry:
    subject: str
    text: str
    first: int
    last: int
    count: int


class Latches:
    """At most `MOST_LATCHED` entries, and so many of each kind; `beyond` counts what found no place."""

    def __init__(self) -> None:
        self._entries: dict[tuple[LatchKind, object], _Entry] = {}
        self._taken: Counter[LatchKind] = Counter()
        self.beyond = 0

    def put(
        self, kind: LatchKind, key: object, subject: str, text: str, t: int, *, count: int = 1, first: int | None = None
    ) -> None:  # fmt: skip
        """Note what happened `count` times from `first` (`t` if not given) to `t`; equal keys are one entry."""
        entry = self._entries.get((kind, key))
        if entry is None:
            if self._taken[kind] >= _PLACES[kind]:
                self.beyond += 1
                return
            self._taken[kind] += 1
            self._entries[kind, key] = _Entry(subject, text, t if first is None else first, t, count)
            return
        entry.last = max(entry.last, t)
        entry.count += count
        entry.text = text

    def clear(self) -> None:
        """Forget what has happened."""
        self._entries.clear()
        self._taken.clear()
        self.beyond = 0

    def rows(self) -> Iterator[Latched]:
        """Give every entry, in the order of the first time."""
        for (kind, _), one in self._entries.items():
            yield Latched(kind, one.subject, one.text, one.first, one.last, one.count)
