"""What explains breaches of a transfer-ID counter.

Two senders in one session, one counter for several types, or transfers that came in another order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

IDS = 32
MOST_MOVED = 8  # transfers that changed places with each other
_STEPS = 3  # that a swap has
RUN, EACH = 20, 3  # messages that count together without a break, and of each type that is judged
MOST_SHOWN = 8  # messages of a shared counter that are evidence


@dataclass(slots=True)
class Chain:
    """One sender's counter: the ID it came to, and how often it went on by 1 after the other one spoke, at least."""

    last: int
    length: int = 1
    frames: Sequence[int] = ()


class Senders:
    """Tells whether a session is two interleaved counters; it is told only of steps that are not 1.

    A lost transfer leaves a counter that nobody continues. Two senders continue both, by turns.
    """

    def __init__(self) -> None:
        self._speaks: Chain | None = None
        self._waits: Chain | None = None

    def add(self, before: int, transfer_id: int, frames: Sequence[int]) -> None:
        """A transfer whose ID is not that of the transfer `before` plus 1."""
        if self._speaks is None:
            self._speaks = Chain(before)
        elif self._speaks.last != before:
            self._speaks.last = before
            self._speaks.length += 1
        spoke, after = self._speaks, self._waits
        if after is not None and (after.last + 1) % IDS == transfer_id:
            after.last, after.length, after.frames = transfer_id, after.length + 1, frames
        else:
            after = Chain(transfer_id, frames=frames)
        self._speaks, self._waits = after, spoke

    def length(self) -> int:
        """Transfers of the shorter counter, at least."""
        if self._speaks is None or self._waits is None:
            return 0
        return min(self._speaks.length, self._waits.length)

    def at(self) -> tuple[int, int]:
        """Where both counters are, the latest one last."""
        chains = [one.last for one in (self._waits, self._speaks) if one is not None]
        return chains[0], chains[-1]

    def frames(self) -> Iterator[int]:
        """The latest transfer of each, as far as it was a breach."""
        for one in (self._waits, self._speaks):
            if one is not None:
                yield from one.frames


@dataclass(slots=True)
class SharedCounter:
    """Messages of a node whose IDs rise by 1 over all types, from a breach at `t` on; it ends where they do not."""

    t: int
    last: int | None = None
    run: int = 0
    types: dict[int, list[int]] = field(default_factory=dict)
    frames: list[int] = field(default_factory=list)

    def fits(self, code: int, transfer_id: int, step: int, frames: Sequence[int] | None) -> bool:
        """The node's next message; False if it does not count on. `step` is that of its own session."""
        if self.last is not None and (self.last + 1) % IDS != transfer_id:
            return False
        counted = self.types.setdefault(code, [0, 0])
        counted[0] += 1
        # A type may jump by exactly 32, which reads as a repetition; the first step belongs to what was before.
        counted[1] += step != 1 and self.last is not None
        self.last = transfer_id
        self.run += 1
        self.frames += frames or ()
        return True

    def wants_frames(self) -> bool:
        """Whether more evidence is welcome."""
        return self.run < MOST_SHOWN

    def proven(self) -> bool:
        """Whether several types count together, and none of those sent often counts alone."""
        often = [jumps for sent, jumps in self.types.values() if sent >= EACH]
        return self.run >= RUN and len(often) > 1 and all(often)


def changed_places(steps: Sequence[tuple[int, int]]) -> bool:
    """Whether three steps of a session, the next ones that are not 1 each, only swap two neighbouring groups.

    A step is the ID before and its own. Of 5, 7, 6, 8 they are (5, 7), (7, 6), (6, 8): nothing is missing.
    """
    if len(steps) != _STEPS:
        return False
    (before, second), (last, first), (end, after) = steps
    moved = (last - before) % IDS
    expected = (before + 1) % IDS, (second - 1) % IDS, (last + 1) % IDS
    return 1 < moved <= MOST_MOVED and (first, end, after) == expected
