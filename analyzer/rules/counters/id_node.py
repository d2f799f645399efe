"""A node whose transfer-ID counters break, and what explains that: step by step where something may show."""

from __future__ import annotations

from bisect import bisect_left
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.counters.begun_anew import NEAR, BegunAnew
from analyzer.rules.counters.id_patterns import EarlyWraps, SharedCounter, changed_places
from analyzer.rules.counters.id_steps import (
    COPIED,
    IS_COPY,
    IS_RESTART,
    LATE,
    QUIET,
    RESTARTED,
    RULES,
    MovedStep,
)
from analyzer.rules.counters.id_window import LONGEST, MOST_HELD, StepWindow
from analyzer.rules.counters.late_copies import time_before
from analyzer.rules.counters.several_senders import SeveralSenders
from analyzer.rules.counters.told_steps import SHARED_ID, explained, told
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.counters.id_steps import IdStep, IdSteps
    from analyzer.rules.counters.sent_messages import WalkedMessages
    from dissectors.kit import View

EXPIRY = 10 * SECOND  # a node is judged anew after this time without a breach
EVERY = SECOND  # what goes on is counted once in this time
REORDERED = "transfers in another order"
WRAPPING = "the counter always wraps after {}"
_FEW = 4  # steps that are not worth a stretch


