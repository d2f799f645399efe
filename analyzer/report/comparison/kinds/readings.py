"""Doubtful fields that a node's own data speak for another reading of: another unit, byte order or dialect."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.decode.readings import FORCED, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Difference
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.traits import MeasuredSide


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them, of nodes that both captures decide; what somebody forced is no difference of the device."""
    mine, theirs = _decided(pair.good), _decided(pair.bad)
    for node, there in sorted(pair.matching.nodes.items(), key=lambda both: both[1]):
        after = theirs.get(there, {})
        for name, before in mine.get(node, {}).items():
            if name in after and after[name] != before:
                yield pair.of_node(
                    there, kind="reading", weight="warning", what=name, good=before, bad=after[name],
                    support="well supported", since="throughout",
                )  # fmt: skip


def _decided(side: MeasuredSide) -> dict[Node, dict[str, str]]:
    """Return the choices of each node, by the names of the readings as `tailbyte info` has them."""
    found: dict[Node, dict[str, str]] = {}
    for one in side.facts.readings:
        if one.choice != UNDECIDED and not one.choice.endswith(FORCED):
            name = one.reading if one.reading == one.field else f"{one.field} ({one.reading})"
            found.setdefault((one.bus, one.node), {})[f"{one.message}.{name} read as"] = one.choice
    return found
