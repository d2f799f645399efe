"""The lanes of a time line: commands, supply, a lane each device, and one for whoever else something happened to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.timeline.courses import QUANTITIES
from analyzer.flight.timeline.strands import StrandSpan, strand
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.timeline.courses import CommandCourse, Courses, DeviceCourse
    from analyzer.flight.timeline.strands import Strand

COMMANDED, VOLTAGE = "commanded", "voltage"
_OF_ESC = QUANTITIES[:3]


@dataclass(frozen=True, slots=True)
class StayBar:
    """A mode that a device was in, from `start` to `end`."""

    start: int
    end: int
    code: int
    name: str
    failed: bool


@dataclass(frozen=True, slots=True)
class EventMark:
    """An event at its place; one that lasts goes on to `end`. `number` is that of the list of events, from 1."""

    number: int
    start: int
    end: int
    event: FlightEvent


@dataclass(slots=True)
class TimeLane:
    """One lane: whose it is, what is drawn in it, and what happened.

    `kind` is bus, autopilot, commands, supply, device or node.
    """

    kind: str
    bus: int | None = None
    node: int | None = None
    ch: int | None = None
    strands: Mapping[str, Strand] = field(default_factory=dict)
    stays: Sequence[StayBar] = ()
    marks: list[EventMark] = field(default_factory=list)


def lanes(courses: Courses, span: StrandSpan, marks: Sequence[EventMark]) -> list[TimeLane]:
    """Return the lanes of a span of the axis, those of the whole vehicle first."""
    commands = list(courses.commands.values())
    found = [one for command in commands if (one := _commands(command, span)) is not None]
    supply = _supply(courses, span)
    found += [] if supply is None else [supply]
    found += _devices(courses, span)
    for mark in marks:
        _lane_of(found, mark.event).marks.append(mark)
    order = ("bus", "autopilot", "commands", "supply", "device", "node")
    return sorted(
        (one for one in found if one.strands or one.marks),
        key=lambda one: (order.index(one.kind), one.ch is None, one.ch or 0, one.bus or 0, one.node or 0),
    )


def _commands(command: CommandCourse, span: StrandSpan) -> TimeLane | None:
    band = strand([(command.course, range(command.width))], span)
    return None if band is None else TimeLane("commands", command.bus, command.node, strands={COMMANDED: band})


def _supply(courses: Courses, span: StrandSpan) -> TimeLane | None:
    band = strand([(one.course, [QUANTITIES.index(VOLTAGE)]) for one in courses.devices.values()], span)
    return None if band is None else TimeLane("supply", strands={VOLTAGE: band})


def _devices(courses: Courses, span: StrandSpan) -> Iterator[TimeLane]:
    """Yield a lane each ESC, with what other tables say of it; a device of a node without one has its own."""
    own: dict[tuple[int, int, int | None], list[DeviceCourse]] = {}
    others = []
    for one in courses.devices.values():
        if one.esc:
            own.setdefault((one.bus, one.node, one.ch), []).append(one)
        else:
            others.append(one)
    for one in others:
        mine = [key for key in own if key[:2] == (one.bus, one.node)]
        if len(mine) <= 1:
            own.setdefault(mine[0] if mine else (one.bus, one.node, None), []).append(one)
    for (bus, node, ch), devices in own.items():
        strands = {}
        for row, name in enumerate(QUANTITIES):
            found = (strand([(one.course, [row])], span) for one in devices)
            first = next((one for one in found if one is not None), None)
            if name in _OF_ESC and first is not None:
                strands[name] = first
        commanded = _commanded(courses, bus, ch, span) if strands else None
        if commanded is not None:
            strands[COMMANDED] = commanded
        yield TimeLane("device", bus, node, ch, strands, tuple(_stays(devices, strands, span)))


def _commanded(courses: Courses, bus: int, ch: int | None, span: StrandSpan) -> Strand | None:
    for one in courses.commands.values():
        if ch is not None and one.bus == bus and one.first <= ch < one.first + one.width:
            found = strand([(one.course, [ch - one.first])], span)
            if found is not None:
                return found
    return None


def _stays(devices: Sequence[DeviceCourse], strands: Mapping[str, Strand], span: StrandSpan) -> Iterator[StayBar]:
    """Yield the modes of a device as long as it reported."""
    stays = next((one.modes for one in devices if one.modes), ())
    seen = next((one.spans for name, one in strands.items() if name != COMMANDED), [])
    begins = [span.axis.at(one.ran) for one in stays]
    for stay, begin, end in zip(stays, begins, [*begins[1:], span.end], strict=False):
        for low, high in seen:
            start, stop = max(begin, low, span.start), min(end, high, span.end)
            if start < stop:
                yield StayBar(start, stop, stay.code, stay.name, stay.failed)


def _lane_of(found: list[TimeLane], event: FlightEvent) -> TimeLane:
    """Return the lane of whom an event befell; a new one if there is none."""
    if event.source != "bus":
        return _known(found, TimeLane("autopilot"))
    if event.node is None:
        return _known(found, TimeLane("bus", event.bus))
    for one in found:
        same = (one.bus, one.node) == (event.bus, event.node)
        if one.kind == "device" and same and (event.ch is None or one.ch in (event.ch, None)):
            return one
        if one.kind == "device" and event.ch is not None and (one.bus, one.ch) == (event.bus, event.ch) and not same:
            return one  # told by who commands it
        if one.kind == "commands" and same and event.ch is None:
            return one
    return _known(found, TimeLane("node", event.bus, event.node))


def _known(found: list[TimeLane], new: TimeLane) -> TimeLane:
    for one in found:
        if (one.kind, one.bus, one.node) == (new.kind, new.bus, new.node):
            return one
    found.append(new)
    return new
