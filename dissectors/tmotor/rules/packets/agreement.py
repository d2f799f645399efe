"""PUSH-409: a node's status packets show what its ESCStatus shows (4.4.5, 4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, Occurrences, Rule, doubtful, groups, sound, usable
from dissectors.tmotor.rules.packets.carried import LONGEST

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dissectors.kit import Array, DecodedTable, TransferTable, Values, View

_MOST = 1 << 17  # rows kept of either side; older ones are not compared
# Column of the packet and of ESCStatus, settings for the share and for the least tolerance.
_FIELDS = (
    ("voltage", "voltage", "voltage_pct", "voltage_v"),
    ("speed", "rpm", "speed_pct", "speed_rpm"),
    ("current", "current", "current_pct", "current_a"),
)


class _Origin(NamedTuple):
    """A packet's transfer, in the batch that had it."""

    transfers: TransferTable
    row: int


class _Rows(NamedTuple):
    """Rows of one message or packet: what they are, and a row of numbers for each field.

    `whole` are node, time, number of the transfer, and whether the byte order is not proved: int64.
    """

    whole: Array
    values: Array

    @property
    def node(self) -> Array:
        found: Array = self.whole[0].astype(np.uint16)
        return found

    @property
    def t(self) -> Array:
        found: Array = self.whole[1]
        return found

    @property
    def transfer(self) -> Array:
        found: Array = self.whole[2]
        return found

    @property
    def unsure(self) -> Array:
        found: Array = self.whole[3].astype(bool)
        return found

    def take(self, rows: Array) -> _Rows:
        return _Rows(self.whole.take(rows, axis=1), self.values.take(rows, axis=1))

    def join(self, other: _Rows) -> _Rows:
        return _Rows(*(np.concatenate(pair, axis=1) for pair in zip(self, other, strict=True)))


def _none() -> _Rows:
    return _Rows(np.empty((4, 0), np.int64), np.empty((len(_FIELDS), 0)))


def _timed(table: DecodedTable, good: Array, names: Sequence[str]) -> _Rows:
    """Return good rows of a table that have a time, with some of its columns."""
    rows = (good & (table.t != NO_TIME)).nonzero()[0]
    unsure = doubtful(table, rows)
    whole, values = np.empty((4, len(rows)), np.int64), np.empty((len(names), len(rows)))
    for place, column in enumerate((table.sender, table.t, table["transfer"])):
        whole[place] = column[rows]
    whole[3] = 0 if unsure is None else unsure
    for place, name in enumerate(names):
        values[place] = table[name][rows]
    return _Rows(whole, values)


