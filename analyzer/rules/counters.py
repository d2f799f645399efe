"""Transfer IDs that do not count up by 1: gaps, repetitions, restarts, shared counters, and two senders in one session.

The core measures each step, so a session without breaches costs nothing. A node whose counter breaks is followed:
what it breaks is held back until it is clear whether one counter for all types (TRF-020) or two devices (BUS-010)
explain it. Both show in a few transfers; else everything is reported after 2.0 s without another breach, and transfers
that only changed places are one breach.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from analyzer.rules.headless import Headless
from analyzer.rules.sequences import IDS, Senders, SharedCounter, changed_places
from analyzer.tables import KINDS, TRANSFER_ANOMALIES
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Found, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.conformance import Severity, Transfers, Values, View, Words

MESSAGE, REQUEST = KINDS.index("message"), KINDS.index("request")
QUIET = 2 * SECOND  # after it any transfer ID may follow (4.1.3)
LATE = 5 * SECOND  # a transfer can come out 2.0 s after its start; then nothing follows within `QUIET` any more
EXPIRY = 10 * SECOND  # a node is judged anew after this time without a breach
LONGEST = 15 * SECOND  # held back at most
MOST_HELD = 1024  # breaches a node; the oldest ones are reported first
EVERY = SECOND  # what goes on is counted once in this time
GAP, COPIED, REPEATED, RESTARTED = "TRF-016", "TRF-017", "TRF-018", "TRF-019"
_RULES = {
    1 << TRANSFER_ANOMALIES.index("transfer id gap"): GAP,
    1 << TRANSFER_ANOMALIES.index("duplicate"): COPIED,
    1 << TRANSFER_ANOMALIES.index("transfer id repeated"): REPEATED,
    1 << TRANSFER_ANOMALIES.index("transfer id restarted"): RESTARTED,
}
_BITS = sum(_RULES)
NEAR = 64  # breaches of a node among which those of transfers in another order are looked for
REORDERED, BEHEADED = "transfers in another order", "frames came without a start"
FEW = 2  # so many may be lost before 0 rather than that all begins anew


class Breach(NamedTuple):
    """One step that is not 1. `session` is (kind, type, destination), `code` the type for `View.type_name`.

    `late` is a step after more than `QUIET`, which proves nothing; `early` is one soon after the start of the capture.
    `since` is the time of the transfer before; `cause` is that of a gap.
    """

    rule: str
    severity: Severity | None
    late: bool
    t: int
    code: int
    session: tuple[int, int, int]
    transfer_id: int
    before: int
    frames: Sequence[int]
    values: Values
    since: int
    early: bool
    cause: str = ""

    @property
    def of_message(self) -> bool:
        """Whether it is no request."""
        return self.session[0] == MESSAGE


class _Node:
    """One node of one interface, from its first breach on; `found` collects what nothing explains."""

    def __init__(self, bus: int, node: int) -> None:
        self.bus, self.node = bus, node
        self.held: list[Breach] = []
        self.senders: dict[tuple[int, int, int], Senders] = {}
        self.shared: SharedCounter | None = None
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
        self.shared = None

    def add(self, one: Breach, view: View, sent: _Sent, row: int) -> Iterator[Occurrence]:
        """The next breach, in a row of the batch."""
        quiet = one.t - self.last if self.last != NO_TIME else 0
        if quiet > QUIET:
            self.calm()
        if quiet > EXPIRY:
            self.cause = None
        self.last = max(self.last, one.t)
        sent.run(self, row)
        if self.cause is not None:
            if not _explains(self.cause, one):
                self.found.append(one)
            elif one.t >= self.next:
                self.next = one.t + EVERY
                yield replace(self.cause, t=one.t, frames=tuple(one.frames))
            return
        self.held.append(one)
        self.cause = self._shares(one, sent, row) or self._is_two(one, view)
        if self.cause is not None:
            yield self.cause
            self.next = one.t + EVERY
            self.held = [held for held in self.held if not _explains(self.cause, held)]
            self.calm()
        over = len(self.held) - MOST_HELD
        while self.held and (over > 0 or self.held[0].t < one.t - LONGEST):
            self.found.append(self._oldest())
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

    def _is_two(self, one: Breach, view: View) -> Occurrence | None:
        if one.late or one.rule == COPIED:
            return None
        senders = self.senders.setdefault(one.session, Senders())
        senders.add(one.before, one.transfer_id, one.frames)
        if senders.length() < view.number("BUS-010", "min_transfers"):
            return None
        evidence = "two transfer-ID counters in {}, one at {}, one at {}".format(
            view.type_name(one.code), *senders.at()
        )
        first = next(held for held in self.held if held.session == one.session)
        frames = tuple(dict.fromkeys((*first.frames, *senders.frames())))
        return Occurrence("BUS-010", first.t, self.bus, self.node, "", frames, {"evidence": evidence})


class _Sent:
    """The messages of a node in a batch, walked through while a shared counter may show."""

    def __init__(self, transfers: Transfers) -> None:
        self._t = transfers
        self._rows: list[int] | None = None
        self._at = 0

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
        for row in _odd_rows(t).tolist():
            by_node.setdefault((int(t.bus[row]), int(t.src[row])), []).append(row)
        for key, node in self._nodes.items():
            if node.shared is not None:
                by_node.setdefault(key, [])
        for key, rows in by_node.items():
            node = self._nodes.setdefault(key, _Node(*key))
            sent = _Sent(t)
            for row in rows:
                one = _breach(view, row, self._headless)
                if one is not None:
                    yield from node.add(one, view, sent, row)
            sent.run(node, len(t))
        for node in self._nodes.values():
            if node.held and view.end != NO_TIME and view.end - node.last > LATE:
                node.calm()
            yield from _founds(node)

    def settle(self, _view: View) -> Iterator[Found | Occurrence]:
        """What was held back at the end of the capture."""
        for node in self._nodes.values():
            node.calm()
            yield from _founds(node)


def _odd_rows(t: Transfers) -> Words:
    """Rows of messages and requests whose step is there and is not 1."""
    rows: Words = np.flatnonzero(t.step != 1)
    if not len(rows):
        return rows
    kind = t.kind[rows]
    ours: Words = t.has("step")[rows] & ((kind == MESSAGE) | (kind == REQUEST))
    return np.extract(ours, rows)


def _breach(view: View, row: int, headless: Headless) -> Breach | None:
    """The breach of a row, None if it is none: after a silence only a gap is, and no copy without times."""
    t = view.transfers
    bits = int(t.anomaly[row]) & _BITS
    rule = _RULES[bits & -bits] if bits else GAP
    transfer_id, step, at, kind = int(t.transfer_id[row]), int(t.step[row]), int(t.t[row]), int(t.kind[row])
    late = not bits
    if (late and (not step or not transfer_id)) or (rule == COPIED and at == NO_TIME):
        return None
    before, bus = (transfer_id - step) % IDS, int(t.bus[row])
    expected = (before + 1) % IDS
    past = at - int(t.gap[row]) if at != NO_TIME and t.has("gap")[row] else at
    if at != NO_TIME and past < view.resumed(at):
        return None
    early = at != NO_TIME and at - view.starts[bus] < QUIET
    values: dict[str, Any] = {"transfer_id": transfer_id, "expected": expected}
    to, lost, cause = int(t.dst[row]) if kind == REQUEST else -1, (step - 1) % IDS, ""
    if rule in (GAP, RESTARTED):
        missing = ((expected + k) % IDS for k in range(lost))
        bits_of = int(t.type_id[row]) << 8 if kind == MESSAGE else int(t.type_id[row]) << 16 | 1 << 15 | to << 8 | 0x80
        session = bus << 32 | bits_of | int(t.src[row])
        cause = BEHEADED if headless.hold(session, past, t.frames(row)[0], missing) else ""
    if rule == GAP:
        values |= {"lost": lost, "cause": cause}
    elif rule == COPIED:
        values["milliseconds"] = int(t.gap[row]) / MILLISECOND
    return Breach(
        rule, "note" if rule == GAP and (late or early) else None, late, at, int(t.code[row]),
        (kind, int(t.type_id[row]), to), transfer_id, before, t.frames(row), values, past, early, cause,
    )  # fmt: skip


def _explains(cause: Occurrence, one: Breach) -> bool:
    """Two devices explain every breach of a node, a shared counter those of its messages that are no copies."""
    return cause.rule == "BUS-010" or (one.of_message and one.rule != COPIED)


def _restarts(held: list[Breach]) -> Iterator[Breach]:
    """The breaches, with restarts told from what looks like one: a restarted node begins all its sessions anew.

    A session that was at 0 by chance did not stand still then, and one that comes to 0 alone, with few left out, has
    lost those.
    """
    anew = [one for one in held if one.rule == RESTARTED]
    known = {one.session for one in anew}
    for one in held:
        others = any(abs(one.t - other.t) <= QUIET and other.session != one.session for other in anew)
        if one.rule == RESTARTED and not others and 0 < -one.values["expected"] % IDS <= FEW:
            lost = {"lost": -one.values["expected"] % IDS, "cause": one.cause}
            yield one._replace(rule=GAP, values={**one.values, **lost}, severity="note" if one.early else None)
        elif one.rule == REPEATED and not one.transfer_id and one.session not in known:
            known.add(one.session)
            yield one._replace(rule=RESTARTED) if others else one
        else:
            yield one


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
