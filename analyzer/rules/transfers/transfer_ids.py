"""Transfer IDs that do not count up by 1: gaps, repetitions, restarts, shared counters, several senders in a session.

The core measures each step, so a session without steps costs nothing. A node whose counter breaks is followed:
what it breaks is held back until it is clear whether one counter for all types (TRF-020), several devices (BUS-010) or
a counter that always wraps early explain it. All show in a few transfers; else everything is reported after 2.0 s
without another id_step, and transfers that only changed places are one breach.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from itertools import islice
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.transfers.begun_anew import NEAR, BegunAnew
from analyzer.rules.transfers.id_patterns import EarlyWraps, SharedCounter, changed_places
from analyzer.rules.transfers.id_steps import COPIED, GAP, MESSAGE, QUIET, RESTARTED, id_step, odd_rows
from analyzer.rules.transfers.late_copies import see_copy
from analyzer.rules.transfers.orphan_frames import OrphanFrames
from analyzer.rules.transfers.session_starts import LatestFrames
from analyzer.rules.transfers.several_senders import SeveralSenders
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, Rule
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.rules.transfers.id_steps import IdStep
    from dissectors.kit import Array, Severity, TransferTable, View

LATE = 5 * SECOND  # a transfer can come out 2.0 s after its start; then nothing follows within `QUIET` any more
EXPIRY = 10 * SECOND  # a node is judged anew after this time without a breach
LONGEST = 15 * SECOND  # held back at most
MOST_HELD = 1024  # steps a node; the oldest ones are reported first
EVERY = SECOND  # what goes on is counted once in this time
SHARED_ID = "BUS-010"
REORDERED = "transfers in another order"
WRAPPING = "the counter always wraps after {}"


class _Node:
    """One node of one interface, from its first breach on; `found` collects what nothing explains."""

    def __init__(self, bus: int, node: int) -> None:
        self.bus, self.node = bus, node
        self.held: list[IdStep] = []
        self.senders = SeveralSenders()
        self.shared: SharedCounter | None = None
        self.wraps = EarlyWraps()
        self.anew = BegunAnew()
        self.latest: dict[tuple[int, int, int], IdStep] = {}
        self.last = self.next = NO_TIME
        self.cause: Occurrence | None = None
        self.since = NO_TIME  # before the second of several senders came
        self.found: list[IdStep] = []

    def calm(self) -> None:
        """Give up looking for a cause of what is held."""
        self._release()
        self.senders.clear()

    def _release(self) -> None:
        """Take what is held as it is."""
        held = []
        while self.held:
            held.append(self._oldest())
        self.found += self.anew.told(held)
        self.latest.clear()
        self.shared = None

    def add(self, one: IdStep, view: View, sent: _Sent, row: int) -> Iterator[Occurrence]:
        """Add the next step, in a row of the batch."""
        sent.tell(self, row)
        quiet = one.t - self.last if self.last != NO_TIME else 0
        if quiet > QUIET:
            self.calm()
        if quiet > EXPIRY:
            self.cause = None
        self.last = max(self.last, one.t)
        past = self.latest.get(one.session)
        self.latest[one.session] = one
        if one.rule == RESTARTED and past is not None and (past.transfer_id, past.step) == (one.before, one.step):
            one = one.as_gap()  # it skips as many each time
        self.anew.add(one)
        sent.run(self, row)
        if self.cause is not None and self.cause.rule == SHARED_ID:
            self._see_others(one, view, sent)
        if self.cause is None:
            yield from self._hold(one, view, sent, row)
        elif not _explains(self.cause, one):
            self.found.append(one)
        elif self.cause.rule == SHARED_ID and one.t - self.senders.seen > QUIET:
            self.held.append(one)  # until one of the senders speaks again, or not
            if len(self.held) > MOST_HELD:
                self._release()
        elif one.t >= self.next:
            self.next = one.t + EVERY
            yield replace(self.cause, t=one.t, frames=tuple(one.frames))

    def _see_others(self, one: IdStep, view: View, sent: _Sent) -> None:
        """Give up several devices as the cause where only one has counted for long."""
        before = self.senders.seen
        shared = self.senders.shared(one, view, sent.frames)
        if one.t - self.senders.seen > EXPIRY:
            self.cause = None
            self.senders.clear()
        elif self.held and shared is not None and self.senders.seen > before:
            self._explain(one.session, max(shared.since, self.senders.seen - LATE))

    def _explain(self, session: tuple[int, int, int], since: int) -> None:
        """Tell what is held but for what the cause explains.

        Several devices explain what is since a time in a session, and in others, where they may have begun earlier.
        """
        shared = self.cause is not None and self.cause.rule == SHARED_ID
        self.held = [
            one
            for one in self.held
            if not _explains(self.cause, one) or (shared and one.t < since - QUIET * (one.session != session))
        ]
        self._release()

    def _hold(self, one: IdStep, view: View, sent: _Sent, row: int) -> Iterator[Occurrence]:
        """Hold a step back, unless the cause shows with it."""
        self.held.append(one)
        wraps = self._wraps(one)
        self.cause = self._shares(one, sent, row) or self._are_several(one, view, sent) or wraps
        if self.cause is not None:
            yield self.cause
            self.next = one.t + EVERY
            self._explain(one.session, self.since)
            if self.cause.rule != SHARED_ID:
                self.senders.clear()
        else:
            see_copy(self.held, view, NEAR)
        over = len(self.held) - MOST_HELD
        while self.held and (over > 0 or self.held[0].t < one.t - LONGEST):
            self.found.append(self.anew.alone(self._oldest()))
            over = len(self.held) - MOST_HELD

    def _oldest(self) -> IdStep:
        """Take the oldest breach out of those held, with the two behind it that transfers in another order cause."""
        first = self.held.pop(0)
        near = (one for one in islice(self.held, NEAR) if one.session == first.session)
        after = list(islice(near, 2))
        steps = [(one.before, one.transfer_id) for one in (first, *after)]
        if not changed_places(steps):
            return first
        self.held = [one for one in self.held if not any(one is other for other in after)]
        note = first.early or any(one.late for one in (first, *after))
        values = {**first.values, "lost": 0, "cause": REORDERED}
        frames = (*first.frames, *after[0].frames)
        return first._replace(rule=GAP, severity="note" if note else None, frames=frames, values=values)

    def _shares(self, one: IdStep, sent: _Sent, row: int) -> Occurrence | None:
        if not one.of_message:
            return None
        if self.shared is None:
            self.shared = SharedCounter(one.t)
            sent.begin(self, row)
        if not self.shared.proven():
            return None
        values = {"types": len(self.shared.types), "node": self.node}
        return Occurrence("TRF-020", self.shared.t, self.bus, self.node, "", tuple(self.shared.frames), values)

    def _wraps(self, one: IdStep) -> Occurrence | None:
        if one.rule == COPIED or not self.wraps.add(one, to_zero=one.rule == RESTARTED):
            return None
        first = next(held for held in self.held if (held.rule, held.before) == (RESTARTED, one.before))
        frames = tuple(dict.fromkeys((*first.frames, *one.frames)))
        values = {**one.values, "cause": WRAPPING.format(one.before)}
        return Occurrence(RESTARTED, first.t, self.bus, self.node, "", frames, values)

    def _are_several(self, one: IdStep, view: View, sent: _Sent) -> Occurrence | None:
        shared = self.senders.shared(one, view, sent.frames)
        if shared is None:
            return None
        self.senders.seen = one.t
        self.since = shared.since
        first = next((held for held in self.held if held.session == one.session and held.t >= shared.since), one)
        frames = tuple(dict.fromkeys((*first.frames, *shared.frames)))
        return Occurrence(SHARED_ID, first.t, self.bus, self.node, "", frames, {"evidence": shared.evidence})


class _Sent:
    """The messages of a node in a batch, walked through while a shared counter may show.

    `uptimes` are those in its NodeStatus by the row of the transfer, `frames` the latest of all nodes.
    """

    def __init__(self, transfers: TransferTable, uptimes: Sequence[tuple[int, int]], frames: LatestFrames) -> None:
        self.frames = frames
        self._t = transfers
        self._rows: list[int] | None = None
        self._at = 0
        self._uptimes = deque(uptimes)

    def tell(self, node: _Node, row: int) -> None:
        """Tell the uptimes before a row."""
        while self._uptimes and self._uptimes[0][0] < row:
            at, uptime = self._uptimes.popleft()
            t = int(self._t.t[at])
            if node.held and t - node.last > LATE:
                node.calm()
            node.wraps.status(t, uptime)
            node.anew.uptimes.add(t, uptime, int(self._t.transfer_id[at]))

    def begin(self, node: _Node, row: int) -> None:
        """Start with the message of a row."""
        self._at = bisect_left(self._of(node), row)
        self.run(node, row)

    def run(self, node: _Node, row: int) -> None:
        """Follow all messages up to and with that of a row, until one does not fit."""
        if node.shared is None:
            return
        t, shared, rows = self._t, node.shared, self._of(node)
        while self._at < len(rows) and rows[self._at] <= row:
            here = rows[self._at]
            frames = t.frames(here) if shared.wants_frames() else None
            if not shared.fits(int(t.code[here]), int(t.transfer_id[here]), int(t.step[here]), frames):
                node.shared = None
                return
            self._at += 1

    def _of(self, node: _Node) -> list[int]:
        if self._rows is None:
            t = self._t
            self._rows = np.flatnonzero((t.src == node.node) & (t.bus == node.bus) & (t.kind == MESSAGE)).tolist()
        return self._rows


class TransferIds(Rule):
    """Steps of transfer IDs, and what explains them. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, int], _Node] = {}
        self._orphans = OrphanFrames()
        self._frames = LatestFrames()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield breaches that are explained, or that nothing explains."""
        self._orphans.feed(view)
        self._frames.feed(view)
        t = view.transfers
        by_node: dict[tuple[int, int], list[int]] = {}
        for row in odd_rows(t).tolist():
            by_node.setdefault((int(t.bus[row]), int(t.src[row])), []).append(row)
        uptimes = _uptimes(view)
        for key in (*uptimes, *(key for key, node in self._nodes.items() if node.shared is not None)):
            by_node.setdefault(key, [])
        for key, rows in by_node.items():
            node = self._nodes.setdefault(key, _Node(*key))
            sent = _Sent(t, uptimes.get(key, ()), self._frames)
            for row in rows:
                one = id_step(view, row, self._orphans)
                if one is not None:
                    yield from node.add(one, view, sent, row)
            sent.run(node, len(t))
            sent.tell(node, len(t))
        for node in self._nodes.values():
            if node.held and view.end != NO_TIME and view.end - node.last > LATE:
                node.calm()
            yield from _founds(node)

    def finish(self, _view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what was held back at the end of the capture."""
        for node in self._nodes.values():
            node.calm()
            yield from _founds(node)


