"""Facts of each node that sends: what it is, what it runs, how much was lost or broken.

An accumulator over batches with bounded memory, and its result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.columns import NODES
from analyzer.decode.columns import senders as nodes_of
from analyzer.decode.grouped import grouped
from analyzer.facts.losses import LostTransfers
from analyzer.facts.node_names import NodeNames
from analyzer.facts.node_status import NODE_STATUS
from analyzer.facts.software import Software
from analyzer.facts.traffic import rate, times
from analyzer.tables import KINDS
from dissectors.kit.cells import numbers
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.facts.traffic import Talk, TalkKey
    from dissectors import Registry
    from dissectors.schema import Message

COMMANDS = "commands"  # role of whoever has no other and actuates
_MESSAGE = KINDS.index("message")
_ROUGHLY = 3 * SECOND // 2  # an uptime is whole seconds, and its report comes a little late


@dataclass(frozen=True, slots=True)
class SenderFacts:
    """One node. `hz` are transfers a second, None of few or without times; times in nanoseconds.

    `channels` are people's, from 1. `known` counts the transfers whose type is defined, `lost` those missing by their
    IDs, None where two counters run under one node ID; `restarts` is how often the uptime fell, `uptime` the last one
    in seconds, both None if it tells none. `odd` says in words how it differs from others of its roles.
    """

    bus: str
    node: int
    anonymous: bool
    name: str
    roles: tuple[str, ...]
    channels: tuple[int, ...]
    software: str | None
    types: int
    count: int
    known: int
    hz: float | None
    bad: int
    lost: int | None
    restarts: int | None
    first: int | None
    last: int | None
    odd: tuple[str, ...] = ()
    uptime: int | None = None


class _Uptimes:
    """The last report of each node, by bus and node ID: whether there was one, its seconds, its time if it had one."""

    def __init__(self) -> None:
        self.told, self.timed = np.zeros(NODES, bool), np.zeros(NODES, bool)
        self.seconds, self.t = np.zeros(NODES, np.int64), np.zeros(NODES, np.int64)


class Senders:
    """Adds up batches. Bounds: those of `NodeNames`, and the nodes that there can be."""

    def __init__(self) -> None:
        self.names = NodeNames()
        self.software = Software()
        self._losses = LostTransfers()
        self._uptimes = _Uptimes()
        self._restarts = np.zeros(NODES, np.int64)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self.names.feed(batch.messages)
        self.software.feed(batch.messages)
        self._losses.feed(batch.transfers)
        table = batch.messages.get(NODE_STATUS)
        if table is not None and "uptime_sec" in table.schema.names:  # a folder may have another type of this name
            self._note_uptimes(table)

    def facts(
        self, talks: Mapping[TalkKey, Talk], registry: Registry, buses: Sequence[str], *, timed: bool
    ) -> Iterator[SenderFacts]:
        """Yield the facts of all who send `talks`, by bus and node, not yet compared with each other."""
        nodes: dict[tuple[int, int, bool], list[tuple[Talk, Message | None]]] = {}
        for (bus, src, sent), talk in sorted(talks.items()):
            anonymous = not src and sent[0] != _MESSAGE
            nodes.setdefault((bus, src, anonymous), []).append((talk, registry.message(*sent)))
        for (bus, src, anonymous), sent_ in nodes.items():
            first = min((talk.first for talk, _ in sent_ if talk.first is not None), default=None)
            last = max((talk.last for talk, _ in sent_ if talk.last is not None), default=None)
            count = sum(talk.count for talk, _ in sent_)
            whole = [about for talk, about in sent_ if about is not None and talk.count > talk.bad]
            roles = tuple(dict.fromkeys(about.role for about in whole if about.role))
            channels = set[int]().union(*(talk.channels for talk, _ in sent_))
            at, code = (bus, src), bus << 8 | src
            uptime = self._uptimes.seconds.item(code) if self._uptimes.told[code] and not anonymous else None
            restarts = None if uptime is None else self._restarts.item(code)
            yield SenderFacts(
                bus=buses[bus],
                node=src,
                anonymous=anonymous,
                name="" if anonymous else self.names.all.get(at, ""),
                roles=roles or ((COMMANDS,) if any(about.actuates for about in whole) else ()),
                channels=tuple(sorted(channels)),
                software=None if anonymous else self.software.all.get(at),
                types=len(sent_),
                count=count,
                known=sum(talk.count for talk, about in sent_ if about is not None),
                hz=rate(count, first, last) if timed else None,
                bad=sum(talk.bad for talk, _ in sent_),
                lost=0 if anonymous else self._losses.lost(at, began_anew=restarts != 0),
                restarts=restarts,
                first=first,
                last=last,
                uptime=uptime,
            )

    def _note_uptimes(self, table: pa.RecordBatch) -> None:
        """Count uptimes that fell and can have begun since the report before: an old report again is none."""
        rows = np.flatnonzero(numbers(table.column("trusted")))
        t, timed = (column[rows] for column in times(table))
        node, uptime = nodes_of(table)[rows], numbers(table.column("uptime_sec"))[rows].astype(np.int64)
        order, begins = grouped(node)
        nodes, ends = node[order[begins]], np.append(begins[1:], len(order)) - 1
        t, timed, uptime = t[order], timed[order], uptime[order]
        last = self._uptimes
        earlier = np.append(uptime[:1], uptime[:-1])
        earlier[begins] = np.where(last.told[nodes], last.seconds[nodes], uptime[begins])
        fell = np.flatnonzero(uptime < earlier)
        if len(fell):
            of = np.searchsorted(begins, fell, "right") - 1
            whose, begun = nodes[of], begins[of] == fell
            since = np.where(begun, last.t[whose], t[fell - 1])
            known = np.where(begun, last.timed[whose], timed[fell - 1]) & timed[fell]
            fits = uptime[fell] * SECOND - _ROUGHLY <= t[fell] - since
            np.add.at(self._restarts, whose[fits | ~known], 1)
        last.told[nodes], last.seconds[nodes] = True, uptime[ends]
        last.t[nodes], last.timed[nodes] = t[ends], timed[ends]
