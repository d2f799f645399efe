"""What explains breaches of a transfer-ID counter.

Several senders in one session, one counter for several types, one that wraps early, or transfers in another order.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dissectors.conformance import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.steps import Breach

IDS = 32
MOST_MOVED = 8  # transfers that changed places with each other
_STEPS = 3  # that a swap has
MOST_SENDERS = 8
_LATEST = 64  # steps that are judged, and of them:
_NEARLY_ALL, _MOSTLY = 7 / 8, 3 / 4
_TIMING = 1 / 4  # so far off may a period be
WRAPS = 3  # from the same ID that are no restarts
_MOST_SESSIONS = 256  # of a node
RUN, EACH = 20, 3  # messages that count together without a break, and of each type that is judged
MOST_SHOWN = 8  # messages of a shared counter that are evidence


@dataclass(slots=True, eq=False)
class Chain:
    """One sender's counter: the ID it came to, and how often it went on by 1 after another one spoke, at least."""

    last: int
    length: int = 1
    frames: Sequence[int] = ()


class Senders:
    """Tells whether a session is several interleaved counters; it is told only of steps that are not 1.

    A lost transfer leaves a counter that nobody continues. Several senders continue all of them, by turns. Losses that
    come at regular intervals may look the same, but then time goes on as the IDs do.
    """

    def __init__(self) -> None:
        self._speaks: Chain | None = None
        self._waiting: list[Chain] = []  # the one that spoke last at the end
        self._at = NO_TIME  # of the latest step
        self._went_on: deque[bool] = deque(maxlen=_LATEST)  # whether it continued a counter that waited
        self._in_time: deque[bool] = deque(maxlen=_LATEST)  # whether losses explain it

    def add(self, one: Breach) -> None:
        """A transfer whose ID is not that of the transfer before plus 1."""
        spoke = self._speaks or Chain(one.before)
        silent = (one.before - spoke.last) % IDS
        self._in_time.append(_is_loss(silent, one.since - self._at if self._at != NO_TIME else 0, one))
        if silent:
            spoke.last = one.before
            spoke.length += 1
        self._waiting.append(spoke)
        known = [k for k, chain in enumerate(self._waiting) if (chain.last + 1) % IDS == one.transfer_id]
        if known:
            goes_on = self._waiting.pop(known[0])
            goes_on.length += 1
        else:
            goes_on = Chain(one.transfer_id)
            del self._waiting[: -MOST_SENDERS + 1]
        goes_on.last, goes_on.frames = one.transfer_id, one.frames
        self._speaks, self._at = goes_on, one.t
        self._went_on.append(bool(known))

    def counters(self, least: int) -> list[Chain]:
        """The counters, the latest one last, once two had so many transfers and all explain nearly every step."""
        chains = [*self._waiting, *filter(None, (self._speaks,))]
        steps = len(self._went_on)
        proven = sum(one.length >= least for one in chains) > 1 and sum(self._went_on) >= _NEARLY_ALL * steps
        if not proven or sum(self._in_time) >= _MOSTLY * steps:
            return []
        return [one for one in chains if 2 * one.length >= least]


def _is_loss(silent: int, took: int, one: Breach) -> bool:
    """Whether one sender may have lost transfers: the IDs before, `silent` of them, came as fast as the lost ones."""
    gap = one.t - one.since
    if not one.step or one.t == NO_TIME or gap <= 0 or took <= 0:
        return False
    by_time = took * one.step / gap
    return any(ids and abs(by_time - ids) <= _TIMING * ids for ids in range(silent, 4 * IDS, IDS))


class Wraps:
    """Tells a node's counters that always wrap early from restarts.

    In a restart the uptime falls too, and the ID before 0 is a different one each time.
    """

    def __init__(self) -> None:
        self._alike: dict[tuple[int, int, int], list[Breach]] = {}
        self._uptime = 0
        self._fell = NO_TIME  # when the uptime last did, or was 0

    def status(self, t: int, uptime: int) -> None:
        """The node's next NodeStatus."""
        if not uptime or uptime < self._uptime:
            self._fell = t
        self._uptime = uptime

    def add(self, one: Breach, *, to_zero: bool) -> bool:
        """Whether the steps of a session that are not 1 are, one after the other, falls to 0 from the same ID."""
        alike = self._alike.get(one.session, [])
        if not to_zero or (alike and alike[-1].before != one.before):
            self._alike.pop(one.session, None)
            alike = []
        if not to_zero or (one.session not in self._alike and len(self._alike) >= _MOST_SESSIONS):
            return False
        self._alike[one.session] = alike = [*alike, one][-WRAPS:]
        return len(alike) == WRAPS and (self._fell == NO_TIME or self._fell < alike[0].since)


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
