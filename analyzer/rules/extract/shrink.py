"""Fewer and fewer lines of a capture that still show the same: other nodes go first, then the ends, then the middle.

Every step is tried with a judge of its own, so the number of trials bounds the time; it is the same for the same
capture, and so is the result.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

Lines = list[bytes]

MOST_TRIALS = 96
MOST_WORK = 4_000_000  # lines judged in all trials together
_MOST_GROUPS = 12  # that are left out one by one, the largest first
_ERROR = 0x20000000  # bit of an identifier in candump text
_NODE = 0x7F
_REMARKS = (b"#", b";", b"DROPCOUNT:")  # what lines without a frame begin with


class Shrinker:
    """Tries parts of a capture.

    Args:
        shows: whether some lines still show what is wanted; it is called at most `trials` times.
        trials: how often.
    """

    def __init__(self, shows: Callable[[bytes], bool], trials: int = MOST_TRIALS) -> None:
        self._shows = shows
        self._trials = trials
        self._work = MOST_WORK

    def shrink(self, lines: Lines) -> Lines:
        """Return as few of the lines as the trials find, in their order; all of them show it."""
        lines = self._without_groups(lines, _sender)
        lines = self._without_groups(lines, _identifier)
        lines = self._without_start(lines)
        lines = self._without_end(lines)
        return self._without_middle(lines)

    def _try(self, lines: Sequence[bytes]) -> bool:
        if self._trials <= 0 or self._work < len(lines) or not lines:
            return False
        self._trials -= 1
        self._work -= len(lines)
        return self._shows(b"".join(lines))

    def _without_groups(self, lines: Lines, key: Callable[[bytes], Hashable]) -> Lines:
        counts = Counter(map(key, lines))
        if len(counts) < 2:
            return lines
        for group, _ in counts.most_common(_MOST_GROUPS):
            fewer = [line for line in lines if key(line) != group]
            if self._try(fewer):
                lines = fewer
        return lines

    def _without_start(self, lines: Lines) -> Lines:
        kept, lost = 0, len(lines)
        while lost - kept > 1:
            middle = (kept + lost) // 2
            if self._try(lines[middle:]):
                kept = middle
            else:
                lost = middle
        return lines[kept:]

    def _without_end(self, lines: Lines) -> Lines:
        kept, lost = len(lines), 0
        while kept - lost > 1:
            middle = (kept + lost) // 2
            if self._try(lines[:middle]):
                kept = middle
            else:
                lost = middle
        return lines[:kept]

    def _without_middle(self, lines: Lines) -> Lines:
        """Leave out pieces, as delta debugging does, smaller ones when no larger one can be."""
        pieces = 2
        while len(lines) >= 2 and self._trials > 0:
            size = -(-len(lines) // pieces)
            before = len(lines)
            at = 0
            while at < len(lines):
                fewer = lines[:at] + lines[at + size :]
                if self._try(fewer):
                    lines = fewer
                else:
                    at += size
            if size == 1 and len(lines) == before:
                break
            pieces = min(pieces * 2, max(len(lines), 2))
        return lines


def _identifier(line: bytes) -> tuple[bytes, bytes]:
    """Return interface and identifier of a line of `candump -l`; of one without a frame no interface, and its mark."""
    for mark in _REMARKS:
        if line.startswith(mark):
            return b"", mark
    words = line.split(maxsplit=3)
    bus, frame = words[1:3] if line.startswith(b"(") else words[:2]  # not every frame has a time
    return bus, frame.partition(b"#")[0]


def _sender(line: bytes) -> tuple[bytes, object]:
    """Return who sent it, as far as the identifier says; error frames and remarks are nobody's."""
    bus, text = _identifier(line)
    if not bus or len(text) < 8:
        return bus, text
    number = int(text, 16)
    return bus, "error frame" if number & _ERROR else number & _NODE
