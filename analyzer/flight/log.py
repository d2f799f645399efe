"""Events of flights as they are found, by whom and of what kind, with a bound on each."""

from __future__ import annotations

import json
from collections import Counter
from math import isfinite
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.tables import FLIGHT_EVENTS
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.flight.clock import Spot
    from analyzer.flight.told.channels import ToldChannels

MOST_ALIKE = 200  # of one kind and sender
MOST_EVENTS = 100_000
_TOLD_TWICE = ("fault", "sag", "power-up")


@dataclass(slots=True)
class FlightEvent:
    """An event: it happened between `before`, None if it was so from the start, and `first`; it is over at `after`.

    `kind` and `text` are words for people; `values` are numbers by name. A `ch` that nobody said is found out later.
    `sign` is the trouble that it is a sign of, as far as a vendor says so. `lowered` are the channels that
    are commanded less than the mean of all where commands went apart.
    `source` is who says so: the bus, or an autopilot's own log, of which nothing is at a frame.
    """

    kind: str
    text: str
    before: Spot | None
    first: Spot
    after: Spot | None = None
    bus: int | None = None
    node: int | None = None
    ch: int | None = None
    type: str = ""
    clause: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    sign: str = ""
    source: str = "bus"
    lowered: tuple[int, ...] = ()


class EventLog:
    """Takes events; the first `MOST_ALIKE` of a kind and sender are kept, the others counted."""

    def __init__(self) -> None:
        self._all: list[FlightEvent] = []
        self._count: Counter[tuple[object, ...]] = Counter()
        self.more = 0  # that are not kept
        self._given = 0

    def add(self, event: FlightEvent) -> None:
        """Take one."""
        key = event.kind, event.bus, event.node, event.type, event.text if event.kind == "fault" else ""
        self._count[key] += 1
        if self._count[key] > MOST_ALIKE or len(self._all) >= MOST_EVENTS:
            self.more += 1
            return
        self._all.append(event)

    def spare(self, kind: str, bus: int, node: int, type_: str) -> bool:
        """Return whether one more is kept of a kind other than a fault; if not, count it, so that nobody adds it."""
        if self._count[kind, bus, node, type_, ""] < MOST_ALIKE and len(self._all) < MOST_EVENTS:
            return True
        self.more += 1
        return False

    def fresh(self, channels: ToldChannels) -> list[FlightEvent]:
        """Return those that were told since the last time, in no order."""
        found, self._given = self._all[self._given :], len(self._all)
        _know(found, channels)
        return found

    def events(self, channels: ToldChannels, late: Iterable[FlightEvent] = ()) -> list[FlightEvent]:
        """Return them, and those that are found at the end, in the order of the capture."""
        for event in late:
            self.add(event)
        _know(self._all, channels)
        ordered = sorted(self._all, key=lambda one: (one.first.ran, one.first.frame, one.kind, one.node or 0, one.text))
        return _united(ordered)


def _know(events: Iterable[FlightEvent], channels: ToldChannels) -> None:
    for one in events:
        if one.ch is None and one.bus is not None and one.node is not None:
            one.ch = channels.of(one.bus, one.node)


def event_table(events: Iterable[FlightEvent]) -> pa.Table:
    """Return events as `FLIGHT_EVENTS`."""
    return pa.Table.from_pylist(
        [
            {
                "event": number, "t": None if one.before is None else one.before.t, "t_end": one.first.t,
                "until": None if one.after is None else one.after.t, "bus": one.bus, "node": one.node, "ch": one.ch,
                "kind": one.kind, "source": one.source, "type": one.type, "text": one.text, "clause": one.clause,
                "values": _json(one.values), "frame": None if one.first.frame < 0 else one.first.frame,
            }
            for number, one in enumerate(events, 1)
        ],
        schema=FLIGHT_EVENTS,
    )  # fmt: skip


def _json(values: Mapping[str, float]) -> str:
    """Return numbers as JSON, which knows no infinite ones."""
    return json.dumps({name: value for name, value in values.items() if isfinite(value)})


def _united(events: Iterable[FlightEvent]) -> list[FlightEvent]:
    """Return the events, of which those that two types tell of the same device have become one: the narrower time."""
    found: list[FlightEvent] = []
    open_: dict[tuple[object, ...], FlightEvent] = {}
    for one in events:
        if one.kind not in _TOLD_TWICE:
            found.append(one)
            continue
        key = one.kind, one.bus, one.node, one.ch, one.text if one.kind == "fault" else ""
        since = (one.before or one.first).ran
        other = open_.get(key)
        if other is None or other.type == one.type or (other.after is not None and other.after.ran < since):
            found.append(one)
            open_[key] = one
            continue
        if one.before is not None and other.before is not None and other.before.ran < one.before.ran < other.first.ran:
            other.before = one.before
        if other.after is not None and (one.after is None or one.after.ran > other.after.ran):
            other.after = one.after
    return found
