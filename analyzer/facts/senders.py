"""Facts of each node that sends: what it is, what it runs, how much was lost or broken.

An accumulator over batches with bounded memory, and its result.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.node_names import NodeNames
from analyzer.facts.node_status import NODE_STATUS
from analyzer.facts.software import Software
from analyzer.facts.traffic import times
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS, distinct
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
_GAP, _TO_ZERO = (1 << TRANSFER_ANOMALIES.index(name) for name in ("transfer id gap", "transfer id restarted"))
_MESSAGE = KINDS.index("message")
_COUNTING = (_MESSAGE, KINDS.index("request"))  # a response has the transfer ID of its request
_BACK = TRANSFER_IDS - 3  # steps from here on are those of transfers that changed places with their neighbours
_ROUGHLY = 3 * SECOND // 2  # an uptime is whole seconds, and its report comes a little late


@dataclass(frozen=True, slots=True)
class SenderFacts:
    """One node. `hz` are transfers a second, None without times; times in nanoseconds; `channels` are people's, from 1.

    `known` counts the transfers whose type is defined, `lost` those missing by their IDs, `restarts` how often the
    uptime fell, None if it tells none. `odd` says in words how it differs from others of its roles.
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
    lost: int
    restarts: int | None
    first: int | None
    last: int | None
    odd: tuple[str, ...] = ()


class Senders:
    """Adds up batches. Bounds: those of `NodeNames`, and the nodes that there can be."""

    def __init__(self) -> None:
        self.names = NodeNames()
        self.software = Software()
        self._lost: Counter[tuple[int, int]] = Counter()
        self._lost_to_zero: Counter[tuple[int, int]] = Counter()  # or its sender began anew
        self._uptimes: dict[int, tuple[int, int | None]] = {}  # seconds and the time of the last report
        self._restarts: Counter[tuple[int, int]] = Counter()

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self.names.feed(batch.messages)
        self.software.feed(batch.messages)
        self._note_losses(batch.transfers)
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
            span = None if first is None or last is None or not timed else last - first
            count = sum(talk.count for talk, _ in sent_)
            whole = [about for talk, about in sent_ if about is not None and talk.count > talk.bad]
            roles = tuple(dict.fromkeys(about.role for about in whole if about.role))
            channels = set[int]().union(*(talk.channels for talk, _ in sent_))
            at = bus, src
            restarts = self._restarts[at] if bus << 8 | src in self._uptimes and not anonymous else None
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
                hz=(count - 1) * SECOND / span if span and count > 1 else None,
                bad=sum(talk.bad for talk, _ in sent_),
                lost=0 if anonymous else max(0, self._lost[at] + (self._lost_to_zero[at] if restarts == 0 else 0)),
                restarts=restarts,
                first=first,
                last=last,
            )

    def _note_losses(self, transfers: pa.RecordBatch) -> None:
        """Count how far transfer IDs ran ahead of the transfers that came.

        What comes in another order runs ahead and falls back by as much.
        """
        anomaly = numbers(transfers.column("anomaly"))
        gaps = anomaly & (_GAP | _TO_ZERO) != 0
        if not gaps.any():
            return
        rows = np.flatnonzero(gaps & np.isin(numbers(transfers.column("kind")), _COUNTING))
        step, bus, src = (numbers(transfers.column(name))[rows].astype(np.int64) for name in ("step", "bus", "src"))
        missing = np.where(step >= _BACK, step - 1 - TRANSFER_IDS, (step - 1) % TRANSFER_IDS)
        to_zero = anomaly[rows] & _TO_ZERO != 0
        for code in distinct(node := bus << 8 | src):
            for lost, of in ((self._lost, ~to_zero), (self._lost_to_zero, to_zero)):
                lost[code >> 8, code & 0xFF] += int(missing[of & (node == code)].sum())

    def _note_uptimes(self, table: pa.RecordBatch) -> None:
        """Count uptimes that fell and can have begun since the report before: an old report again is none."""
        rows = np.flatnonzero(numbers(table.column("trusted")))
        t, timed = (column[rows] for column in times(table))
        bus, src, uptime = (numbers(table.column(name))[rows].astype(np.int64) for name in ("bus", "src", "uptime_sec"))
        node = bus << 8 | src
        for code in distinct(node):
            here = np.flatnonzero(node == code)
            before, since = self._uptimes.get(code, (int(uptime[here[0]]), None))
            earlier = np.concatenate(([before], uptime[here[:-1]]))
            for k in np.flatnonzero(uptime[here] < earlier).tolist():
                row = here[k]
                past = since if not k else int(t[here[k - 1]]) if timed[here[k - 1]] else None
                passed = None if past is None or not timed[row] else int(t[row]) - past
                if passed is None or int(uptime[row]) * SECOND <= passed + _ROUGHLY:
                    self._restarts[code >> 8, code & 0xFF] += 1
            row = here[-1]
            self._uptimes[code] = int(uptime[row]), int(t[row]) if timed[row] else None
