"""Which rules name which frames of a bus that runs: the newest of them, found by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.named_frames import named_by

if TYPE_CHECKING:
    from analyzer.rules.named_frames import NameKey
    from dissectors.kit import Occurrence, Occurrences

_MOST = 200_000  # frames, some 30 MB


class LiveNames:
    """Is told of breaches by one thread, and asked for frames by another; the oldest frames are forgotten.

    Attributes:
        revision: rises when frames are named that were not before.
    """

    def __init__(self) -> None:
        self._rules: dict[int, tuple[NameKey, ...]] = {}
        self._kept: set[NameKey] = set()
        self.revision = 0

    def feed(self, found: Occurrences | Occurrence) -> None:
        """Take occurrences of a rule."""
        for key, frames in named_by(found):
            for frame in frames.tolist():
                before = self._rules.get(frame, ())
                if key not in before:
                    self._rules[frame] = (*before, key)
                    self.revision += key in self._kept
        while len(self._rules) > _MOST:
            del self._rules[next(iter(self._rules))]

    def keep(self, rule: str, bus: int, node: int | None) -> None:
        """Take a finding: what breaches its rule counts from now on."""
        key = rule, bus, -1 if node is None else node
        self.revision += key not in self._kept
        self._kept.add(key)

    def between(self, first: int, last: int) -> dict[int, list[str]]:
        """Return the rules that name frames from the first place to the last, from 0, by place."""
        found = {}
        for frame in range(first, last + 1):
            rules = sorted({key[0] for key in self._rules.get(frame, ()) if key in self._kept})
            if rules:
                found[frame] = rules
        return found
