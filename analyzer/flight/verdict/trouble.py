"""A trouble: something of a flight that can be the beginning of it, and what its events are in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.pulse import STEP
from analyzer.flight.thresholds import lasting
from dissectors.records import dataclass, field
from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.case import FlightCase, Node

_MEASURED = (("voltage", "V"), ("current", "A"), ("temperature", "C"), ("speed", "rpm"))
_MOMENT = 2  # reports
_STANDS = 0.1  # of its speed
_WHOLE = frozenset({"motor", "silence", "restart", "message", "commands stop", "gap"})  # whose text needs no kind


@dataclass(slots=True)
class Trouble:
    """Something that happened between `low` and `high` (recorded times), told by events; the first one is its sign.

    `title` says what, `reasons` speak for it, `against` against it, `notes` say more, with a label each; `order`
    decides between those that begin together, the lowest first. `possible` is what no report says outright.
    """

    kind: str
    title: str
    events: list[FlightEvent]
    low: int
    high: int
    bus: int | None = None
    node: int | None = None
    ch: int | None = None
    chs: tuple[int, ...] = ()
    order: int = 5
    reasons: list[str] = field(default_factory=list)
    against: list[str] = field(default_factory=list)
    notes: list[tuple[str, str]] = field(default_factory=list)
    possible: bool = False

    @property
    def first(self) -> FlightEvent | None:
        """The event that begins it."""
        return self.events[0] if self.events else None

    @property
    def stands(self) -> bool:
        """True if a rotor does not turn, though it should."""
        return any(one.kind == "motor" and one.values["speed_share"] < _STANDS for one in self.events)


def made(
    kind: str, title: str, events: list[FlightEvent], order: int, reasons: list[str], *, whole: bool = False
) -> Trouble:
    """Return what begins with the first of some events, and of whom; of nobody if it is of the `whole` vehicle."""
    first = events[0]
    low = (first.before or first.first).ran
    node, ch = (None, None) if whole else (first.node, first.ch)
    return Trouble(kind, title, events, low, first.first.ran, first.bus, node, ch, order=order, reasons=reasons)


def by_node(events: Iterable[FlightEvent]) -> dict[Node, list[FlightEvent]]:
    """Return the events of each node, in order."""
    found: dict[Node, list[FlightEvent]] = {}
    for one in events:
        if one.bus is not None and one.node is not None:
            found.setdefault((one.bus, one.node), []).append(one)
    return found


def counts(case: FlightCase, one: FlightEvent) -> bool:
    """Return whether an event can be the beginning: not one that the recorder made, nor one long over."""
    if case.in_joint_loss(one) or _seen_once(case, one):
        return False
    return case.lasts(one) or not harmless(case, one)


def _seen_once(case: FlightCase, one: FlightEvent) -> bool:
    """Return whether a motor was off for a moment in which the recorder lost commands: nobody knows these."""
    if one.kind != "motor" or one.bus is None or one.node is None or one.values["reports"] > _MOMENT:
        return False
    return case.others_lost((one.bus, one.node), one)


def harmless(case: FlightCase, one: FlightEvent) -> bool:
    """Return whether it was over, and the vehicle flew on calmly for long."""
    if one.kind in {"restart", "mode"}:
        return False
    low, high = case.span(one)
    if any(low - STEP <= swing.start <= high + lasting("follows") for swing in case.swings):
        return False
    over = (one.after or one.first).ran
    end = case.excursion.start if case.excursion is not None else case.stop
    return over + lasting("harmless") < end


def together(case: FlightCase, events: Iterable[FlightEvent]) -> bool:
    """Return whether all ESCs, and several, show it within a moment."""
    first = _firsts(events)
    if len(case.esc_nodes) <= 1 or not case.esc_nodes <= set(first):
        return False
    times = [first[node] for node in case.esc_nodes]
    return max(times) - min(times) <= lasting("together")


def within(events: Iterable[FlightEvent]) -> str:
    """Return in how much time each node had its first event."""
    times = _firsts(events).values()
    return f"{(max(times) - min(times)) / MILLISECOND:.0f} ms"


def _firsts(events: Iterable[FlightEvent]) -> dict[Node, int]:
    return {node: some[0].first.ran for node, some in by_node(events).items()}


def text(one: FlightEvent) -> str:
    """Return an event in words, with what was measured at its onset."""
    shown = one.text if one.kind in _WHOLE else f"{one.kind}: {one.text}"
    told = one.values if one.kind in {"fault", "mode"} else {}
    values = ", ".join(f"{told[name]:.4g} {unit}" for name, unit in _MEASURED if name in told)
    return f"{shown} ({values})" if values else shown
