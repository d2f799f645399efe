"""CAN throttle for ESCs that say they take PWM first (4.2, 4.4.2 no 21)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, Rule, breach
from dissectors.records import dataclass
from dissectors.tmotor.rules.joined.driven import CAN, PWM, priorities
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, FirstReports, commands

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrence, View


@dataclass(slots=True)
class _Esc:
    """The last words of a node: its priority, since which transfer, and whether throttle for it was told since."""

    priority: int
    since: int
    told: bool = False


class PwmFirst(Rule):
    """Finds the first throttle above zero for each ESC since it said that PWM comes first."""

    rules = ("BUS-041",)

    def __init__(self) -> None:
        self._escs: dict[tuple[int, int], _Esc] = {}
        self._first = FirstReports()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look at commands between one thing said and the next."""
        self._first.feed(view)
        for transfer, bus, node, priority, t in priorities(view):
            known = self._escs.get((bus, node))
            if priority > CAN or t == NO_TIME or (known is not None and known.priority == priority):
                continue
            if known is not None:
                yield from self._throttle(view, (bus, node), known, transfer)
            if known is not None or len(self._escs) < MOST_UNITS:
                self._escs[bus, node] = _Esc(priority, transfer)
        for who, esc in self._escs.items():
            yield from self._throttle(view, who, esc, 1 << 62)

    def _throttle(self, view: View, who: tuple[int, int], esc: _Esc, until: int) -> Iterator[Occurrence]:
        sent, (first, index) = commands(view).get(who[0]), self._first.of(*who) or (0, -1)
        if esc.told or esc.priority != PWM or sent is None or not 0 <= index < len(sent.cmd):
            return
        since = max(esc.since, first)
        rows = np.flatnonzero((sent.cmd[index] > 0) & (sent.number > since) & (sent.number < until))
        if len(rows):
            esc.told = True
            values = {"channel": index + 1, "esc": who[1], "value": int(sent.cmd[index, rows[0]])}
            yield breach(view, sent.table, int(sent.rows[rows[0]]), "BUS-041", values)
