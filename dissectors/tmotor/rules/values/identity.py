"""UUIDs of ParamGet: one device each, and always the same (4.4.2 no 2-5, 4.2.1)."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, NODES, SECOND, Rule, breach, sender, usable
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, View

_STATUS = "uavcan.protocol.NodeStatus"
_MOST_DEVICES = 4096
_MOST_CLAIMS = 256
_STATE = 6  # numbers of a NodeStatus


@dataclass(slots=True)
class _Known:
    """The owner of a UUID, or the UUID of a place, and when that was last reported."""

    what: int
    t: int


@dataclass(slots=True)
class _Claim:
    """A breach unless `node`, which was known since `since`, restarted or fell silent before transfer `number`.

    A `silent` node did not send anything since then.
    """

    breach: Occurrence
    node: int
    since: int
    number: int
    known: _Known
    instead: int
    silent: bool


class Identity(Rule):
    """Holds a contradiction back until the next NodeStatus of the node that had the UUID denies a restart."""

    rules = ("TYP-403",)

    def __init__(self) -> None:
        self._owners: dict[tuple[int, int], _Known] = {}  # by bus and UUID
        self._places: dict[tuple[int, int, int], _Known] = {}  # by bus, node and index
        self._claims: list[_Claim] = []
        self._uptimes = np.zeros(NODES, np.int64)  # the last of each node, in seconds

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Follow reports and states of nodes, in order."""
        reports, states = view.table("ParamGet"), view.table(_STATUS)
        waiting = deque(() if reports is None else _rows(reports, usable(reports), "esc_uuid", "esc_index"))
        since = 0
        while waiting and reports is not None and not self._claims:
            since = waiting[0][0]
            yield from self._report(view, reports, waiting.popleft())
        rest: list[tuple[int, ...]] = []
        if states is not None:
            good = usable(states)
            later = good & (states["transfer"] >= since) & bool(self._claims)
            plain = (good & ~later).nonzero()[0]  # while no claim waits, a NodeStatus only says the uptime
            self._uptimes[sender(states, plain)] = states["uptime_sec"][plain]
            rest = _rows(states, later, "uptime_sec")
        for row in sorted((*waiting, *rest)):
            if len(row) == _STATE:
                yield from self._state(row)
            elif reports is not None:
                yield from self._report(view, reports, row)
        self._listen(view)

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield what no NodeStatus decided any more."""
        for claim in self._claims:
            if not claim.silent:
                yield claim.breach

    def _report(self, view: View, table: DecodedTable, what: tuple[int, ...]) -> Iterator[Occurrence]:
        number, row, bus, node, t, uuid, index = what
        if len(self._owners) >= _MOST_DEVICES or len(self._places) >= _MOST_DEVICES:
            self._owners.clear()
            self._places.clear()
        owner = self._owners.setdefault((bus, uuid), _Known(node, t))
        place = self._places.setdefault((bus, node, index), _Known(uuid, t))
        if owner.what != node:
            why, known, instead, watched = f"nodes {owner.what} and {node}", owner, node, owner.what
        elif place.what != uuid:
            why, known, instead, watched = f"index {index} had {place.what:08X} before", place, uuid, node
        else:
            owner.t = place.t = t
            return
        found = breach(view, table, row, "TYP-403", {"uuid": uuid, "what": why}, held=True)
        if len(self._claims) >= _MOST_CLAIMS:
            yield self._claims.pop(0).breach
        self._claims.append(_Claim(found, watched, known.t, number, known, instead, silent=watched != node))

    def _state(self, what: tuple[int, ...]) -> Iterator[Occurrence]:
        """Decide the claims that wait for the node of a NodeStatus."""
        _, _, bus, node, t, uptime = what
        code = bus << 7 | node
        fell = uptime < self._uptimes[code]
        self._uptimes[code] = uptime
        waiting = [claim for claim in self._claims if (claim.breach.bus, claim.node) == (bus, node)]
        if not waiting:
            return
        self._claims = [claim for claim in self._claims if (claim.breach.bus, claim.node) != (bus, node)]
        start = NO_TIME if t == NO_TIME else t - (uptime + 1) * SECOND
        for claim in waiting:
            if fell or start > claim.since:
                claim.known.what, claim.known.t = claim.instead, claim.breach.t
            else:
                yield claim.breach

    def _listen(self, view: View) -> None:
        """Note which of the nodes that claims wait for go on sending."""
        transfers = view.transfers
        for claim in self._claims:
            if claim.silent:
                later = slice(max(claim.number + 1 - transfers.first, 0), None)
                heard = (transfers.src[later] == claim.node) & (transfers.bus[later] == claim.breach.bus)
                claim.silent = not heard.any()


def _rows(table: DecodedTable, good: Array, *names: str) -> list[tuple[int, ...]]:
    """Return number of the transfer, row, bus, node, time and some columns of each good row."""
    rows = good.nonzero()[0]
    columns = table["transfer"], table.bus, table.src, table.t, *(table[name] for name in names)
    number, *others = (column[rows].tolist() for column in columns)
    return list(zip(number, rows.tolist(), *others, strict=True))
