"""ESCs that were without power: silent for good, or started anew; and whether they were so together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.thresholds import lasting, threshold
from analyzer.flight.verdict.trouble import by_node
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase, Node

_SEVERAL = 2
_TOLD_BY = frozenset({"silence", "restart", "power-up"})


@dataclass(frozen=True, slots=True)
class Outage:
    """An ESC without power from some time between `low` and the first report of `event`; `anew` if it came back."""

    node: Node
    low: int
    event: FlightEvent
    anew: bool

    @property
    def high(self) -> int:
        """When it had been so at the latest."""
        return self.event.first.ran


class Outages:
    """The ESCs of a flight that were without power, in order; `going_on` are others that are heard to the end."""

    def __init__(self, case: FlightCase) -> None:
        told = [one for one in case.events if one.kind in _TOLD_BY and not case.in_joint_loss(one)]
        by_esc = {node: events for node, events in by_node(told).items() if node in case.esc_nodes}
        found = [one for node, events in by_esc.items() if (one := _outage(case, node, events)) is not None]
        self.all: Sequence[Outage] = sorted(found, key=lambda one: one.high)
        self.going_on = {
            (one.bus, one.node) for one in case.paces
            if (one.bus, one.node) not in case.esc_nodes and one.last >= case.border - lasting("silence_after")
        }  # fmt: skip
        self._escs = len(case.esc_nodes)

    @property
    def together(self) -> bool:
        """True if nearly all ESCs, and several, may have been away within a moment, and the recording was not."""
        if not self._nearly_all(len(self.all)) or not (self.going_on or any(one.anew for one in self.all)):
            return False
        return max(one.low for one in self.all) - min(one.high for one in self.all) <= lasting("together")

    def soon_after(self, at: int) -> int:
        """Return how many were away so soon after a time that a vehicle is hardly down; 0 if not nearly all."""
        near = sum(one.low <= at + lasting("follows") for one in self.all)
        return near if self._nearly_all(near) else 0

    def _nearly_all(self, count: int) -> bool:
        return count >= max(_SEVERAL, threshold("nearly_all") * self._escs)


def began_anew(case: FlightCase, restart: FlightEvent, events: Iterable[FlightEvent]) -> tuple[int, FlightEvent]:
    """Return since when, and by which event at the latest, an ESC started anew: an uptime is told once a second only.

    `events` may tell the same moment.
    """
    low, high = case.span(restart)
    first = restart
    for one in events:
        since, seen = case.span(one)
        if one is restart or since > high or seen < low:
            continue
        low = max(low, since)
        if seen < first.first.ran:
            first = one
    return min(low, first.first.ran), first


def _outage(case: FlightCase, node: Node, events: Sequence[FlightEvent]) -> Outage | None:
    """Return what shows that an ESC was without power: a silence that does not end, or that it starts anew."""
    restart = next((one for one in events if one.kind == "restart"), None)
    if restart is None:
        silence = next((one for one in events if one.kind == "silence" and one.after is None), None)
        return None if silence is None else Outage(node, case.span(silence)[0], silence, anew=False)
    low, first = began_anew(case, restart, events)
    return Outage(node, low, first, anew=True)
