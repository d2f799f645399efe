"""Transfer IDs that do not count up by 1: gaps, repetitions, restarts, shared counters, several senders in a session.

The core measures each step, so a session without breaches costs nothing. A node whose counter breaks is followed:
what it breaks is held back until it is clear whether one counter for all types (TRF-020), several devices (BUS-010) or
a counter that always wraps early explain it. All show in a few transfers; else everything is reported after 2.0 s
without another breach, and transfers that only changed places are one breach.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.rules.headless import Headless
from analyzer.rules.nodes import STATUS
from analyzer.rules.sequences import Senders, SharedCounter, Wraps, changed_places
from analyzer.rules.steps import COPIED, GAP, MESSAGE, QUIET, REPEATED, RESTARTED, breach, odd_rows
from dissectors.conformance import NO_TIME, SECOND, Found, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.rules.steps import Breach
    from dissectors.conformance import Severity, Transfers, View, Words

LATE = 5 * SECOND  # a transfer can come out 2.0 s after its start; then nothing follows within `QUIET` any more
EXPIRY = 10 * SECOND  # a node is judged anew after this time without a breach
LONGEST = 15 * SECOND  # held back at most
MOST_HELD = 1024  # breaches a node; the oldest ones are reported first
EVERY = SECOND  # what goes on is counted once in this time
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
NEAR = 64  # breaches of a node among which those of transfers in another order are looked for
REORDERED = "transfers in another order"
WRAPPING = "the counter always wraps after {}"
FEW = 2  # so many may be lost before 0 rather than that all begins anew


class _Node:
    """One node of one interface, from its first breach on; `found` collects what nothing explains."""

    def __init__(self, bus: int, node: int) -> None:
        self.bus, self.node = bus, node
        self.held: list[Breach] = []
        self.senders: dict[tuple[int, int, int], Senders] = {}
        self.shared: SharedCounter | None = None
        self.wraps = Wraps()
        self.anew: deque[Breach] = deque(maxlen=NEAR)
        self.latest: dict[tuple[int, int, int], Breach] = {}
        self.last = self.next = NO_TIME
        self.cause: Occurrence | None = None
        self.found: list[Breach] = []

    def calm(self) -> None:
        """Gives up looking for a cause of what is held."""
        held = []
        while self.held:
            held.append(self._oldest())
        self.found += _restarts(held)
        self.senders.clear()
        self.latest.clear()
        self.shared = None

    def add(self, one: Breach, view: View, sent: _Sent, row: int) -> Iterator[Occurrence]:
        """The next breach, in a row of the batch."""
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
        if one.rule == RESTARTED:
            self.anew.append(one)
        sent.run(self, row)
        if self.cause is not None:
            if not _explains(self.cause, one):
                self.found.append(one)
            elif one.t >= self.next:
                self.next = one.t + EVERY
                yield replace(self.cause, t=one.t, frames=tuple(one.frames))
            return
        self.held.append(one)
        wraps = self._wraps(one)
        self.cause = self._shares(one, sent, row) or self._are_several(one, view) or wraps
        if self.cause is not None:
            yield self.cause
            self.next = one.t + EVERY
            self.held = [held for held in self.held if not _explains(self.cause, held)]
            self.calm()
        over = len(self.held) - MOST_HELD
        while self.held and (over > 0 or self.held[0].t < one.t - LONGEST):
            oldest = self._oldest()
            self.found.append(oldest.as_gap() if _is_lost(oldest, self.anew) else oldest)
            over = len(self.held) - MOST_HELD

    def _oldest(self) -> Breach:
        """Takes the oldest breach out of those held, with the two behind it that transfers in another order cause."""
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

    def _shares(self, one: Breach, sent: _Sent, row: int) -> Occurrence | None:
        if not one.of_message:
            return None
        if self.shared is None:
            self.shared = SharedCounter(one.t)
            sent.begin(self, row)
        if not self.shared.proven():
            return None
        values = {"types": len(self.shared.types), "node": self.node}
        return Occurrence("TRF-020", self.shared.t, self.bus, self.node, "", tuple(self.shared.frames), values)

    def _wraps(self, one: Breach) -> Occurrence | None:
        if one.rule == COPIED or not self.wraps.add(one, to_zero=one.rule == RESTARTED):
            return None
        first = next(held for held in self.held if (held.rule, held.before) == (RESTARTED, one.before))
        frames = tuple(dict.fromkeys((*first.frames, *one.frames)))
        values = {**one.values, "cause": WRAPPING.format(one.before)}
        return Occurrence(RESTARTED, first.t, self.bus, self.node, "", frames, values)

    def _are_several(self, one: Breach, view: View) -> Occurrence | None:
        if one.late or one.rule == COPIED:
            return None
        senders = self.senders.setdefault(one.session, Senders())
        senders.add(one)
        counters = senders.counters(int(view.number("BUS-010", "min_transfers")))
        if not counters:
            return None
        *places, last = (str(counter.last) for counter in counters)
        number = _NUMBERS[len(counters)]
        evidence = f"{number} transfer-ID counters in {view.type_name(one.code)}, at {', '.join(places)} and {last}"
        first = next(held for held in self.held if held.session == one.session)
        frames = tuple(dict.fromkeys((*first.frames, *(frame for counter in counters for frame in counter.frames))))
        return Occurrence("BUS-010", first.t, self.bus, self.node, "", frames, {"evidence": evidence})


class _Sent:
    """The messages of a node in a batch, walked through while a shared counter may show.

    `uptimes` are those in its NodeStatus by the row of the transfer.
    """

    def __init__(self, transfers: Transfers, uptimes: Sequence[tuple[int, int]]) -> None:
        self._t = transfers
        self._rows: list[int] | None = None
        self._at = 0
        self._uptimes = deque(uptimes)

    def tell(self, node: _Node, row: int) -> None:
        """Says the uptimes before a row."""
        while self._uptimes and self._uptimes[0][0] < row:
            at, uptime = self._uptimes.popleft()
            node.wraps.status(int(self._t.t[at]), uptime)

    def begin(self, node: _Node, row: int) -> None:
        """Starts with the message of a row."""
        self._at = bisect_left(self._of(node), row)
        self.run(node, row)

    def run(self, node: _Node, row: int) -> None:
        """All messages up to and with that of a row, until one does not fit."""
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


class TransferIds(Watcher):
    """Steps of transfer IDs, and what explains them. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, int], _Node] = {}
        self._headless = Headless()

    def look(self, view: View) -> Iterator[Found | Occurrence]:
        """Breaches that are explained, or that nothing explains."""
        self._headless.add(view)
        t = view.transfers
        by_node: dict[tuple[int, int], list[int]] = {}
        for row in odd_rows(t).tolist():
            by_node.setdefault((int(t.bus[row]), int(t.src[row])), []).append(row)
        uptimes = _uptimes(view)
        for key in (*uptimes, *(key for key, node in self._nodes.items() if node.shared is not None)):
            by_node.setdefault(key, [])
        for key, rows in by_node.items():
            node = self._nodes.setdefault(key, _Node(*key))
            sent = _Sent(t, uptimes.get(key, ()))
            for row in rows:
                one = breach(view, row, self._headless)
                if one is not None:
                    yield from node.add(one, view, sent, row)
            sent.run(node, len(t))
            sent.tell(node, len(t))
        for node in self._nodes.values():
            if node.held and view.end != NO_TIME and view.end - node.last > LATE:
                node.calm()
            yield from _founds(node)

    def settle(self, _view: View) -> Iterator[Found | Occurrence]:
        """What was held back at the end of the capture."""
        for node in self._nodes.values():
            node.calm()
            yield from _founds(node)


