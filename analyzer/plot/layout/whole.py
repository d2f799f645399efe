"""The layout of a recording: an overview of all devices, a tab for each, the bus, commands, and all the rest.

Only what the recording contains has a place, and everything in it has one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import rerun.blueprint as rrb

from analyzer.plot.broken import BROKEN
from analyzer.plot.bus import LOAD, RATE
from analyzer.plot.findings import FINDINGS
from analyzer.plot.happened import EVENTS
from analyzer.plot.layout import views
from analyzer.plot.layout.tables import MESSAGES, tables
from analyzer.plot.moments import FRAME, SINCE_START

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.plot.inventory import Inventory, Series
    from analyzer.plot.moments import PlotClock
    from dissectors.picture import Pictures

    Parts = Sequence[rrb.View | rrb.Container]

NODE, BUS, SUMMARY = "node", "bus", "summary"
_OF_BUS = {
    LOAD: ("Bus load", (0.0, 100.0)),
    RATE: ("Frame rate", None),
    BROKEN: ("Broken transfers, by sender", None),
}
_MOST_ROWS = 5  # of plots beside states
_MOST_BESIDE = 3  # rows of plots in an overview with states
_MOST_TABS = 8  # devices that have tabs beside the overview; more have theirs inside of one


def layout(inventory: Inventory, pictures: Pictures, clock: PlotClock) -> rrb.Blueprint:
    """Lay out where everything is shown; `clock` knows the timelines."""
    found = _Sorted(inventory, pictures)
    tabs: Parts = [*_devices(found), *_bus(found), *_commands(found), *_messages(found), *_summary(found)]
    body: rrb.Container = rrb.Tabs(contents=tabs, active_tab=0) if tabs else rrb.Tabs()
    if logs := [*_findings(found), *_happened(found)]:
        body = rrb.Vertical(contents=[body, rrb.Tabs(contents=logs, active_tab=0)], row_shares=[5, 1])
    return views.Blueprint(
        body,
        rrb.TimePanel(
            state="collapsed", timeline=FRAME if clock.start is None else SINCE_START, play_state="paused"
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )  # fmt: skip


class _Sorted:
    """Series by what they tell of: kinds of devices, commands, the bus, tables."""

    def __init__(self, inventory: Inventory, pictures: Pictures) -> None:
        self.series = list(inventory.series.values())
        self.pictures = pictures
        plots = pictures.plots.values()
        self.titles = {plot.who.path: plot.who.title for plot in plots}
        self.intervals = {interval.quantity for plot in plots for interval in plot.intervals}

    def kinds(self) -> list[str]:
        """Return kinds of devices, those that say most first."""
        counts: dict[str, int] = {}
        for one in self.series:
            if one.owner not in {NODE, BUS, MESSAGES, SUMMARY, FINDINGS, EVENTS}:
                counts[one.owner] = counts.get(one.owner, 0) + one.count
        return sorted(counts, key=lambda owner: -counts[owner])

    def plots(self, series: Iterable[Series], wanted: Callable[[Series], bool]) -> Iterator[tuple[str, list[Series]]]:
        """Give the lines that are wanted by the title of their quantity, in the order of the quantities."""
        found: dict[str, list[Series]] = {}
        for one in series:
            if one.kind in {"line", "points"} and wanted(one):
                found.setdefault(one.quantity, []).append(one)
        for name, quantity in self.pictures.quantities.items():
            if name in found:
                yield quantity.title, found[name]


def _devices(found: _Sorted) -> Iterator[rrb.Container]:
    """Lay out the overview and the devices of the first kind; a tab for each other kind, with the same inside."""
    for place, kind in enumerate(found.kinds()):
        own = [one for one in found.series if one.owner == kind]
        title = found.titles.get(kind, kind)
        each = list(_each(found, own, title))
        if each and len({one.unit for one in own}) == 1:
            yield from each
        elif place:
            tabs = [*_overview(found, own, f"All {title}s"), *each]
            yield rrb.Tabs(contents=tabs, active_tab=0, name=f"{_capital(title)}s")
        else:
            yield from _overview(found, own, "Overview")
            if len(each) > _MOST_TABS:
                each = [rrb.Tabs(contents=each, active_tab=0, name=f"{title}s")]
            yield from each


def _overview(found: _Sorted, own: Sequence[Series], name: str) -> Iterator[rrb.Container]:
    """Lay out a plot a quantity with all devices, and beside them the states that are not just off, from top to bottom.

    States have as much room as they have lanes: those of all devices are to be seen.
    """
    details = {name for name, quantity in found.pictures.quantities.items() if quantity.detail}
    parts: list[rrb.View | rrb.Container] = []
    plots = list(found.plots(own, lambda one: one.quantity not in details))
    unmarked = (title for title, series in plots if all(one.kind == "line" for one in series))
    named = next(unmarked, plots[0][0] if plots else "")  # a legend names marks, too, and there is little room
    parts += [views.plot(title, series, legend=title == named) for title, series in plots]
    states, lanes = _states(shown := [one for one in own if one.active]), _lanes(shown)
    if states and parts:
        beside = rrb.Vertical(contents=states, row_shares=[1 + count for count in lanes])
        yield rrb.Horizontal(
            contents=[views.rows(parts, _MOST_BESIDE), beside],
            column_shares=[3, 1],
            name=name,
        )
    elif states or parts:
        yield views.grid([*parts, *states], name, first=True)


def _each(found: _Sorted, own: Sequence[Series], title: str) -> Iterator[rrb.Container]:
    """Lay out a tab a device that reports something: its plots, and beside them all of its states."""
    devices: dict[str, list[Series]] = {}
    for one in own:
        devices.setdefault(one.unit, []).append(one)
    for unit, series in sorted(devices.items(), key=lambda pair: (pair[1][0].number, pair[0])):
        if all(one.role == views.COMMANDED for one in series):
            continue
        plots = [views.plot(*one) for one in found.plots(series, lambda _: True)]
        yield _beside(plots, _states(series), _capital(unit) if unit.startswith(title) else unit)


def _states(series: Sequence[Series]) -> list[rrb.View]:
    """Lay out modes and the like, and the flags."""
    return [views.lanes(title, here) for title, here in _kinds_of_states(series)]


def _lanes(series: Sequence[Series]) -> list[int]:
    """Return how many lanes each of these views has."""
    return [len(here) for _, here in _kinds_of_states(series)]


def _kinds_of_states(series: Sequence[Series]) -> Iterator[tuple[str, list[Series]]]:
    for title, flag in (("States", False), ("Status bits", True)):
        here = [one for one in series if one.kind == "state" and one.flag == flag]
        if here:
            yield title, here


def _beside(plots: Parts, states: Parts, name: str) -> rrb.Container:
    """Lay out plots that are wide, and states beside them."""
    parts: Parts = [views.grid(plots, columns=math.ceil(len(plots) / _MOST_ROWS))] if plots else []
    if states:
        parts = [*parts, rrb.Vertical(contents=states, row_shares=[1, 3][: len(states)])]
    return rrb.Horizontal(contents=parts, column_shares=[3, 1][: len(parts)], name=name)


def _bus(found: _Sorted) -> Iterator[rrb.Container]:
    """Lay out how full the bus is, where it broke, and how its nodes are."""
    series = [one for one in found.series if one.owner == BUS]
    plots: list[rrb.View] = []
    for name, (title, span) in _OF_BUS.items():
        here = [one for one in series if one.quantity == name]
        if here:
            plots.append(views.plot(title, here, span=span))
    nodes = [one for one in found.series if one.owner == NODE]
    plots += [views.plot(*one) for one in found.plots(nodes, lambda one: one.quantity not in found.intervals)]
    states = _states(nodes)
    if plots or states:
        yield _beside(plots, states, "Bus")


def _commands(found: _Sorted) -> Iterator[rrb.Container]:
    """Lay out what is commanded and how evenly, and the parameters of devices."""
    commanded = found.plots(found.series, lambda one: one.role == views.COMMANDED)
    plots = [views.plot(f"{title} {views.COMMANDED}", series) for title, series in commanded]
    plots += [views.plot(*one) for one in found.plots(found.series, lambda one: one.quantity in found.intervals)]
    settings = tables(found.series, lambda name: _parameters(found, name))
    commands = rrb.Vertical(contents=plots, name="Commands")
    if plots and settings:
        yield rrb.Tabs(contents=[commands, *settings], active_tab=0, name="Commands and parameters")
    elif plots:
        yield commands
    elif settings:
        yield rrb.Tabs(contents=settings, active_tab=0, name="Parameters")


def _messages(found: _Sorted) -> Iterator[rrb.Container]:
    """Lay out the fields of all other tables."""
    others = tables(found.series, lambda name: not _parameters(found, name))
    if others:
        yield rrb.Tabs(contents=others, active_tab=0, name="Messages")


def _parameters(found: _Sorted, table: str) -> bool:
    plot = found.pictures.plots.get(table)
    return plot is not None and plot.parameters


def _summary(found: _Sorted) -> Iterator[rrb.View]:
    for one in found.series:
        if one.owner == SUMMARY:
            yield views.page("Summary", one)


def _findings(found: _Sorted) -> list[rrb.View]:
    """Lay out what is to be looked at in front of what is good to know."""
    logs = [one for one in found.series if one.owner == FINDINGS]
    notes = [one for one in logs if one.title == "note"]
    others = [one for one in logs if one.title != "note"]
    return [views.log(title, here) for title, here in (("Errors and warnings", others), ("Notes", notes)) if here]


def _happened(found: _Sorted) -> list[rrb.View]:
    """Lay out events in their order, and when the vehicle flew."""
    own = [one for one in found.series if one.owner == EVENTS]
    logs, flights = ([one for one in own if one.kind == kind] for kind in ("text", "state"))
    return [show(title, here) for show, title, here in (
        (views.log, "Events", logs), (views.lanes, "Flights", flights)) if here]  # fmt: skip


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
