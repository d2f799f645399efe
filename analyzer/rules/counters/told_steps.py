"""Steps that nothing explains, told together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.decode.sent import cells
from analyzer.rules.counters.id_steps import (
    ASTRAY,
    COPIED,
    EARLY,
    IS_COPY,
    IS_GAP,
    LATE,
    RULES,
    WITHOUT_START,
)
from analyzer.rules.transfers.lists import picked
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import MILLISECOND, Occurrences, by_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer._native import _IdTold
    from dissectors.kit import Array

REORDERED = "transfers in another order"
_MOVED, _NOTED = 8, 16  # further bits of a step's marks: only the order changed, and that proves little


class ToldSteps(NamedTuple):
    """Steps, a row each, node by node. `rule` is a place in `RULES`, `gap` the time since the transfer before in ns.

    The frames of row `k` are `numbers[begins[k] : begins[k + 1]]`.
    """

    bus: Array
    node: Array
    rule: Array
    marks: Array
    t: Array
    since: Array
    gap: Array
    code: Array
    transfer_id: Array
    before: Array
    begins: Array
    numbers: Array

    @classmethod
    def of(cls, told: _IdTold) -> ToldSteps:
        """Return what the core tells."""
        who, when, ids, (begins, numbers) = told
        small = [cells(column, np.uint8) for column in (*who, *ids)]
        wide = [cells(column, np.int64) for column in (*when, begins)]
        return cls._make((*small[:4], *wide[:4], *small[4:], wide[4], cells(numbers, np.uint64)))

    def occurrences(self, first: int = 0) -> Iterator[Occurrences]:
        """Yield those together that have the same rule and severity and say the same, in the order in which these come.

        Steps before the frame `first` come apart: lost frames that explain them are known, and their own soon gone.
        """
        if not len(self.t):
            return
        gap, moved = self.rule == IS_GAP, self.marks & _MOVED != 0
        noted = np.where(moved, self.marks & _NOTED, gap * (self.marks & (LATE | EARLY))) != 0
        apart = np.where(moved, IS_GAP, self.rule) * 8 + moved * 4 + noted * 2 + (gap & (self.marks & ASTRAY != 0))
        order, begins = by_key(apart * 2 + (self.numbers[self.begins[:-1]] < first))
        ours, apart = self._take(order), apart[order]
        lead = ours.numbers[ours.begins[:-1]].astype(np.int64)
        ends = [*begins.tolist(), len(order)]
        for _, begin, end in sorted(zip(order[begins].tolist(), ends, ends[1:], strict=False)):
            yield ours.together(slice(begin, end), lead, apart.item(begin))

    def together(self, rows: slice, lead: Array, apart: int) -> Occurrences:
        """Return rows that are told together; `lead` are the first frames of all."""
        begin, rule = rows.start, RULES[apart >> 3]
        return Occurrences(
            rule=rule,
            t=self.t[rows],
            bus=self.bus[rows],
            node=self.node[rows],
            type=self.code[rows],
            frame=lead[rows],
            values=lambda k: self.values(begin + k),
            frames=lambda k: self.frames(begin + k),
            severity="note" if apart & 2 else None,
            drops=rule != COPIED,
            since=self.since[rows],
        )

    def _take(self, rows: Array) -> ToldSteps:
        """Return them in another order, with no other frames than theirs; nodes are i64 then."""
        begins, places = picked(self.begins, rows)
        columns = (column[rows] for column in self[:-2])
        found = ToldSteps._make((*columns, begins, self.numbers[places]))
        return found._replace(bus=found.bus.astype(np.int64), node=found.node.astype(np.int64))

    def frames(self, k: int) -> Sequence[int]:
        """Return the numbers of all frames of one."""
        found: list[int] = self.numbers[self.begins.item(k) : self.begins.item(k + 1)].tolist()
        return found

    def values(self, k: int) -> dict[str, Any]:
        """Return what the text of one says."""
        rule, marks, transfer_id = self.rule.item(k), self.marks.item(k), self.transfer_id.item(k)
        expected = (self.before.item(k) + 1) % TRANSFER_IDS
        found: dict[str, Any] = {"transfer_id": transfer_id, "expected": expected}
        if rule == IS_GAP:
            cause = WITHOUT_START if marks & ASTRAY else ""
            found |= {"lost": (transfer_id - expected) % TRANSFER_IDS, "cause": cause}
        elif rule == IS_COPY:
            found["milliseconds"] = self.gap.item(k) / MILLISECOND
        if marks & _MOVED:
            found |= {"lost": 0, "cause": REORDERED}
        return found
