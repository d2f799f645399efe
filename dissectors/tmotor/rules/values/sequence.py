"""data_sequence of PUSHSCI and PUSHCAN, by node and type."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Previous, Rule, sender, usable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View

_TYPES = ("PUSHSCI", "PUSHCAN")
_WORD = 1 << 32
_TOP = 1 << 16  # from this far below 2^32 to this far above 0 is a wrap
_IDS = 32
_NEAR = 8  # so far a transfer may come too late
# After this time a transfer ID says nothing of what went before (transfer ID timeout of DroneCAN).
_FORGOTTEN = 2 * SECOND
_NOTHING = -1


class Sequences(Rule):
    """Compares each trusted transfer with the one before it of the same node and type."""

    rules = ("TYP-501", "TYP-502", "TYP-503", "TYP-504")

    def __init__(self) -> None:
        self._before = {name: Previous(_NOTHING, 0, NO_TIME) for name in _TYPES}
        self._payloads: dict[tuple[str, int], bytes] = {}  # the last of each node: at most 127 a bus and type

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Compare each of both types on its own."""
        for name in _TYPES:
            table = view.table(name)
            if table is None:
                continue
            rows = usable(table).nonzero()[0]
            starts, _ = table.lists("data")
            empty = rows[starts[rows] == starts[rows + 1]]
            if empty.size:
                yield view.among_rows("TYP-504", table, empty, _sequence(table["data_sequence"]))
            if rows.size:
                yield from self._compare(view, table, rows)

    def _compare(self, view: View, table: DecodedTable, rows: Array) -> Iterator[Occurrences]:
        node = sender(table, rows)
        value = table["data_sequence"][rows].astype(np.int64)
        identifier = view.transfers.transfer_id[table.row[rows]].astype(np.int64)
        t = table.t[rows]
        (before, before_id, before_t), previous = self._before[table.name].feed(node, value, identifier, t)
        known = before != _NOTHING
        wrapped = (before >= _WORD - _TOP) & (value < _TOP)
        step = value - before + wrapped * _WORD
        timed = (t != NO_TIME) & (before_t != NO_TIME)
        pause = np.where(timed, t - np.where(timed, before_t, 0), 0)
        sent = (identifier - before_id) % _IDS
        gap = (known & (step > 1) & ~_is_explained(step, sent, pause)).nonzero()[0]
        if gap.size:
            expected = (before[gap] + np.maximum(sent[gap], 1)) % _WORD
            found = {int(row): int(at) for row, at in zip(rows[gap], expected, strict=True)}
            yield view.among_rows(
                "TYP-501", table, rows[gap],
                lambda row: {"expected": found[row], "value": int(table["data_sequence"][row])}, drops=True,
            )  # fmt: skip
        yield from self._find_repeats(view, table, rows, node, (known & (step == 0)).nonzero()[0], previous)
        back = (known & (step < 0)).nonzero()[0]
        back = back[~_is_overtaken(step[back], sent[back], value[back])]
        if back.size:
            earlier = {int(row): int(at) for row, at in zip(rows[back], before[back], strict=True)}
            yield view.among_rows(
                "TYP-503", table, rows[back],
                lambda row: {"before": earlier[row], "value": int(table["data_sequence"][row])},
            )  # fmt: skip

    def _find_repeats(
        self, view: View, table: DecodedTable, rows: Array, node: Array, again: Array, previous: Array
    ) -> Iterator[Occurrences]:
        """Split repetitions by whether the data is the same, and remember the last payload of each node."""
        payload = view.transfers.payload
        same = np.zeros(len(again), bool)
        for k, at in enumerate(again.tolist()):
            here = payload(int(table.row[rows[at]]))
            row = int(previous[at])
            there = self._payloads[table.name, int(node[at])] if row < 0 else payload(int(table.row[rows[row]]))
            same[k] = here == there
        last = np.full(int(node.max()) + 1, -1)
        last[node] = np.arange(len(node))
        for code in (last >= 0).nonzero()[0].tolist():
            self._payloads[table.name, code] = payload(int(table.row[rows[last[code]]]))
        for mine, data, severity in ((again[~same], "other", None), (again[same], "the same", "note")):
            if mine.size:

                def values_of(row: int, data: str = data) -> Values:
                    return {"value": int(table["data_sequence"][row]), "data": data}

                yield view.among_rows("TYP-502", table, rows[mine], values_of, severity=severity)


def _sequence(column: Array) -> Callable[[int], Values]:
    return lambda row: {"data_sequence": int(column[row])}


def _is_explained(step: Array, sent: Array, pause: Array) -> Array:
    """Return the gaps that transfers account for which were sent but did not arrive whole.

    Transfer IDs show up to 31; after a pause that outlasts them any number that fits them.
    """
    explained: Array = (step <= sent) | ((pause > _FORGOTTEN) & (step % _IDS == sent))
    return explained


def _is_overtaken(step: Array, sent: Array, value: Array) -> Array:
    """Return steps back of transfers that go as far back themselves: others came first that were sent later.

    A sender that begins anew does so with a number of 0 or 1.
    """
    overtaken: Array = (step >= -_NEAR) & (sent == step + _IDS) & (value > 1)
    return overtaken
