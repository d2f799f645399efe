"""Motors that turn or rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.kit import changes
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, commands, end, esc_reports

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

COMMANDS = -1  # in place of a node: the throttle on a bus


class Changes(NamedTuple):
    """Where motors of a bus begin or cease to turn: transfer numbers, times, whether they turn from then on."""

    number: Array
    t: Array
    turning: Array


class _Told(NamedTuple):
    """A unit, or the commands of a bus: whether it is on at first and at last, and where it is another than before.

    Of these places the first one is always there.
    """

    unit: ReportingEsc
    first: bool
    last: bool
    news: _News


class _News(NamedTuple):
    """Transfer numbers, times of the last frames, and whether a unit is on from then on."""

    number: Array
    t: Array
    on: Array


_known: WeakKeyDictionary[View, list[_Told]] = WeakKeyDictionary()


def _told(view: View) -> list[_Told]:
    """Return what a batch tells of motors; several rules ask."""
    if view not in _known:
        _known[view] = list(_states(view))
    return _known[view]


def _states(view: View) -> Iterator[_Told]:
    reports = esc_reports(view)
    if reports is not None:
        on = reports.column("rpm") != 0
        yield from _all_told(view, reports.table, reports.rows, on, list(zip(reports.escs, reports.parts, strict=True)))
    for bus, sent in commands(view).items():
        on, unit = np.any(sent.cmd > 0, axis=0), ReportingEsc(bus, COMMANDS, 0)
        yield from _all_told(view, sent.table, sent.rows, on, [(unit, slice(len(on)))])


def _all_told(
    view: View, table: DecodedTable, rows: Array, on: Array, parts: list[tuple[ReportingEsc, slice]]
) -> Iterator[_Told]:
    """Yield units whose rows follow each other."""
    begins = np.array([part.start or 0 for _, part in parts])
    changed = changes(on, not on[0])
    at = np.union1d(changed, begins)
    news = _News(table["transfer"][rows[at]].astype(np.int64), end(view, table, rows[at]), on[at])
    first = np.searchsorted(at, begins).tolist()
    last = on[np.append(begins[1:], len(on)) - 1].tolist()
    for (unit, _), start, stop, now in zip(parts, first, [*first[1:], len(at)], last, strict=True):
        yield _Told(unit, news.on.item(start), now, _News(*(column[start:stop] for column in news)))


class Motion:
    """Follows whether motors turn: a throttle is above 0, or an ESC has a speed. The first `MOST_UNITS` count."""

    def __init__(self) -> None:
        self._on: dict[ReportingEsc, bool] = {}
        self._turning: dict[int, int] = {}  # units that are on, by bus

    def known(self, bus: int) -> bool:
        """Return whether anything is known of a bus."""
        return bus in self._turning

    def turning(self, bus: int) -> bool:
        """Return whether motors turn on a bus by now."""
        return self._turning.get(bus, 0) > 0

    def feed(self, view: View) -> dict[int, Changes]:
        """Add the next batch; return its changes by bus."""
        steps: dict[int, list[_News]] = {}
        for told in _told(view):
            self._note(steps, told)
        return {bus: self._changes(bus, parts) for bus, parts in steps.items()}

    def _note(self, steps: dict[int, list[_News]], told: _Told) -> None:
        unit, first, last, news = told
        if unit not in self._on and len(self._on) >= MOST_UNITS:
            return
        self._turning.setdefault(unit.bus, 0)
        skip = self._on.get(unit, False) == first
        self._on[unit] = last
        if len(news.on) > skip:
            steps.setdefault(unit.bus, []).append(_News(*(column[skip:] for column in news)) if skip else news)

    def _changes(self, bus: int, parts: list[_News]) -> Changes:
        number, t, turned_on = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.argsort(number, kind="stable")
        count = self._turning[bus] + np.cumsum(np.where(turned_on[order], 1, -1))
        on = count > 0
        at = changes(on, self._turning[bus] > 0)
        self._turning[bus] = int(count[-1])
        return Changes(number[order][at], t[order][at], on[at])
