"""ESCs whose index is beyond the channels of the commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule
from dissectors.tmotor.rules.joined.joins import commands, units

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import RawCommands, ReportingEsc


class NotCommanded(Rule):
    """An ESC whose index is beyond the channels of the commands."""

    rules = ("BUS-026",)

    def __init__(self) -> None:
        self._sent: dict[int, _Sent] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare each report with the commands of the time before it."""
        table = view.table("ESCStatus")
        if view.start == NO_TIME:
            return
        window = round(view.number("BUS-026", "window_s") * SECOND)
        now = commands(view)
        for unit, rows in units(view).items():
            sent = self._sent.get(unit.bus)
            if table is None or (sent is None and unit.bus not in now):
                continue
            yield from _find_uncommanded(view, table, (unit, rows), (sent or _Sent(), now.get(unit.bus)), window)
        for bus, fresh in now.items():
            self._sent.setdefault(bus, _Sent()).feed(fresh, window)


class _Sent:
    """The commands of a bus so far: the last one, since when they run, when each index was last commanded."""

    def __init__(self) -> None:
        self.t = self.since = NO_TIME
        self.counts = 0
        self.with_index = np.full(32, NO_TIME)

    def feed(self, sent: RawCommands, window: int) -> None:
        self.since = int(_runs(self, sent, window)[-1])
        most, least = int(sent.counts.max()), int(sent.counts.min())
        for count in {most, int(sent.counts[-1])} if most == least else set(sent.counts.tolist()):
            last = int(sent.t[np.flatnonzero(sent.counts == count)[-1]])
            self.with_index[:count] = np.maximum(self.with_index[:count], last)
        self.t, self.counts = int(sent.t[-1]), int(sent.counts[-1])


def _runs(before: _Sent, sent: RawCommands, window: int) -> Array:
    """Return for each command since when there has been no pause longer than the window."""
    return np.maximum.accumulate(np.where(sent.paused(before.t, window), sent.t, before.since))


def _find_uncommanded(
    view: View,
    table: DecodedTable,
    what: tuple[ReportingEsc, Array],
    commanded: tuple[_Sent, RawCommands | None],
    window: int,
) -> Iterator[Occurrences]:
    (unit, rows), (before, sent) = what, commanded
    if (sent is None or int(sent.counts.min()) > unit.index) and (before.t == NO_TIME or before.counts > unit.index):
        return
    columns = [np.array([v], np.int64) for v in (before.t, before.since, before.counts, before.with_index[unit.index])]
    if sent is not None:
        had = np.maximum.accumulate(np.where(sent.counts > unit.index, sent.t, before.with_index[unit.index]))
        fresh = (sent.t, _runs(before, sent, window), sent.counts, had)
        columns = [np.concatenate(pair) for pair in zip(columns, fresh, strict=True)]
    k = np.zeros(len(rows), np.int64) if sent is None else sent.before(table, rows)
    t = table.t[rows]
    last, since, counts, had = (column[k] for column in columns)
    runs = (last != NO_TIME) & (t - np.maximum(last, 0) <= window) & (t - np.maximum(since, 0) >= window)
    at = np.flatnonzero(runs & ((had == NO_TIME) | (t - np.maximum(had, 0) > window)))
    if len(at):
        shown = dict(zip(rows[at].tolist(), counts[at].tolist(), strict=True))
        yield view.among_rows("BUS-026", table, rows[at], lambda row: {"esc_index": unit.index, "channels": shown[row]})