def _uptimes(view: View) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """What every node says, by the row of the transfer."""
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    table = view.table(STATUS)
    if table is not None:
        rows = np.flatnonzero(table.trusted)
        columns = (column[rows].tolist() for column in (table.bus, table.src, table.row, table["uptime_sec"]))
        for bus, src, row, uptime in zip(*columns, strict=True):
            found.setdefault((bus, src), []).append((row, uptime))
    return found


def _explains(cause: Occurrence, one: Breach) -> bool:
    """Several devices explain every breach of a node, a shared counter those of its messages that are no copies."""
    if cause.rule == RESTARTED:
        return one.rule == RESTARTED and one.values["expected"] == cause.values["expected"]
    return cause.rule == "BUS-010" or (one.of_message and one.rule != COPIED)


def _restarts(held: list[Breach]) -> Iterator[Breach]:
    """The breaches, with restarts told from what looks like one: a restarted node begins all its sessions anew.

    A session that was at 0 by chance did not stand still then, and one that comes to 0 alone, with few left out, has
    lost those.
    """
    anew = [one for one in held if one.rule == RESTARTED]
    known = {one.session for one in anew}
    for one in held:
        if _is_lost(one, anew):
            yield one.as_gap()
        elif one.rule == REPEATED and not one.transfer_id and one.session not in known:
            known.add(one.session)
            yield one._replace(rule=RESTARTED) if _with_others(one, anew) else one
        else:
            yield one


def _is_lost(one: Breach, anew: Iterable[Breach]) -> bool:
    """Whether the few IDs before 0 were lost, rather than all that the node sends begun anew."""
    return one.rule == RESTARTED and 0 < one.step - 1 <= FEW and not _with_others(one, anew)


def _with_others(one: Breach, anew: Iterable[Breach]) -> bool:
    return any(abs(one.t - other.t) <= QUIET and other.session != one.session for other in anew)


def _founds(node: _Node) -> Iterator[Found]:
    """What nothing explains, put together by rule, severity and cause."""
    if not node.found:
        return
    apart: dict[tuple[str, Severity | None, str], list[Breach]] = {}
    for one in node.found:
        apart.setdefault((one.rule, one.severity, one.values.get("cause", "")), []).append(one)
    node.found = []
    for (rule, severity, _), breaches in apart.items():
        yield _found(node, rule, severity, breaches)


def _found(node: _Node, rule: str, severity: Severity | None, breaches: list[Breach]) -> Found:
    def column(values: Iterable[int]) -> Words:
        return np.fromiter(values, np.int64, len(breaches))

    return Found(
        rule=rule,
        t=column(one.t for one in breaches),
        bus=np.full(len(breaches), node.bus),
        node=np.full(len(breaches), node.node),
        type=column(one.code for one in breaches),
        frame=column(one.frames[0] for one in breaches),
        values=lambda k: breaches[k].values,
        frames=lambda k: breaches[k].frames,
        severity=severity,
        drops=rule != COPIED,
        since=column(one.since for one in breaches),
    )


WATCHERS: tuple[type[Watcher], ...] = (TransferIds,)
