"""ESCs whose index is beyond the channels of the commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule
from dissectors.kit.order import spans
from dissectors.tmotor.rules.joined.joins import commands, esc_reports

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import EscReports, RawCommands, ReportingEsc


class NotCommanded(Rule):
    """An ESC whose index is beyond the channels of the commands."""

    rules = ("BUS-026",)

    def __init__(self) -> None:
        self._sent: dict[int, _Sent] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare each report with the commands of the time before it."""
        if view.start == NO_TIME:
            return
        window, reports = round(view.number("BUS-026", "window_s") * SECOND), esc_reports(view)
        now = commands(view)
        if reports is not None:
            for bus, part in reports.by_bus():
                if bus in self._sent or bus in now:
                    sent = self._sent.get(bus) or _Sent(), now.get(bus)
                    yield from _find_uncommanded(view, reports, part, sent, window)
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
    view: View, reports: EscReports, part: slice, commanded: tuple[_Sent, RawCommands | None], window: int
) -> Iterator[Occurrences]:
    """Yield the reports of each ESC of a bus that is beyond the channels for a time."""
    before, sent = commanded
    fewest = min(() if sent is None else (int(sent.counts.min()),), default=32)
    fewest = fewest if before.t == NO_TIME else min(fewest, before.counts)
    index, of, t = reports.column("esc_index")[part], reports.of[part], reports.t[part]
    some = np.flatnonzero(index >= fewest)
    if not len(some):
        return
    index, t = index[some], t[some]
    columns = [np.array([v], np.int64) for v in (before.t, before.since, before.counts)]
    escs, which = np.unique(index, return_inverse=True)
    had = before.with_index[escs][:, None]
    k = np.zeros(len(some), np.int64)
    if sent is not None:
        fresh = (sent.t, _runs(before, sent, window), sent.counts)
        columns = [np.concatenate(pair) for pair in zip(columns, fresh, strict=True)]
        now = np.maximum.accumulate(np.where(sent.counts > escs[:, None], sent.t, had), axis=1)
        had = np.concatenate((had, now), axis=1)
        k = sent.before(reports.table, reports.rows[part][some])
    last, since, counts = (column[k] for column in columns)
    runs = (last != NO_TIME) & (t - np.maximum(last, 0) <= window) & (t - np.maximum(since, 0) >= window)
    had = had[which, k]
    at = np.flatnonzero(runs & ((had == NO_TIME) | (t - np.maximum(had, 0) > window)))
    for esc, begin, end in spans(of[some[at]]):
        rows = reports.rows[part][some[at[begin:end]]]
        yield _found(
            view, reports, reports.escs[esc], dict(zip(rows.tolist(), counts[at[begin:end]].tolist(), strict=True))
        )


def _found(view: View, reports: EscReports, esc: ReportingEsc, channels: dict[int, int]) -> Occurrences:
    """Return what was found in reports of an ESC, of which each has the channels of the command before it."""

    def values(row: int) -> dict[str, int]:
        return {"esc_index": esc.index, "channels": channels[row]}

    return view.among_rows("BUS-026", reports.table, np.array(list(channels), np.int64), values)
