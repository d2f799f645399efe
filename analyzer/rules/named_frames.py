"""Which rules name which frames: for lists that mark their rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from dissectors.kit import Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, Occurrences

NameKey = tuple[str, int, int]  # rule, bus, node or -1
MOST_NAMED = 1 << 22  # places that are remembered, 8 bytes each, and as much to find them


class TakesOccurrences(Protocol):
    """Is told of each breach of a rule."""

    def feed(self, found: Occurrences | Occurrence) -> None:
        """Take occurrences of a rule."""


class NamedFrames:
    """Remembers the frames that occurrences name, by rule, bus and node; the first `MOST_NAMED` of them."""

    def __init__(self) -> None:
        self._parts: dict[NameKey, list[Array]] = {}
        self._count = 0
        self._rules: list[str] = []
        self._frames = np.zeros(0, np.int64)
        self._which = np.zeros(0, np.int64)

    def feed(self, found: Occurrences | Occurrence) -> None:
        """Take occurrences of a rule."""
        if self._count >= MOST_NAMED:
            return
        for key, frames in named_by(found):
            self._parts.setdefault(key, []).append(frames)
            self._count += len(frames)

    def finish(self, kept: Iterable[NameKey]) -> None:
        """Forget what turned out to be no finding; `kept` are rule, bus and node (-1 for none) of all that are."""
        wanted, parts = set(kept), dict[str, list[Any]]()
        for key, some in self._parts.items():
            if key in wanted:
                parts.setdefault(key[0], []).extend(some)
        self._parts.clear()
        self._rules = sorted(parts)
        every = [np.unique(np.concatenate(parts[rule])) for rule in self._rules]
        if every:
            frames, which = np.concatenate(every), np.repeat(np.arange(len(every)), list(map(len, every)))
            order = np.lexsort((which, frames))
            self._frames, self._which = frames[order], which[order]

    def between(self, first: int, last: int) -> dict[int, list[str]]:
        """Return the rules that name frames from the first place to the last, from 0, by place."""
        low, high = np.searchsorted(self._frames, (first, last + 1))
        found: dict[int, list[str]] = {}
        for frame, which in zip(self._frames[low:high].tolist(), self._which[low:high].tolist(), strict=True):
            found.setdefault(frame, []).append(self._rules[which])
        return found

    def frames_of(self, rule: str, bus: int, node: int | None) -> Array:
        """Return the places that occurrences of a rule name on a bus, of a node, from 0; before `finish`."""
        parts = self._parts.get((rule, bus, -1 if node is None else node), ())
        return np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64)


class RecentNames:
    """Remembers the frames that occurrences name for as long as rows of them wait: for what has no end.

    Only rules of findings that stand count: `keep` says which these are.
    """

    def __init__(self) -> None:
        self._parts: list[tuple[NameKey, Array]] = []
        self._kept: set[NameKey] = set()
        self._first = 0

    def feed(self, found: Occurrences | Occurrence) -> None:
        """Take occurrences of a rule."""
        self._parts += self._still(named_by(found))

    def keep(self, kept: Iterable[NameKey]) -> None:
        """Take rule, bus and node (-1 for none) of all findings that there are."""
        self._kept = set(kept)

    def forget(self, before: int) -> None:
        """Forget frames before a place."""
        self._first = before
        self._parts = list(self._still(self._parts))

    def between(self, first: int, last: int) -> dict[int, list[str]]:
        """Return the rules that name frames from the first place to the last, from 0, by place."""
        found: dict[int, set[str]] = {}
        for key, frames in self._parts:
            if key in self._kept:
                for frame in frames[(frames >= first) & (frames <= last)].tolist():
                    found.setdefault(frame, set()).add(key[0])
        return {frame: sorted(rules) for frame, rules in found.items()}

    def _still(self, parts: Iterable[tuple[NameKey, Array]]) -> Iterator[tuple[NameKey, Array]]:
        for key, frames in parts:
            late = frames[frames >= self._first]
            if len(late):
                yield key, late


def named_by(found: Occurrences | Occurrence) -> Iterator[tuple[NameKey, Array]]:
    """Yield the places of frames that occurrences name, from 0, by rule, bus and node (-1 for none)."""
    if isinstance(found, Occurrence):
        if found.frames:
            node = -1 if found.node is None else found.node
            yield (found.rule, found.bus, node), np.array(found.frames, np.int64)
        return
    frame, bus, nodes = (np.asarray(one, np.int64) for one in (found.frame, found.bus, found.node))
    who = bus * 256 + nodes + 1
    if found.each_named:
        lists = [found.frames(row) for row in range(len(frame))]
        frame = np.array([number for some in lists for number in some], np.int64)
        who = np.repeat(who, [len(some) for some in lists])
    named = frame >= 0
    for one in np.unique(who[named]).tolist():
        yield (found.rule, one // 256, one % 256 - 1), frame[named & (who == one)]