class IdNode:
    """One node of one interface, from its first breach on; `found` collects what nothing explains.

    `held` and `found` are rows of `window`, `moved` those of which only the order changed.
    """

    def __init__(self, bus: int, node: int) -> None:
        self.bus, self.node = bus, node
        self.held: list[int] = []
        self.senders = SeveralSenders()
        self.shared: SharedCounter | None = None
        self.wraps = EarlyWraps()
        self.anew = BegunAnew()
        self.last = self.next = NO_TIME
        self.cause: Occurrence | None = None
        self.since = NO_TIME  # before the second of several senders came
        self._latest: dict[int, tuple[int, int]] = {}
        self._kept: IdSteps | None = None  # steps that are held between batches
        self._window: StepWindow | None = None
        self._at = 0  # the next step
        self._found: list[int] = []
        self._moved: dict[int, MovedStep] = {}

    @property
    def window(self) -> StepWindow:
        """The steps that are held, and those of the batch."""
        if self._window is None:
            raise RuntimeError("no batch is being taken")
        return self._window

    def feed(self, steps: IdSteps, view: View, sent: WalkedMessages) -> Iterator[Occurrence]:
        """Add the steps of a batch."""
        old = 0 if self._kept is None else len(self._kept.t)
        steps = steps if self._kept is None else self._kept + steps
        window = self._window = StepWindow(steps, old, self._latest, self.last)
        window.look_at_runs(*sent.columns(self), self.shared)
        self._at, size = old, len(steps.t)
        while self._at < size:
            end = self._calm_until(view, sent) if self.cause is None else self._explained_until()
            if end > self._at:
                yield from self._take(end, sent)
            if self._at < size:
                yield from self._add(self._at, view, sent)
                self._at += 1

    def end_batch(self) -> None:
        """Keep nothing of a batch but what is held."""
        if self._window is None:
            return
        window = self.window
        self._latest = window.latest()
        self._kept = window.steps.take(np.array(self.held, np.int64)).compact() if self.held else None
        self.held = list(range(len(self.held)))
        self._window = None

    def calm(self) -> None:
        """Give up looking for a cause of what is held."""
        self._release()
        self.senders.clear()

    def _release(self) -> None:
        """Take what is held as it is."""
        self.shared = None
        if self._window is None:
            self._latest = {}
            if self._kept is None:
                return
            self._window = StepWindow(self._kept, len(self._kept.t), {}, self.last)
            self._at = len(self._kept.t)
        window, held = self.window, []
        if any(map(window.is_watched, self.held)):
            while self.held:
                held.append(self._oldest())
        else:
            held, self.held = self.held, []
        zero = window.zeros(k for k in held if k not in self._moved)
        rules = self.anew.told([one for _, one in zero])
        for (k, _), rule in zip(zero, list(rules), strict=True):
            window.steps.rule[k] = RULES.index(rule)
        self._found += held
        window.forget(self._at)

    def _calm_until(self, view: View, sent: WalkedMessages) -> int:
        """Return the step up to which none can show a cause, nor is anything told but what stays as it is."""
        window, steps, k = self.window, self.window.steps, self._at
        end = window.next_looked_at(k, len(steps.t))
        if end - k < _FEW or steps.place.item(k) not in self.senders:
            return k
        end = sent.until_silence(self, k, min(end, window.next_changed(self.held, k, end)))
        if end - k < _FEW:
            return k
        end = window.next_of(self.senders.unfollowed(window.places), k, end)
        if end - k < _FEW:
            return k
        until = end
        for place, rows, last in window.sessions(k, until):
            shown = self.senders.shows(place, last, view)
            if shown is not None:
                end = min(end, int(rows[np.argmax(steps.last[rows] >= shown)]))
        return end

    def _explained_until(self) -> int:
        """Return the step up to which a cause stays the cause: all of a counter, as long as there is no silence."""
        if self.cause is None or self.cause.rule == SHARED_ID:
            return self._at
        return self.window.next_quiet(self._at, len(self.window.steps.t))

    def _take(self, end: int, sent: WalkedMessages) -> Iterator[Occurrence]:
        """Take the steps up to one all at once."""
        window, steps, begin = self.window, self.window.steps, self._at
        window.settle(begin, end)
        for k in window.at_zero(begin, end)[-NEAR:]:
            self.anew.add(self.window.zero(k))
        self._at = end
        self.last = max(self.last, int(steps.t[begin:end].max()))
        sent.tell(self, steps.row.item(end - 1))
        if self.cause is None:
            self._hold_all(begin, end, sent)
            return
        of_cause = explained(self.cause, steps, begin, end)
        self._found += (np.flatnonzero(~of_cause) + begin).tolist()
        rows = np.flatnonzero(of_cause) + begin
        while len(rows := rows[steps.t[rows] >= self.next]):
            yield self._again(self.cause, int(rows[0]))
            rows = rows[1:]

    def _hold_all(self, begin: int, end: int, sent: WalkedMessages) -> None:
        steps = self.window.steps
        if self.wraps:
            self.wraps.end(set(steps.place[begin:end][steps.rule[begin:end] != IS_COPY].tolist()))
        self.held += range(begin, end)
        sent.begin_latest(self, begin, end)
        limit = int(steps.t[begin:end].max()) - LONGEST
        over = max(len(self.held) - MOST_HELD, 0)
        while over < len(self.held) and steps.t.item(self.held[over]) < limit:
            over += 1
        self._found += self.held[:over]
        del self.held[:over]

    def _again(self, cause: Occurrence, k: int) -> Occurrence:
        """Return that a cause is still there with a step."""
        t = self.window.steps.t.item(k)
        self.next = t + EVERY
        return replace(cause, t=t, frames=tuple(self.window.steps.frames(k)))

    def _add(self, k: int, view: View, sent: WalkedMessages) -> Iterator[Occurrence]:
        """Add the next step."""
        window = self.window
        t, row = window.steps.t.item(k), window.steps.row.item(k)
        sent.tell(self, row)
        quiet = t - self.last if self.last != NO_TIME else 0
        if quiet > QUIET:
            self.calm()
        if quiet > EXPIRY:
            self.cause = None
        self.last = max(self.last, t)
        if window.settle_one(k):
            self.anew.add(self.window.zero(k))
        sent.run(self, row)
        one = window.steps.step(k)
        self._at = k + 1
        if self.cause is not None and self.cause.rule == SHARED_ID:
            self._see_others(one, view)
        if self.cause is None:
            yield from self._hold(k, one, view, sent)
        elif not explained(self.cause, window.steps, k, k + 1)[0]:
            self._found.append(k)
        elif self.cause.rule == SHARED_ID and t - self.senders.seen > QUIET:
            self.held.append(k)  # until one of the senders speaks again, or not
            if len(self.held) > MOST_HELD:
                self._release()
        elif t >= self.next:
            yield self._again(self.cause, k)
        self._at = k

    def _see_others(self, one: IdStep, view: View) -> None:
        """Give up several devices as the cause where only one has counted for long."""
        before = self.senders.seen
        shared = self.senders.shared(one, view)
        if one.t - self.senders.seen > EXPIRY:
            self.cause = None
            self.senders.clear()
        elif self.cause is not None and self.held and shared is not None and self.senders.seen > before:
            self._explain(self.cause, one.place, max(shared.since, self.senders.seen - LATE))

    def _explain(self, cause: Occurrence, place: int, since: int) -> None:
        """Tell what is held but for what the cause explains.

        Several devices explain what is since a time in a session, and in others, where they may have begun earlier.
        """
        steps = self.window.steps
        shared = cause.rule == SHARED_ID
        left = []
        for k in self.held:
            earliest = since - QUIET * (steps.place.item(k) != place)
            if not explained(cause, steps, k, k + 1)[0] or (shared and steps.t.item(k) < earliest):
                left.append(k)
        self.held = left
        self._release()

    def _hold(self, k: int, one: IdStep, view: View, sent: WalkedMessages) -> Iterator[Occurrence]:
        """Hold a step back, unless the cause shows with it."""
        self.held.append(k)
        wraps = self._wraps(one, k)
        self.cause = cause = self._shares(one, k, sent) or self._are_several(one, view) or wraps
        if cause is not None:
            yield cause
            self.next = one.t + EVERY
            self._explain(cause, one.place, self.since)
            if cause.rule != SHARED_ID:
                self.senders.clear()
        else:
            self._see_copy(k, one, view)
        steps = self.window.steps
        over = len(self.held) - MOST_HELD
        while self.held and (over > 0 or steps.t.item(self.held[0]) < one.t - LONGEST):
            self._found.append(self._alone(self._oldest()))
            over = len(self.held) - MOST_HELD

    def _see_copy(self, k: int, one: IdStep, view: View) -> None:
        """Make one of the last two of a session's steps, among so many, if both are of a transfer that came again."""
        window, last = self.window, len(self.held) - 1
        back = window.past.item(k)
        while back >= 0:
            at = bisect_left(self.held, back)
            if at < last and self.held[at] == back:
                break
            back = window.past.item(back)
        if back < 0 or at < last - NEAR:
            return
        before = window.steps.step(back)
        t = time_before(before, one, view)
        if t != NO_TIME:
            window.steps.rule[back] = IS_COPY
            window.steps.gap[back] = before.t - t
            window.watch(k)
            self.held.pop()

    def _alone(self, k: int) -> int:
        """Return a step that is told alone, as what it is."""
        if self.window.steps.rule[k] == IS_RESTART and k not in self._moved:
            self.window.steps.rule[k] = RULES.index(self.anew.alone(self.window.zero(k)))
        return k

    def _oldest(self) -> int:
        """Take the oldest breach out of those held, with the two behind it that transfers in another order cause."""
        first = self.held.pop(0)
        if not self.window.is_watched(first):
            return first
        steps = self.window.steps
        place = steps.place[first]
        after = list(islice((k for k in islice(self.held, NEAR) if steps.place[k] == place), 2))
        if not changed_places([(steps.before.item(k), steps.transfer_id.item(k)) for k in (first, *after)]):
            return first
        self.held = [k for k in self.held if k not in after]
        noted = bool(steps.early[first] or steps.late[[first, *after]].any())
        values = {**steps.values(first), "lost": 0, "cause": REORDERED}
        self._moved[first] = MovedStep((*steps.frames(first), *steps.frames(after[0])), values, noted)
        return first

    def _shares(self, one: IdStep, k: int, sent: WalkedMessages) -> Occurrence | None:
        if not one.of_message:
            return None
        if self.shared is None:
            self.shared = SharedCounter(one.t)
            sent.begin(self, self.window.steps.row.item(k))
        if not self.shared.proven():
            return None
        values = {"types": len(self.shared.types), "node": self.node}
        return Occurrence("TRF-020", self.shared.t, self.bus, self.node, "", tuple(self.shared.frames), values)

    def _wraps(self, one: IdStep, k: int) -> Occurrence | None:
        if one.rule == COPIED or not self.wraps.add(one, to_zero=one.rule == RESTARTED):
            return None
        steps = self.window.steps
        first = next(at for at in self.held if steps.rule[at] == IS_RESTART and steps.before[at] == one.before)
        frames = tuple(dict.fromkeys((*steps.frames(first), *one.frames)))
        values = {**steps.values(k), "cause": WRAPPING.format(one.before)}
        return Occurrence(RESTARTED, steps.t.item(first), self.bus, self.node, "", frames, values)

    def _are_several(self, one: IdStep, view: View) -> Occurrence | None:
        shared = self.senders.shared(one, view)
        if shared is None:
            return None
        self.senders.seen = one.t
        self.since = shared.since
        steps = self.window.steps
        since = (k for k in self.held if steps.place[k] == one.place and steps.t[k] >= shared.since)
        first = next(since, self.held[-1])
        frames = tuple(dict.fromkeys((*steps.frames(first), *shared.frames)))
        return Occurrence(
            SHARED_ID, steps.t.item(first), self.bus, self.node, "", frames, {"evidence": shared.evidence}
        )

    def founds(self) -> Iterator[Occurrences]:
        """Yield what nothing explains."""
        if self._found:
            rows, moved = np.array(self._found, np.int64), self._moved
            self._found, self._moved = [], {}
            yield from told((self.bus, self.node), self.window.steps, rows, moved)
