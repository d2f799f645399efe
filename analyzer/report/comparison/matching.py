"""Which bus and which node of one capture are those of the other: by name and node ID, or by what tells them apart.

Buses of one name are one. If each capture has one bus left, these are one, whatever they are called. A node is the one
with its ID, unless its unique ID is that of a node with another ID: then the devices were exchanged. Without unique IDs
a node that is gone and a node that is new are one if they alone send the same types and have the same software.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.facts.senders import SenderFacts
    from analyzer.report.comparison.traits import MeasuredSide

Node = tuple[int, int]  # index of the bus, node ID
_KINDS = ("unique ID", "serial number")


@dataclass(frozen=True, slots=True)
class Exchange:
    """A device that has another node ID in the second capture; `serial` is the number that proves it, if one does."""

    good: Node
    bad: Node
    serial: str


@dataclass(frozen=True, slots=True)
class Matching:
    """`buses` and `nodes` map those of the first capture to those of the second; `missing` and `added` have none.

    `replaced` are nodes whose unique ID is another one and that of no node of the first capture; `strangers` says that
    no unique ID occurs in both captures: it is another vehicle.
    """

    buses: Mapping[int, int]
    nodes: Mapping[Node, Node]
    missing: tuple[Node, ...]
    added: tuple[Node, ...]
    exchanged: tuple[Exchange, ...]
    replaced: tuple[Node, ...]
    strangers: bool
    renamed: tuple[tuple[str, str], ...]
    serials: int


def match(good: MeasuredSide, bad: MeasuredSide) -> Matching:
    """Return how both captures belong together."""
    buses, renamed = _buses(good, bad)
    mine, theirs = nodes_of(good), nodes_of(bad)
    ids, other_ids = _serials(good), _serials(bad)
    pairs = {(bus, node): (buses[bus], node) for bus, node in mine if bus in buses and (buses[bus], node) in theirs}
    by_id = _unique(other_ids)
    moves: dict[Node, Exchange] = {}
    for (node, _), serial in sorted(ids.items()):
        there = by_id.get(serial)
        if node in mine and there is not None and there in theirs and pairs.get(node) != there:
            moves.setdefault(node, Exchange(node, there, serial))
    exchanged = list(moves.values())
    for one in exchanged:
        pairs = {a: b for a, b in pairs.items() if a != one.good and b != one.bad} | {one.good: one.bad}
    missing = [node for node in sorted(mine) if node not in pairs]
    added = [node for node in sorted(theirs) if node not in {*pairs.values()}]
    for node, there in _alike(good, bad, missing, added):
        pairs[node] = there
        exchanged.append(Exchange(node, there, ""))
        missing.remove(node)
        added.remove(there)
    both = {a: ids[a, kind] == other_ids[b, kind] for a, b in pairs.items() for kind in _KINDS
            if (a, kind) in ids and (b, kind) in other_ids}  # fmt: skip
    strange = len(both) > 1 and not any(both.values()) and not {*ids.values()} & {*other_ids.values()}
    replaced = [node for node, same in both.items() if not same]
    return Matching(
        buses, pairs, tuple(missing), tuple(added), tuple(exchanged), () if strange else tuple(sorted(replaced)),
        strange, renamed, len(both),
    )  # fmt: skip


def nodes_of(side: MeasuredSide) -> dict[Node, SenderFacts]:
    """Return the facts of the nodes that have an ID."""
    names = side.facts.bus_names
    return {(names.index(one.bus), one.node): one for one in side.facts.senders if not one.anonymous and one.node}


def types_of(side: MeasuredSide, node: Node) -> dict[tuple[str, str], int]:
    """Return what a node sends, as type and kind, with how often."""
    names = side.facts.bus_names
    sent: Counter[tuple[str, str]] = Counter()
    for one in side.facts.nodes:
        if (names.index(one.bus), one.node) == node:
            sent[one.sends, one.kind] += one.count
    return dict(sent)


def _buses(good: MeasuredSide, bad: MeasuredSide) -> tuple[dict[int, int], tuple[tuple[str, str], ...]]:
    mine, theirs = good.facts.bus_names, bad.facts.bus_names
    found = {k: theirs.index(name) for k, name in enumerate(mine) if name in theirs}
    rest = [k for k in range(len(mine)) if k not in found]
    others = [k for k in range(len(theirs)) if k not in found.values()]
    if len(rest) != 1 or len(others) != 1:
        return found, ()
    return found | {rest[0]: others[0]}, ((mine[rest[0]], theirs[others[0]]),)


def _serials(side: MeasuredSide) -> dict[tuple[Node, str], str]:
    """Return what tells the devices apart, by node and kind: unique IDs, and serial numbers among their parameters."""
    named = {(node, _KINDS[0]): one.unique_id for node, one in side.traits.identities.all.items() if one.unique_id}
    return named | {(node, _KINDS[1]): f"serial {text}" for node, text in side.traits.parameters.serials.items()}


def _unique(serials: Mapping[tuple[Node, str], str]) -> dict[str, Node]:
    often = Counter(serials.values())
    return {serial: node for (node, _), serial in serials.items() if often[serial] == 1}


def _alike(
    good: MeasuredSide, bad: MeasuredSide, missing: list[Node], added: list[Node]
) -> Iterator[tuple[Node, Node]]:  # fmt: skip
    mine, theirs = nodes_of(good), nodes_of(bad)

    def traits(side: MeasuredSide, of: Mapping[Node, SenderFacts], node: Node) -> object:
        return frozenset(types_of(side, node)), of[node].software, of[node].name, of[node].channels

    gone = Counter(traits(good, mine, node) for node in missing)
    new = {traits(bad, theirs, node): node for node in added}
    many = Counter(traits(bad, theirs, node) for node in added)
    for node in list(missing):
        of = traits(good, mine, node)
        if gone[of] == many[of] == 1 and len(types_of(good, node)) > 1:
            yield node, new[of]
