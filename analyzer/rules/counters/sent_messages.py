"""The messages of a node whose counters break, of one batch, and the uptimes that it states."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from analyzer.rules.counters.id_patterns import SharedCounter
from analyzer.rules.counters.id_steps import LATE, MESSAGE, of_message
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME, groups

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.counters.begun_anew import BegunAnew
    from analyzer.rules.counters.id_patterns import EarlyWraps
    from analyzer.rules.counters.id_window import StepWindow
    from dissectors.kit import Array, TransferTable


class Follower(Protocol):
    """A node that is followed; `held` are steps for which a cause is looked for, the latest one of all at `last`."""

    bus: int
    node: int
    held: list[int]
    last: int
    shared: SharedCounter | None
    wraps: EarlyWraps
    anew: BegunAnew

    @property
    def window(self) -> StepWindow:
        """The steps that are held, and those of the batch."""

    def calm(self) -> None:
        """Give up looking for a cause of what is held."""


class StatedUptimes(NamedTuple):
    """Uptimes that a node states: rows of the transfers, their times, seconds, their transfer IDs."""

    row: Array
    t: Array
    seconds: Array
    transfer_id: Array

    @classmethod
    def none(cls) -> StatedUptimes:
        """Return no uptimes."""
        return cls(*[np.empty(0, np.int64)] * 4)


class MessagesBySender:
    """The messages of a batch by their senders."""

    def __init__(self, transfers: TransferTable) -> None:
        self.transfers = transfers

    @cached_property
    def _rows(self) -> dict[int, Array]:
        t = self.transfers
        rows = np.flatnonzero(t.kind == MESSAGE)
        return {key: rows[mine] for key, mine in groups(t.bus[rows].astype(np.int64) << 8 | t.src[rows])}

    def of(self, bus: int, node: int) -> Array:
        """Return the rows of those that a node sent."""
        return self._rows.get(bus << 8 | node, np.empty(0, np.int64))


class WalkedMessages:
    """The messages of a node in a batch, walked through while a shared counter may show.

    `uptimes` are those in its NodeStatus.
    """

    def __init__(self, sent: MessagesBySender, uptimes: StatedUptimes) -> None:
        self._sent, self._t = sent, sent.transfers
        self._rows: list[int] | None = None
        self._breaks: list[int] = []  # places of messages that do not count on
        self._at = 0
        self._uptimes = uptimes
        self._stated: list[int] = uptimes.row.tolist()
        self._told = 0  # of these

    def tell(self, node: Follower, row: int) -> None:
        """Tell the uptimes before a row."""
        begin = self._told
        self._told = end = bisect_left(self._stated, row, begin)
        if begin == end:
            return
        stated = [column[begin:end].tolist() for column in self._uptimes[1:]]
        late = next((k for k, t in enumerate(stated[0]) if t - node.last > LATE), None) if node.held else None
        if late is not None:
            _state(node, [column[:late] for column in stated])
            node.calm()
        _state(node, [column[late:] for column in stated])

    def until_silence(self, node: Follower, begin: int, end: int) -> int:
        """Return the step up to which no uptime is told long after a step."""
        steps = node.window.steps
        row, t, _, _ = (column[self._told :] for column in self._uptimes)
        if not len(row):
            return end
        behind = begin + np.searchsorted(steps.row[begin:end], row)
        last = np.maximum.accumulate(np.append(node.last, steps.t[begin:end]))[behind - begin]
        late = (last == NO_TIME) | (t - np.where(last == NO_TIME, 0, last) > LATE)
        late &= (t != NO_TIME) & (behind < end)
        return int(behind[late.argmax()]) if late.any() else end

    def begin(self, node: Follower, row: int) -> None:
        """Start with the message of a row."""
        self._at = bisect_left(self._of(node), row)
        self.run(node, row)

    def begin_latest(self, node: Follower, begin: int, end: int) -> None:
        """Follow all messages up to the last of some steps, from the first step on behind which all count on."""
        steps, rows = node.window.steps, self._of(node)
        last = steps.row.item(end - 1)
        until = bisect_right(rows, last)
        at = bisect_left(self._breaks, until) - 1
        broken = self._breaks[at] if at >= 0 else 0
        if node.shared is not None:
            wanted = self._t.transfer_id.item(rows[self._at]) if self._at < until else None
            misfit = wanted is not None and (wanted - 1) % TRANSFER_IDS != node.shared.last
            if not misfit and broken <= self._at:
                self.run(node, last)
                return
            broken = max(broken, self._at)
        node.shared = None
        if rows:
            begin += int(np.searchsorted(steps.row[begin:end], rows[broken]))
            ours = np.flatnonzero(of_message(steps.place[begin:end]))
            if len(ours):
                first = begin + int(ours[0])
                node.shared = SharedCounter(steps.t.item(first))
                self.begin(node, steps.row.item(first))
                self.run(node, last)

    def columns(self, node: Follower) -> tuple[Array, Array, Array]:
        """Return the rows of the messages, their types and their transfer IDs."""
        rows = np.array(self._of(node), np.int64)
        return rows, self._t.code[rows], self._t.transfer_id[rows].astype(np.int64)

    def run(self, node: Follower, row: int) -> None:
        """Follow all messages up to and with that of a row, until one does not fit."""
        if node.shared is None:
            return
        t, shared, rows = self._t, node.shared, self._of(node)
        while self._at < len(rows) and rows[self._at] <= row:
            here = rows[self._at]
            frames = t.frames(here) if shared.wants_frames() else None
            if not shared.fits(t.code.item(here), t.transfer_id.item(here), t.step.item(here), frames):
                node.shared = None
                return
            self._at += 1

    def _of(self, node: Follower) -> list[int]:
        if self._rows is None:
            rows = self._sent.of(node.bus, node.node)
            ids = self._t.transfer_id[rows].astype(np.int64)
            self._rows = rows.tolist()
            self._breaks = (np.flatnonzero((ids[1:] - ids[:-1]) % TRANSFER_IDS != 1) + 1).tolist()
        return self._rows


def _state(node: Follower, stated: Sequence[Sequence[int]]) -> None:
    """Tell a node's uptimes: times, seconds and transfer IDs."""
    t, seconds, transfer_id = stated
    node.wraps.status(t, seconds)
    node.anew.uptimes.add(t, seconds, transfer_id)
