"""The steps of a node that matter now, in columns: those held from before, and those of a batch behind them.

Most steps of a counter that never counts by 1 show nothing. Which ones may show something is found in columns, for all
at once, by what has to be so at least; only these are looked at one by one.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.counters.begun_anew import AtZero
from analyzer.rules.counters.id_patterns import MOST_MOVED, RUN
from analyzer.rules.counters.id_steps import IS_GAP, IS_REPEATED, IS_RESTART, QUIET, RULES
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND, by_key

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.rules.counters.id_patterns import SharedCounter
    from analyzer.rules.counters.id_steps import IdSteps
    from dissectors.kit import Array

LONGEST = 15 * SECOND  # held back at most
MOST_HELD = 1024  # steps a node; the oldest ones are reported first


class StepWindow:
    """Steps of one node; `new` is the first of the batch.

    Args:
        steps: all of them; their rules may change as it becomes clear what they are.
        new: how many are from before.
        latest: the ID that the last step of a session came to before the batch, and how far that one counted.
        last: the latest time of any step before the batch.
    """

    def __init__(self, steps: IdSteps, new: int, latest: Mapping[int, tuple[int, int]], last: int) -> None:
        self.steps, self.new, self._before = steps, new, latest
        self._known_since = -1  # the first step that is still known as the one before
        size = len(steps.t)
        each, self._which = np.unique(steps.place, return_inverse=True)
        self.places: list[int] = each.tolist()
        order, begins = by_key(self._which)
        self._ends = order[np.append(begins[1:], size) - 1]
        self.past = self._shifted(order, 1)
        self._step = (steps.transfer_id - steps.before) % TRANSFER_IDS
        self._as_before = self._skips_alike()
        self.watched = self._to_watch(self._shifted(order, -1))
        self.quiet = self._apart(last)
        self._looked_at = self._to_look_at()
        zero = (steps.rule == IS_RESTART) | ((steps.rule == IS_REPEATED) & (steps.transfer_id == 0))
        self._to_zero: list[int] = np.flatnonzero(zero).tolist()  # no other step becomes one to 0

    def _shifted(self, order: Array, by: int) -> Array:
        """Return the step of the same session before each one (or behind it), -1 for none."""
        found = np.full(len(order), -1)
        here, there = (order[by:], order[:-by]) if by > 0 else (order[:by], order[-by:])
        same = self._which[here] == self._which[there]
        found[here[same]] = there[same]
        return found

    def _skips_alike(self) -> Array:
        """Return which steps look like restarts, and skip as many as the one before in their session."""
        steps, past = self.steps, self.past
        found: Array = (steps.rule == IS_RESTART) & (past >= self.new)
        found &= (steps.transfer_id[past] == steps.before) & (self._step[past] == self._step)
        first = (past < self.new) & (steps.rule == IS_RESTART)  # of its session in the batch
        first[: self.new] = False
        for k in np.flatnonzero(first).tolist() if self._before else ():
            found[k] = self._before.get(steps.place.item(k)) == (steps.before.item(k), self._step.item(k))
        return found

    def _to_watch(self, behind: Array) -> list[int]:
        """Return steps that need a look when they are told: restarts, and those that may have changed places."""
        steps = self.steps
        second, third = behind, np.where(behind >= 0, behind[behind], -1)
        moved = (steps.before[second] - steps.before) % TRANSFER_IDS
        swapped = (third >= 0) & (moved > 1) & (moved <= MOST_MOVED)
        swapped &= steps.transfer_id[second] == (steps.before + 1) % TRANSFER_IDS
        swapped &= steps.transfer_id[third] == (steps.before[second] + 1) % TRANSFER_IDS
        swapped &= steps.before[third] == (steps.transfer_id - 1) % TRANSFER_IDS
        found: list[int] = np.flatnonzero(swapped | ((steps.rule == IS_RESTART) & ~self._as_before)).tolist()
        return found

    def _apart(self, last: int) -> list[int]:
        """Return steps of the batch after more than `QUIET`, and those of which that is not plain."""
        t = self.steps.t[self.new :]
        if (t == NO_TIME).all() and last == NO_TIME:
            return []
        latest = np.maximum.accumulate(np.append(last, t))[:-1]
        plain = (t != NO_TIME) & (latest != NO_TIME)
        quiet = np.where(plain, t, 0) - np.where(plain, latest, 0) > QUIET
        found: list[int] = (np.flatnonzero(quiet | (t == NO_TIME)) + self.new).tolist()
        return found

    def _to_look_at(self) -> list[int]:
        """Return steps of the batch that may show something."""
        steps, past = self.steps, self.past
        back_rule = steps.rule[past]
        behind = (steps.before[past] - steps.transfer_id[past]) % TRANSFER_IDS
        again = (steps.before - steps.transfer_id[past]) % TRANSFER_IDS
        gap = (steps.rule == IS_GAP) | self._as_before
        look = (past >= 0) & gap & ((back_rule == IS_GAP) | (back_rule == IS_RESTART))  # the second step of a copy
        look &= (behind > 0) & (behind <= MOST_MOVED) & (again < behind)
        look &= steps.transfer_id == (steps.before[past] + 1) % TRANSFER_IDS
        look |= (steps.rule == IS_RESTART) & ~self._as_before
        look[: self.new] = False
        look[self.quiet] = True
        found: list[int] = np.flatnonzero(look).tolist()
        return found

    def look_at_runs(self, rows: Array, codes: Array, ids: Array, shared: SharedCounter | None) -> None:
        """Mark steps at which messages of several types have counted together for long.

        Args:
            rows: the messages of the node in the batch.
            codes: their types.
            ids: their transfer IDs.
            shared: what counts together up to the batch.
        """
        if not len(rows) or len(self.steps.t) == self.new:
            return
        on = np.ones(len(rows), bool)
        on[1:] = (ids[:-1] + 1) % TRANSFER_IDS == ids[1:]
        at = np.arange(len(rows))
        start = np.maximum.accumulate(np.where(on, -1, at))
        other = np.zeros(len(rows), bool)
        other[1:] = codes[1:] != codes[:-1]
        changed = np.maximum.accumulate(np.where(other, at, 0))
        run, several = at - np.maximum(start, 0) + 1, changed > np.maximum(start, 0)
        if shared is not None:
            run = np.where(start < 0, run + shared.run, run)
            several |= start < 0
        may = (run >= RUN) & several
        if may.any():
            here = np.searchsorted(rows, self.steps.row[self.new :], "right") - 1
            look = may[np.maximum(here, 0)] & (here >= 0)
            self._looked_at = sorted({*self._looked_at, *(np.flatnonzero(look) + self.new).tolist()})

    def forget(self, since: int) -> None:
        """Forget what came before a step: it is the one before no other."""
        self._known_since = since
        if not self._as_before.any():
            return
        lost = (self.past < since) & (self.steps.rule == IS_RESTART) & self._as_before
        lost[: max(since, self.new)] = False
        rows = np.flatnonzero(lost)
        self._as_before[rows] = False
        self._looked_at = sorted({*self._looked_at, *rows.tolist()})
        self.watched = sorted({*self.watched, *rows.tolist()})

    def next_looked_at(self, k: int, end: int) -> int:
        """Return the next step from `k` on that has to be looked at, `end` if there is none before."""
        at = bisect_left(self._looked_at, k)
        return min(self._looked_at[at], end) if at < len(self._looked_at) else end

    def next_quiet(self, k: int, end: int) -> int:
        """Return the next step from `k` on after a silence, `end` if there is none before."""
        at = bisect_left(self.quiet, k)
        return min(self.quiet[at], end) if at < len(self.quiet) else end

    def watch(self, k: int) -> None:
        """Look at a step and at the two before it in its session when they are told."""
        for _ in range(3):
            if k >= 0 and not self.is_watched(k):
                insort(self.watched, k)
            k = self.past.item(k) if k >= 0 else -1

    def is_watched(self, k: int) -> bool:
        """Return whether a step needs a look when it is told."""
        at = bisect_left(self.watched, k)
        return at < len(self.watched) and self.watched[at] == k

    def settle(self, begin: int, end: int) -> None:
        """Make gaps of what skips as many each time."""
        rule = self.steps.rule[begin:end]
        rule[self._as_before[begin:end]] = IS_GAP

    def settle_one(self, k: int) -> bool:
        """Do so with one; return whether it may be a restart."""
        if self._as_before[k]:
            self.steps.rule[k] = IS_GAP
        return self._is_zero(k)

    def _is_zero(self, k: int) -> bool:
        rule = self.steps.rule.item(k)
        return rule == IS_RESTART or (rule == IS_REPEATED and not self.steps.transfer_id.item(k))

    def at_zero(self, begin: int, end: int) -> list[int]:
        """Return the steps that may be restarts."""
        some = self._to_zero[bisect_left(self._to_zero, begin) : bisect_left(self._to_zero, end)]
        return [k for k in some if self._is_zero(k)]

    def next_of(self, wanted: Sequence[bool], k: int, end: int) -> int:
        """Return the next step from `k` on of the sessions that are wanted, `end` if there is none before."""
        if not any(wanted):
            return end
        found = np.array(wanted)[self._which[k:end]]
        return k + int(found.argmax()) if found.any() else end

    def sessions(self, begin: int, end: int) -> Iterator[tuple[int, Array, int]]:
        """Yield the sessions of some steps, which these are of each, and the last one of their frames."""
        if len(self.places) == 1:
            yield self.places[0], np.arange(begin, end), int(self.steps.last[begin:end].max())
            return
        which = self._which[begin:end]
        order, first = by_key(which)
        last = np.maximum.reduceat(self.steps.last[begin:end][order], first).tolist()
        each = which[order[first]].tolist()
        order += begin
        ends = [*first[1:].tolist(), len(order)]
        for one, low, high, frame in zip(each, first.tolist(), ends, last, strict=True):
            yield self.places[one], order[low:high], frame

    def latest(self) -> dict[int, tuple[int, int]]:
        """Return what the next batch needs to know of the latest steps."""
        found = {} if self._known_since >= 0 else dict(self._before)
        least = max(self._known_since, self.new)
        late = np.flatnonzero(self._ends >= least)
        k = self._ends[late]
        columns = late, self.steps.transfer_id[k], self._step[k]
        for one, transfer_id, step in zip(*(column.tolist() for column in columns), strict=True):
            found[self.places[one]] = transfer_id, step
        return found

    def zeros(self, rows: Iterable[int]) -> list[tuple[int, AtZero]]:
        """Return of some steps those that may be restarts."""
        return [(k, self.zero(k)) for k in rows if self._is_zero(k)]

    def zero(self, k: int) -> AtZero:
        """Return a step to 0."""
        steps = self.steps
        return AtZero(RULES[steps.rule.item(k)], steps.t.item(k), steps.since.item(k), steps.place.item(k))

    def next_changed(self, held: Sequence[int], k: int, end: int) -> int:
        """Return the step from `k` on with which something is told that may change by that, `end` if there is none.

        `held` are the steps before that wait to be told.
        """
        if not held and not (self.watched and self.watched[-1] >= k):
            return end
        for one in islice(self.watched, bisect_left(self.watched, held[0] if held else k), None):
            at = bisect_left(held, one)
            if one < k and (at == len(held) or held[at] != one):
                continue
            end = min(end, max(k + MOST_HELD + at + max(one - k, 0) - len(held), k))
            later = np.flatnonzero(self.steps.t[k:end] > int(self.steps.t[one]) + LONGEST)
            return k + int(later[0]) if len(later) else end
        return end
