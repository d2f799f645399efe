"""Flights and their events: a lane, a log beside the plots, and marks on the lines of whom they befell."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.timeline.measured import COMMANDED, COMMANDED_CH
from analyzer.plot.bus import LOAD
from analyzer.plot.chunks import path
from analyzer.plot.inventory import Series
from analyzer.plot.moments import NO_FRAME, Moments
from analyzer.report import wording
from analyzer.tables import raw_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.flight.log import FlightEvent
    from analyzer.plot.canvas import Canvas
    from dissectors.picture import Pictures

    MarkedEvent = tuple[FlightEvent, Mapping[str, float]]  # and what was measured then, by quantity

EVENTS, CALM, FLIGHTS = "events", "calm", "flights"
_CALM = frozenset({"mode", "join", "arming", "message", "parameter", "save"})  # kinds that are no trouble by themselves
_BAD = re.compile(r"\b(error|critical|fault)\b")
_ROLES = frozenset({COMMANDED, "limit"})  # of lines that are nothing a device measured
_Mark = tuple[int, int, float]  # time, frame from 1, value


class HappenedPlots:
    """Draws what is in a span of time; a lane and the log grow as events are told.

    Args:
        canvas: takes the points.
        pictures: which lines belong to whom.
        load: the load of a bus that is drawn at a time, for what befell no device with a line.
    """

    def __init__(self, canvas: Canvas, pictures: Pictures, load: Callable[[int, int], float]) -> None:
        self._canvas, self._load = canvas, load
        plots = pictures.plots.values()
        self._numbered = {plot.who.path for plot in plots if plot.who.column and plot.esc.rpm}
        self._by_node = {plot.who.path for plot in plots if not plot.who.column and not plot.who.elements}

    def events(self, events: Sequence[MarkedEvent], buses: Sequence[str], span: tuple[int, int]) -> None:
        """Draw events, each in the log, and on lines if there are any."""
        inside = [(one, values) for one, values in events if span[0] <= one.first.t <= span[1]]
        for level, calm in (("WARN", False), ("INFO", True)):
            here = [one for one, _ in inside if _is_calm(one) == calm]
            if here:
                series = self._series(
                    Series(path(EVENTS, CALM if calm else "trouble"), "text", EVENTS, level, owner=EVENTS)
                )
                texts = [f"{self._canvas.clock.written(one.first.t)} {_line(one, buses)}" for one in here]
                moments = _moments([(one.first.t, one.first.frame + 1, 0.0) for one in here])
                self._canvas.texts(series, texts, [level] * len(here), moments)
        marks: dict[tuple[str, bool], tuple[Series, list[_Mark]]] = {}
        lines: dict[int, list[Series]] = {}
        for series in self._canvas.inventory.series.values() if inside else ():
            if series.kind == "line":
                lines.setdefault(series.number, []).append(series)
        for one, values in inside:
            for line, value in self._places(one, values, lines, buses):
                mark = one.first.t, one.first.frame + 1 if one.first.frame >= 0 else NO_FRAME, value
                marks.setdefault((line.path, _is_calm(one)), (line, []))[1].append(mark)
        for (_, calm), (line, some) in marks.items():
            series = self._beside(line, calm=calm)
            self._canvas.lines([(series, np.array([value for *_, value in some]), None)], _moments(some))

    def flights(self, flights: pa.Table, span: tuple[int, int]) -> None:
        """Draw when the vehicle flew: a table `FLIGHTS`."""
        states, t, frames = list[str](), list[int](), list[int]()
        for one in raw_rows(flights):
            since, until = one["t"], one["t_end"]
            if since is not None and until is not None and since <= span[1] and until >= span[0]:
                states += [f"flight {one['flight']}", f"{one['end']}"]
                t += [max(since, span[0]), min(until, span[1])]
                frames += [one["frame"] + 1, one["frame_end"] + 1]
        if states:
            series = self._series(Series(path(FLIGHTS), "state", FLIGHTS, "Flights", owner=EVENTS))
            self._canvas.states(series, states, Moments(np.array(t, np.int64), np.array(frames, np.int64)))

    def _series(self, new: Series) -> Series:
        return self._canvas.inventory.series.get(new.path, new)

    def _beside(self, line: Series, *, calm: bool) -> Series:
        """Return the series of marks on a line; those of calm events do not alarm."""
        entity, name = (path(EVENTS, CALM), "calm events") if calm else (path(EVENTS), "events")
        return self._series(Series(
            entity + line.path, "points", line.quantity, f"{line.title} {name}", line.measure, unit=line.unit,
            owner=line.owner, number=line.number, active=not calm,
        ))  # fmt: skip

    def _places(
        self, event: FlightEvent, values: Mapping[str, float], lines: Mapping[int, Sequence[Series]],
        buses: Sequence[str],
    ) -> Iterator[tuple[Series, float]]:  # fmt: skip
        """Yield the lines on which an event is marked, and at which value: those of its device, or of its bus."""
        bus, found = buses[event.bus] if event.bus else "", False
        numbers = {event.ch, event.node, values.get(COMMANDED_CH)} - {None}
        for one in (one for number in sorted(numbers) for one in lines.get(int(number), ())):  # type: ignore[arg-type, type-var]
            if not _on(one, bus):
                continue
            if one.role == COMMANDED and COMMANDED in values and one.number == values.get(COMMANDED_CH):
                found = True
                yield one, values[COMMANDED]
            elif one.quantity in values and one.role not in _ROLES and self._is_of(one, event):
                found = True
                yield one, values[one.quantity]
        if found or event.source != "bus":
            return
        for one in lines.get(event.bus or 0, ()):
            if one.quantity == LOAD:
                yield one, self._load(event.bus or 0, event.first.t)

    def _is_of(self, one: Series, event: FlightEvent) -> bool:
        if one.owner in self._numbered:
            return one.number == event.ch
        return one.owner in self._by_node and one.number == event.node


def _on(one: Series, bus: str) -> bool:
    """Return whether a line is of a bus; those of the first one do not name it."""
    parts = one.path.split("/")[2:]
    return path(bus)[1:] in parts if bus else len(parts) == 1 + bool(one.role)


def _is_calm(one: FlightEvent) -> bool:
    return one.kind in _CALM and not _BAD.search(one.text)


def _moments(marks: Sequence[_Mark]) -> Moments:
    t, frames = (np.array([mark[k] for mark in marks], np.int64) for k in (0, 1))
    return Moments(t, frames)


def _line(one: FlightEvent, buses: Sequence[str]) -> str:
    """Write an event in a line: who, what kind, what."""
    bus = buses[one.bus] if one.bus is not None and len(buses) > 1 else ""
    ch = "" if one.ch is None else f"ch{one.ch}"
    node = "" if one.node is None else f"node {one.node}"
    who = " ".join(part for part in (bus, ch, node) if part)
    return wording.safe(f"{who} {one.kind}: {one.text}".strip())