class StatusAgreement(Rule):
    """Compares each packet with the range of ESCStatus around it, as soon as nothing can come in between any more."""

    rules = ("PUSH-409",)

    def __init__(self) -> None:
        """Begin with nothing to compare."""
        self._status = _none()
        self._packets = _none()
        self._batches: list[TransferTable] = []

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Yield packets long enough ago."""
        self._add(view)
        if view.end != NO_TIME:
            window = self._window(view)
            yield from self._judge(view, view.end - LONGEST - window)
            needed = int(self._packets.t.min(initial=view.end - LONGEST)) - window
            self._status = self._status.take((self._status.t >= needed).nonzero()[0][-_MOST:])

    def finish(self, view: View) -> Iterator[Occurrences]:
        """Yield the last ones."""
        yield from self._judge(view, view.end)

    def _window(self, view: View) -> int:
        return round(view.number("PUSH-409", "window_ms") * MILLISECOND)

    def _add(self, view: View) -> None:
        packets, status = view.table("PUSHCAN.MotorStatus"), view.table("ESCStatus")
        if packets is not None:
            self._packets = self._packets.join(_timed(packets, sound(packets), [name for name, *_ in _FIELDS]))
            self._batches.append(view.transfers.bare)
        if status is not None:
            self._status = self._status.join(_timed(status, usable(status), [name for _, name, *_ in _FIELDS]))

    def _judge(self, view: View, until: int) -> Iterator[Occurrences]:
        """Compare packets up to a time, which are then done."""
        done = self._packets.t <= until
        if not done.any():
            return
        packets = self._packets.take(done.nonzero()[0])
        self._packets = self._packets.take((~done).nonzero()[0][-_MOST:])
        yield from self._compare(view, packets)
        left = self._packets.transfer
        oldest = int(left.min()) if left.size else None
        self._batches = [one for one in self._batches if oldest is not None and one.first + len(one) > oldest]

    def _compare(self, view: View, packets: _Rows) -> Iterator[Occurrences]:
        window = self._window(view)
        status = _by_node(self._status)
        values = self._status.values
        tolerance = self._tolerance(view)
        outside = _outside(packets, (status, values), window, tolerance)
        found: list[list[tuple[int, float]]] = [[] for _ in _FIELDS]
        node = packets.whole[0]
        for k in outside.tolist():
            low, high = _span(status, node.item(k))
            first = low + status.t[low:high].searchsorted(packets.t[k] - window)
            last = low + status.t[low:high].searchsorted(packets.t[k] + window, "right")
            near = values[:, status.order[first:last]]
            for field, (least, most) in enumerate(zip(near.min(axis=1), near.max(axis=1), strict=True)):
                value = packets.values[field, k]
                share, floor = tolerance[field]
                if value < least - max(abs(least) * share, floor):
                    found[field].append((k, float(least)))
                elif value > most + max(abs(most) * share, floor):
                    found[field].append((k, float(most)))
        for field, rows in enumerate(found):
            if rows:
                yield self._found(packets, field, rows)

    def _tolerance(self, view: View) -> list[tuple[float, float]]:
        return [(view.number("PUSH-409", share) / 100, view.number("PUSH-409", floor)) for *_, share, floor in _FIELDS]

    def _found(self, packets: _Rows, field: int, rows: Sequence[tuple[int, float]]) -> Occurrences:
        origins = [self._origin(int(packets.transfer[k])) for k, _ in rows]

        def values(k: int) -> Values:
            at, status = rows[k]
            return {"field": _FIELDS[field][0], "packet": float(packets.values[field, at]), "status": status}

        def column(name: str) -> Array:
            return np.array([getattr(one.transfers, name)[one.row] for one in origins], np.int64)

        return Occurrences(
            rule="PUSH-409", t=column("t"), bus=column("bus"), node=column("src"), type=column("code"),
            frame=column("lead"), values=values, frames=_frames(origins),
            doubtful=packets.unsure[[k for k, _ in rows]],
        )  # fmt: skip

    def _origin(self, transfer: int) -> _Origin:
        batch = next(one for one in self._batches if one.first <= transfer < one.first + len(one))
        return _Origin(batch, transfer - batch.first)


def _frames(origins: Sequence[_Origin]) -> Callable[[int], Sequence[int]]:
    return lambda k: origins[k].transfers.frames(origins[k].row)


class _Ordered(NamedTuple):
    """The order of rows by node, then time, and their nodes and times in it."""

    order: Array
    node: Array
    t: Array


def _by_node(rows: _Rows) -> _Ordered:
    """Sort by node, then time; those of a node come in order unless the clock was set back."""
    nodes = rows.node
    order = np.argsort(nodes, kind="stable")
    node, t = nodes[order], rows.t[order]
    if ((t[1:] < t[:-1]) & (node[1:] == node[:-1])).any():
        order = np.lexsort((rows.t, nodes))
        node, t = nodes[order], rows.t[order]
    return _Ordered(order, node, t)


def _span(rows: _Ordered, node: int) -> tuple[int, int]:
    """Return where the rows of a node begin and end, in the order of nodes."""
    low, high = rows.node.searchsorted(np.array([node, node + 1], rows.node.dtype)).tolist()
    return low, high


def _outside(
    packets: _Rows, reports: tuple[_Ordered, Array], window: int, tolerance: Sequence[tuple[float, float]]
) -> Array:
    """Return packets outside of the range of the ESCStatus just before and just after them, both within the window.

    `reports` are the order of these, and their values. Packets come by node.
    """
    status, values = reports
    mine, after = _between(packets, status)
    t = packets.t[mine]
    close = (status.t[after] - t <= window) & (t - status.t[after - 1] <= window)
    if not close.all():
        mine, after = mine[close], after[close]
    one, other = values[:, status.order[after - 1]], values[:, status.order[after]]
    value = packets.values[:, mine]
    least, most = np.minimum(one, other), np.maximum(one, other)
    share, floor = np.array(tolerance).T[:, :, np.newaxis]
    outside = value < least - np.maximum(np.abs(least) * share, floor)
    outside |= value > most + np.maximum(np.abs(most) * share, floor)
    found: Array = mine[outside.any(axis=0)]
    return found


def _between(packets: _Rows, status: _Ordered) -> tuple[Array, Array]:
    """Return packets, by node, that have an ESCStatus of theirs before and behind them, and the place of the latter."""
    places = [np.empty(0, np.int64)]
    behind = [np.empty(0, np.int64)]
    for node, mine in groups(packets.node):
        low, high = _span(status, node)
        after = status.t[low:high].searchsorted(packets.t[mine])
        both = (after > 0) & (after < high - low)
        places.append(mine[both])
        behind.append(after[both] + low)
    return np.concatenate(places), np.concatenate(behind)
