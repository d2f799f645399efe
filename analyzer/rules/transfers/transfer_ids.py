"""Transfer IDs that do not count up by 1: gaps, repetitions, restarts, shared counters, several senders in a session.

The core measures each step, so a session without steps costs nothing. A node whose counter breaks is followed:
what it breaks is held back until it is clear whether one counter for all types (TRF-020), several devices (BUS-010) or
a counter that always wraps early explain it. All show in a few transfers; else everything is reported after 2.0 s
without another id_step, and transfers that only changed places are one breach.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.counters.id_node import IdNode
from analyzer.rules.counters.id_steps import LATE, id_steps, odd_rows
from analyzer.rules.counters.orphan_frames import OrphanFrames
from analyzer.rules.counters.sent_messages import MessagesBySender, StatedUptimes, WalkedMessages
from dissectors.kit import NO_TIME, Rule, groups

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.counters.id_steps import IdSteps
    from dissectors.kit import Occurrence, Occurrences, TransferTable, View


class TransferIds(Rule):
    """Steps of transfer IDs, and what explains them. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, int], IdNode] = {}
        self._orphans = OrphanFrames()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield breaches that are explained, or that nothing explains."""
        self._orphans.feed(view)
        t = view.transfers
        steps = _by_node(id_steps(view, odd_rows(t), self._orphans), t)
        uptimes, none, messages = _uptimes(view), StatedUptimes.none(), MessagesBySender(t)
        others = (key for key, node in self._nodes.items() if node.shared is not None)
        for key in dict.fromkeys((*steps, *uptimes, *others)):
            node = self._nodes.setdefault(key, IdNode(*key))
            sent = WalkedMessages(messages, uptimes.get(key, none))
            if key in steps:
                yield from node.feed(steps[key], view, sent)
            sent.run(node, len(t))
            sent.tell(node, len(t))
        for node in self._nodes.values():
            if node.held and view.end != NO_TIME and view.end - node.last > LATE:
                node.calm()
            yield from node.founds()
            node.end_batch()

    def finish(self, _view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what was held back at the end of the capture."""
        for node in self._nodes.values():
            node.calm()
            yield from node.founds()


def _by_node(steps: IdSteps, t: TransferTable) -> dict[tuple[int, int], IdSteps]:
    """Return steps by bus and node, in the order in which these come."""
    if not len(steps.t):
        return {}
    keys = t.bus[steps.row].astype(np.int64) << 8 | t.src[steps.row]
    each = sorted(groups(keys), key=lambda one: int(one[1][0]))
    return {(key >> 8, key & 0xFF): steps.take(rows).compact() for key, rows in each}


def _uptimes(view: View) -> dict[tuple[int, int], StatedUptimes]:
    """Return what every node says, by the row of the transfer."""
    found: dict[tuple[int, int], StatedUptimes] = {}
    t = view.transfers
    table = view.table(NODE_STATUS)
    if table is not None:
        rows = np.flatnonzero(table.trusted)
        node = table.bus[rows].astype(np.int64) << 8 | table.src[rows]
        each = [(int(mine[0]), key, rows[mine]) for key, mine in groups(node)]
        for _, key, mine in sorted(each, key=lambda one: one[0]):
            row = table.row[mine]
            found[key >> 8, key & 0xFF] = StatedUptimes(row, t.t[row], table["uptime_sec"][mine], t.transfer_id[row])
    return found