def _uptimes(view: View) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Return what every node says, by the row of the transfer."""
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    table = view.table(NODE_STATUS)
    if table is not None:
        rows = np.flatnonzero(table.trusted)
        columns = (column[rows].tolist() for column in (table.bus, table.src, table.row, table["uptime_sec"]))
        for bus, src, row, uptime in zip(*columns, strict=True):
            found.setdefault((bus, src), []).append((row, uptime))
    return found


def _explains(cause: Occurrence | None, one: IdStep) -> bool:
    """Return whether a cause explains a step.

    Several devices explain every breach of a node, a shared counter those of its messages that are no copies.
    """
    if cause is None:
        return False
    if cause.rule == RESTARTED:
        return one.rule == RESTARTED and one.values["expected"] == cause.values["expected"]
    return cause.rule == SHARED_ID or (one.of_message and one.rule != COPIED)


def _founds(node: _Node) -> Iterator[Occurrences]:
    """Yield what nothing explains, put together by rule, severity and cause."""
    if not node.found:
        return
    apart: dict[tuple[str, Severity | None, str], list[IdStep]] = {}
    for one in node.found:
        apart.setdefault((one.rule, one.severity, one.values.get("cause", "")), []).append(one)
    node.found = []
    for (rule, severity, _), steps in apart.items():
        yield _found(node, rule, severity, steps)


def _found(node: _Node, rule: str, severity: Severity | None, steps: list[IdStep]) -> Occurrences:
    def column(values: Iterable[int]) -> Array:
        return np.fromiter(values, np.int64, len(steps))

    return Occurrences(
        rule=rule,
        t=column(one.t for one in steps),
        bus=np.full(len(steps), node.bus),
        node=np.full(len(steps), node.node),
        type=column(one.code for one in steps),
        frame=column(one.frames[0] for one in steps),
        values=lambda k: steps[k].values,
        frames=lambda k: steps[k].frames,
        severity=severity,
        drops=rule != COPIED,
        since=column(one.since for one in steps),
    )
