"""Flights and their events: a lane, a log beside the plots, and marks on the lines of the channel they befell."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.plot.chunks import path
from analyzer.plot.inventory import Series
from analyzer.plot.moments import Moments
from analyzer.report import wording
from analyzer.tables import raw_rows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from analyzer.plot.canvas import Canvas

EVENTS, FLIGHTS = "events", "flights"
_CALM = frozenset({"mode", "join", "arming", "message", "parameter", "save"})  # kinds that are no trouble by themselves
_BAD = re.compile(r"\b(error|critical|fault)\b")
_Rows = list[tuple[int, int, dict[str, Any]]]  # time of the first report, its frame from 1, and the event


def draw(canvas: Canvas, flights: pa.Table, events: pa.Table, buses: Sequence[str], span: tuple[int, int]) -> None:
    """Draw what is in a span of time, in ns: tables `FLIGHTS` and `FLIGHT_EVENTS`."""
    _lane(canvas, flights, span)
    rows = [
        (one["t_end"], one["frame"] + 1, one)
        for one in raw_rows(events)
        if one["t_end"] is not None and span[0] <= one["t_end"] <= span[1]
    ]
    for level, calm in (("WARN", False), ("INFO", True)):
        here = [row for row in rows if _is_calm(row[2]) == calm]
        if here:
            series = Series(path(EVENTS, "calm" if calm else "trouble"), "text", EVENTS, level, owner=EVENTS)
            texts = [_line(one, buses) for _, _, one in here]
            canvas.texts(series, texts, [level] * len(here), _moments(here))
    for (quantity, bus, ch), marks in _measured(rows).items():
        line = _beside(canvas.inventory.series, quantity, buses[bus] if bus else "", ch)
        if line is not None:
            values = np.array([value for _, value in marks])
            canvas.lines([(line, values, None)], _moments([row for row, _ in marks]))


def _is_calm(one: Mapping[str, Any]) -> bool:
    return one["kind"] in _CALM and not _BAD.search(one["text"])


def _lane(canvas: Canvas, flights: pa.Table, span: tuple[int, int]) -> None:
    states, t, frames = list[str](), list[int](), list[int]()
    for one in raw_rows(flights):
        since, until = one["t"], one["t_end"]
        if since is not None and until is not None and since <= span[1] and until >= span[0]:
            states += [f"flight {one['flight']}", f"{one['end']}"]
            t += [max(since, span[0]), min(until, span[1])]
            frames += [one["frame"] + 1, one["frame_end"] + 1]
    if states:
        series = Series(path(FLIGHTS), "state", FLIGHTS, "Flights", owner=EVENTS)
        canvas.states(series, states, Moments(np.array(t, np.int64), np.array(frames, np.int64)))


def _measured(rows: _Rows) -> dict[tuple[str, int, int], list[tuple[tuple[int, int, dict[str, Any]], float]]]:
    """Return what was measured at events of channels, by quantity, bus and channel."""
    found: dict[tuple[str, int, int], list[tuple[tuple[int, int, dict[str, Any]], float]]] = {}
    for row in rows:
        one = row[2]
        if one["ch"] is not None and one["bus"] is not None:
            for quantity, value in json.loads(one["values"]).items():
                found.setdefault((quantity, one["bus"], one["ch"]), []).append((row, float(value)))
    return found


def _beside(known: Mapping[str, Series], quantity: str, bus: str, ch: int) -> Series | None:
    """Return the series of marks on the line of a channel, None if it has none."""
    for one in known.values():
        parts = one.path.split("/")[2:]
        on_bus = path(bus)[1:] in parts if bus else len(parts) == 1
        if (one.kind, one.quantity, one.role, one.number) == ("line", quantity, "", ch) and on_bus:
            return Series(
                path(EVENTS) + one.path, "points", quantity, f"{one.title} events", one.measure, unit=one.unit,
                owner=one.owner, number=ch,
            )  # fmt: skip
    return None


def _moments(rows: Sequence[tuple[int, int, object]]) -> Moments:
    t, frames = ([row[k] for row in rows] for k in (0, 1))
    return Moments(np.array(t, np.int64), np.array(frames, np.int64))


def _line(one: Mapping[str, Any], buses: Sequence[str]) -> str:
    """Write an event in a line: who, what kind, what."""
    bus = buses[one["bus"]] if one["bus"] is not None and len(buses) > 1 else ""
    ch = "" if one["ch"] is None else f"ch{one['ch']}"
    node = "" if one["node"] is None else f"node {one['node']}"
    who = " ".join(part for part in (bus, ch, node) if part)
    return wording.safe(f"{who} {one['kind']}: {one['text']}".strip())
