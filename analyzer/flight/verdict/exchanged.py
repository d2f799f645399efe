"""Differences from the flight before, or from all others: hardware, software, turning, index."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.told.setups import HARDWARE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.verdict.case import FlightCase, Node

_FEWEST = 3  # devices: of two nobody can say which one differs


def exchanged(case: FlightCase, flights: Sequence[Flight]) -> Iterator[str]:
    """Yield, each in a line, what ESCs tell that they did not in the flight before, or that no other ESC does."""
    before = max((one for one in flights if one.last.ran < case.start), key=lambda one: one.last.ran, default=None)
    now = {node: case.setups.of(node, case.stop) for node in sorted(case.esc_nodes)}
    if before is not None:
        since = f"changed since flight {before.number}"
        for node, told in now.items():
            yield from (
                f"{since}: {line}" for line in _changes(case, node, case.setups.of(node, before.last.ran), told)
            )
    yield from _alone(case, now)


def _changes(case: FlightCase, node: Node, then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    who = case.name(node)
    if then.get(HARDWARE, now.get(HARDWARE)) != now.get(HARDWARE):
        yield f"{who} is another piece of hardware"
    yield from (
        f"{who} tells {name} {then[name]} -> {text}"
        for name, text in now.items()
        if name != HARDWARE and then.get(name, text) != text
    )
    old = {one.ch for one in case.earlier_escs if (one.bus, one.node) == node and one.ch is not None}
    new = {one.ch for one in case.escs if (one.bus, one.node) == node and one.ch is not None}
    if old and new and not old & new:
        yield f"node {node[1]} reports as ch{min(new)}, then as ch{min(old)}"


def _alone(case: FlightCase, now: Mapping[Node, Mapping[str, str]]) -> Iterator[str]:
    """Yield what one ESC tells otherwise than all others, which tell the same."""
    for name in dict.fromkeys(name for told in now.values() for name in told if name != HARDWARE):
        by_text: dict[str, list[Node]] = {}
        for node, told in now.items():
            if name in told:
                by_text.setdefault(told[name], []).append(node)
        count = sum(map(len, by_text.values()))
        if len(by_text) == 2 and count >= _FEWEST and (alone := [one for one in by_text.items() if len(one[1]) == 1]):
            ((text, (node,)),) = alone
            (other,) = (one for one in by_text if one != text)
            yield f"{case.name(node)} tells {name} {text}, the others {other}"
