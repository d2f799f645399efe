"""Explanations of a jump in the frame counts of packets: transfers lost or broken, and gaps in the capture."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, Latest, groups
from dissectors.tmotor.rules.packets.carried import HEADERS, TYPE_IDS, UNRECOGNIZED, place

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dissectors.kit import Array, DecodedTable, TransferTable, View

_MOST_LOSSES = 1024  # remembered of a session; 256 before a packet are all that its count can tell
_MOST_GAPS = 256
_BROKEN = -1
_NAMES = ("PUSHSCI", "PUSHCAN")
_LEAD = itemgetter(0)


class _Losses(NamedTuple):
    """First frames of transfers of a session, in order, and how many were lost before each."""

    lead: array[int]
    lost: array[int]

    def add(self, lead: Sequence[int], lost: Sequence[int]) -> None:
        """Add some."""
        pairs = sorted(zip(lead, lost, strict=True), key=_LEAD)
        at = bisect_right(self.lead, pairs[0][0])
        if at < len(self.lead):
            pairs = sorted([*zip(self.lead[at:], self.lost[at:], strict=True), *pairs], key=_LEAD)
            del self.lead[at:], self.lost[at:]
        for column, values in zip(self, zip(*pairs, strict=True), strict=True):
            column.extend(values)


class TransferLosses:
    """Transfers that a session lost, by the first frame of the one after them: how many, or `_BROKEN`.

    A broken transfer stands at its own first frame. It comes out when it is given up, which may be long after others
    that began later.
    """

    def __init__(self) -> None:
        self._lost: dict[tuple[str, int], _Losses] = {}

    def feed(self, view: View) -> None:
        """Add what a batch lost: transfer IDs left out, damaged transfers, and packets that cannot be read."""
        t = view.transfers
        rows = ((t.type_id | 1) == TYPE_IDS["PUSHCAN"]).nonzero()[0]  # the other one is 1 below
        rows = rows[t.kind[rows] == 0]
        gone = np.where(t.has("step")[rows], t.step[rows].astype(np.int64) - 1, 0)
        skips, broken = (gone > 0).nonzero()[0], rows[t.status[rows] != 0]
        unread = [rest for name in HEADERS if (rest := view.table(f"{name}.{UNRECOGNIZED}")) is not None]
        if not (len(skips) or len(broken) or unread):
            return
        found = [(rows[skips], gone[skips]), (broken, np.full(len(broken), _BROKEN))]
        found += [(rest.row, np.ones(len(rest.row), np.int64)) for rest in unread]
        rows, lost = (np.concatenate(columns) for columns in zip(*found, strict=True))
        session = (t.bus[rows].astype(np.int64) << 7 | t.src[rows]) << 1 | (t.type_id[rows] == TYPE_IDS["PUSHCAN"])
        for key, mine in groups(session):
            known = self._lost.setdefault((_NAMES[key & 1], key >> 1), _Losses(array("q"), array("q")))
            known.add(t.lead[rows[mine]].tolist(), lost[mine].tolist())

    def forget(self) -> None:
        """Leave out what is older than any packet that is still to be judged."""
        for losses in self._lost.values():
            del losses.lead[:-_MOST_LOSSES], losses.lost[:-_MOST_LOSSES]

    def explain(self, name: str, node: int, between: tuple[int, int], missing: int) -> bool:
        """Return whether so many packets may have been lost after the first of two transfers, up to the second.

        Both are given by their first frames.
        """
        losses = self._lost.get((name, node))
        if losses is None:
            return False
        lost = losses.lost[bisect_right(losses.lead, between[0]) : bisect_right(losses.lead, between[1])]
        return _BROKEN in lost or 0 < missing <= sum(lost)


class CaptureGaps:
    """Gaps in the capture by the number of the first transfer behind each."""

    def __init__(self) -> None:
        self._numbers: list[int] = []
        self._waiting: list[int] = []  # times behind gaps, of which no transfer has come yet
        self._seen = NO_TIME

    def feed(self, view: View) -> None:
        """Add those that a batch shows."""
        if view.end == NO_TIME:
            return
        t, resumed, new = view.transfers, view.resumed(view.end), []
        while resumed > max(self._seen, view.start):
            new.append(resumed)
            resumed = view.resumed(resumed - 1)
        self._waiting += reversed(new)
        self._seen = max(self._seen, *new, NO_TIME)
        while self._waiting and len(behind := (t.t >= self._waiting[0]).nonzero()[0]):
            self._numbers.append(t.first + int(behind[0]))
            del self._waiting[0]
        del self._numbers[:-_MOST_GAPS]

    def between(self, before: int, number: int) -> bool:
        """Return whether a gap lies between two transfers."""
        return bisect_right(self._numbers, before) < bisect_right(self._numbers, number)


class KnownLosses:
    """Where the packet before a place was, in this batch or an earlier one."""

    def __init__(self, transfers: TransferTable, tables: Sequence[DecodedTable], known: Before) -> None:
        self._transfers = transfers
        self._tables = {table.name: (known.key_of(table), place(table)) for table in tables}
        self._known = known
        self._names: dict[str, list[str]] = {}
        self._places: dict[tuple[str, int], Array] = {}

    def names(self, carrier: str) -> list[str]:
        """Return the packet tables of a carrier."""
        if carrier not in self._names:
            every = {*self._tables, *self._known.places}
            self._names[carrier] = sorted(name for name in every if name.startswith(f"{carrier}."))
        return self._names[carrier]

    def before(self, names: Iterable[str], key: int, at: int) -> tuple[int, int]:
        """Return number and first frame of the transfer of a key's latest packet before a place, among some tables."""
        latest, name = max([(self._before(name, key, at), name) for name in names])
        number, first = latest >> 16, self._transfers.first
        return number, self._transfers.lead.item(number - first) if number >= first else self._known.lead(name, key)

    def _before(self, name: str, key: int, at: int) -> int:
        if (name, key) not in self._places:
            keys, places = self._tables.get(name, (np.empty(0), np.empty(0)))
            self._places[name, key] = places[keys == key]
        places = self._places[name, key]
        found = int(places.searchsorted(at)) - 1
        return places.item(found) if found >= 0 else self._known.place(name, key)


class Before:
    """The last packet of each key in each table: its place, and the first frame of its transfer."""

    def __init__(self, key_of: Callable[[DecodedTable], Array]) -> None:
        self.key_of = key_of
        self.places: dict[str, Latest[int]] = {}
        self._leads: dict[str, Latest[int]] = {}

    def beside(self, transfers: TransferTable, tables: Sequence[DecodedTable]) -> KnownLosses:
        """Return what is known with the packets of a batch."""
        return KnownLosses(transfers, tables, self)

    def place(self, name: str, key: int) -> int:
        """Return 0 if there was none, else the last one."""
        return self.places[name].get(key) if name in self.places else 0

    def lead(self, name: str, key: int) -> int:
        """Return 0 if there was none, else the last one."""
        return self._leads[name].get(key) if name in self._leads else 0

    def keep(self, transfers: TransferTable, tables: Iterable[DecodedTable]) -> None:
        """Keep the packets of a batch."""
        for table in tables:
            keys = self.key_of(table)
            low = int(keys.min())
            last = np.full(int(keys.max()) - low + 1, -1)
            last[keys - low] = np.arange(len(keys))  # of a key's rows the last one stays
            held = (last >= 0).nonzero()[0]
            rows, keys = last[held], held + low
            self.places.setdefault(table.name, Latest(0)).feed(keys, place(table)[rows])
            self._leads.setdefault(table.name, Latest(0)).feed(keys, transfers.lead[table.row[rows]])
