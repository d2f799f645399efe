"""Frames that were there before: a piece of a capture that comes again is a tool's or an attacker's, and no loss."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.joint.alike import identities
from analyzer.tables import TAIL_ID, TRANSFER_IDS
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from analyzer.rules.joint.lacks import Lack
    from dissectors.kit import Array, FrameTable

LOOK = 1 << 15  # frames before one among which it may have been before
_HELD = 1 << 17  # frames at least; what is older is not looked for
_NEAR = SECOND  # so far apart is what the same piece of a capture does to sessions
_FEW = 8  # frames in a row may have the same bytes before the tail: an uptime, for one
_MANY = 32  # frames that are asked for at once, for which it pays to put all in order
_NEW, _SEEN, _ONCE = 0, 1, 2  # what a frame is: _ONCE if it came once before, and few others had these bytes


class Repeats:
    """The last frames of all buses."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0
        self._found: dict[int, int] = {}

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch."""
        if not len(frames):
            return
        self._batches.append(frames)
        self._held += len(frames)
        while self._held - len(self._batches[0]) >= _HELD:
            self._held -= len(self._batches.popleft())
        gone = [number for number in self._found if number < self._batches[0].first]
        for number in gone:
            del self._found[number]

    def among(self, lacks: Collection[Lack]) -> set[Lack]:
        """Return where nothing is missing, because frames came again or went on behind those.

        Bytes that come by themselves each time an ID comes round show that only beside others. One session is enough
        if no other one shows new bytes.
        """
        self._search({number for one in lacks for number in (*one.frames, one.left) if number is not None})
        kinds = {one: self._kind(one) for one in lacks}
        if not any(kinds.values()):
            return set()
        order = sorted(kinds, key=lambda one: one.until)
        times = np.array([one.until for one in order], np.int64)
        found: set[Lack] = set()
        for one, kind in kinds.items():
            if kind == _NEW:
                continue
            first, last = np.searchsorted(times, (one.until - _NEAR, one.until + _NEAR + 1)).tolist()
            near = order[first:last]
            sure = {each.session for each in near if kinds[each] == _ONCE}
            if len(sure) > 1 or (sure and all(self._found[each.frames[1]] != _NEW for each in near)):
                found.add(one)
        return found

    def _kind(self, one: Lack) -> int:
        return max(self._found[number] for number in (*one.frames, one.left) if number is not None)

    def _search(self, numbers: set[int]) -> None:
        """Find out what frames are that nobody asked for before."""
        unknown = np.array(sorted(numbers.difference(self._found)), np.int64)
        if not len(unknown):
            return
        self._found.update(dict.fromkeys(unknown.tolist(), _NEW))
        held = [frames for frames in self._batches if frames.first <= unknown[-1]]
        low = int(unknown[0]) - LOOK
        held = [frames for frames in held if frames.first + len(frames) > low]
        if not held:
            return
        pairs = [identities(frames) for frames in held]
        start, key, tail = held[0].first, *(np.concatenate(columns) for columns in zip(*pairs, strict=True))
        places = unknown[unknown >= start] - start
        for place, before in _before(key, places[tail[places] >= 0]):
            self._found[start + place] = _kind_of(int(tail[place]), tail[before])


def _before(key: Array, places: Array) -> Iterator[tuple[int, Array]]:
    """Yield places, each with those of `LOOK` before it that have the same key; those without any are left out."""
    if len(places) < _MANY:
        for place in places.tolist():
            low = max(place - LOOK, 0)
            same = np.flatnonzero(key[low:place] == key[place]) + low
            if len(same):
                yield place, same
        return
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    first, last = (np.searchsorted(ranked, key[places], side) for side in ("left", "right"))
    often = last - first > 1
    columns = (column[often].tolist() for column in (places, first, last))
    for place, a, b in zip(*columns, strict=True):
        same = order[a:b]
        same = same[np.searchsorted(same, place - LOOK) : np.searchsorted(same, place)]
        if len(same):
            yield place, same


def _kind_of(tail: int, tails: Array) -> int:
    """Return what a frame is by the tail bytes of those before it that are equal but for that."""
    again = int(np.count_nonzero(tails == tail))
    if not again:
        return _NEW
    ids = np.unique(tails & TAIL_ID)
    breaks = np.count_nonzero(np.diff(ids, append=ids[0] + TRANSFER_IDS) != 1)
    in_a_row = len(ids) == len(tails) <= _FEW and breaks <= 1
    return _ONCE if again == 1 and in_a_row else _SEEN
