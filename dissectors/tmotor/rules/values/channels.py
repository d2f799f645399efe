"""RawCommand: as many channels as there are ESCs (4.4.1 expl. 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule, all_resumed, count_below, usable
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View

_INDEXES = 32  # esc_index has 5 bits


class ChannelCount(Rule):
    """Channels against the indexes that ESCs reported in the time before (4.4.1 expl. 3).

    Nothing is said until that time has passed since the first report on a bus, and since a gap in the capture: until
    then ESCs may be missing.
    """

    rules = ("TYP-103",)

    def __init__(self) -> None:
        self._last = np.full((256, _INDEXES), NO_TIME)  # by bus and index
        self._first = np.full(256, NO_TIME)

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Judge the commands of this batch; a report counts for those that ended after it."""
        window = round(view.number("TYP-103", "window_s") * SECOND)
        commands, reports = view.table("RawCommand"), view.table("ESCStatus")
        asked = np.empty(0, np.int64) if commands is None else (usable(commands) & _has_time(commands)).nonzero()[0]
        reported = np.empty(0, np.int64) if reports is None else (usable(reports) & _has_time(reports)).nonzero()[0]
        for bus in range(len(view.buses)):
            mine = asked if commands is None else asked[commands.bus[asked] == bus]
            heard = reported if reports is None else reported[reports.bus[reported] == bus]
            wrong, highest = self._judge(bus, commands, mine, reports, heard, window)
            if commands is not None and wrong.size:
                known = commands.t[wrong] - all_resumed(view, commands.t[wrong]) >= window
                wrong, highest = wrong[known], highest[known]
            if commands is not None and wrong.size:
                yield _miscount(view, commands, wrong, highest)

    def _judge(
        self,
        bus: int,
        commands: DecodedTable | None,
        mine: Array,
        reports: DecodedTable | None,
        heard: Array,
        window: int,
    ) -> tuple[Array, Array]:
        """Return rows of commands with a wrong number of channels, and the highest index at each; note the reports."""
        highest = np.full(len(mine), -1)
        settled = np.zeros(len(mine), bool)
        number = t = at = indexes = np.empty(0, np.int64)
        if commands is not None:
            number, t = commands["transfer"][mine], commands.t[mine]
        if reports is not None and heard.size:
            at, indexes = reports.t[heard], reports["esc_index"][heard]
            if self._first[bus] == NO_TIME:
                self._first[bus] = at[0]
        if self._first[bus] != NO_TIME:
            settled = t - self._first[bus] >= window
        spoken = np.bincount(indexes, minlength=_INDEXES)
        final = np.zeros(len(spoken), np.int64)
        final[indexes] = np.arange(len(indexes))  # of each index the last one
        for index in ((spoken > 0) | (self._last[bus] != NO_TIME)).nonzero()[0][::-1].tolist():
            latest = last = self._last[bus, index]
            todo = (highest < 0).nonzero()[0]
            if not len(todo):
                self._last[bus, index] = at[final[index]] if spoken[index] else last
                continue
            if reports is not None and spoken[index]:
                here = indexes == index
                times = np.append(last, at[here])
                self._last[bus, index] = times[-1]
                latest = times[count_below(reports["transfer"][heard[here]], number[todo])]
            live = (latest != NO_TIME) & (t[todo] - latest <= window)
            highest[todo[live]] = index
        if commands is None:
            return mine, highest
        starts, _ = commands.lists("cmd")
        wrong = settled & (highest >= 0) & (np.diff(starts)[mine] != highest + 1)
        return mine[wrong], highest[wrong]


def _has_time(table: DecodedTable) -> Array:
    timed: Array = table.t != NO_TIME
    return timed


def _miscount(view: View, commands: DecodedTable, rows: Array, highest: Array) -> Occurrences:
    starts, _ = commands.lists("cmd")
    channels = np.diff(starts)
    found = view.among_rows("TYP-103", commands, rows, lambda _row: {}, key=channels[rows])
    return replace(found, values=lambda k: {"channels": int(channels[rows[k]]), "highest_index": int(highest[k])})
