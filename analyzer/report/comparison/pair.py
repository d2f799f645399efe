"""Both captures side by side: who is who, what they can show, and how a difference is written."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from analyzer.report.comparison.limits import limits
from analyzer.report.comparison.matching import match, nodes_of
from analyzer.report.comparison.model import Difference
from analyzer.report.wording import argument, quoted, window
from dissectors.records import replace
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.facts.senders import SenderFacts
    from analyzer.report.comparison.matching import Matching, Node
    from analyzer.report.comparison.model import Support
    from analyzer.report.comparison.samples import EscKey, EscRows
    from analyzer.report.comparison.traits import MeasuredSide

_SURE, _RATHER = 10, 3  # times the least that is asked for
_CLEAR, _PLAIN = 2.0, 1.5  # times the limit


class Pair:
    """Two captures that are compared, the second one to the first; with what the parts of the comparison share."""

    def __init__(self, good: MeasuredSide, bad: MeasuredSide) -> None:
        self.good, self.bad = good, bad
        self.limits = limits()

    @cached_property
    def matching(self) -> Matching:
        """Which nodes belong together."""
        return match(self.good, self.bad)

    @cached_property
    def mine(self) -> dict[Node, SenderFacts]:
        """The nodes of the first capture."""
        return nodes_of(self.good)

    @cached_property
    def theirs(self) -> dict[Node, SenderFacts]:
        """The nodes of the second capture."""
        return nodes_of(self.bad)

    def escs(self) -> Iterator[tuple[EscKey, EscRows, EscRows]]:
        """Yield the ESCs of both captures, known as in the second one, with their reports in both."""
        theirs = self.bad.traits.samples.all
        for key, rows in self.good.traits.samples.all.items():
            there = self.matching.nodes.get(key[:2])
            other = None if there is None else theirs.get((*there, key[2]))
            if there is not None and other is not None:
                yield (*there, key[2]), rows, other

    @property
    def timed(self) -> bool:
        """True if both tell how much time went by."""
        return self.good.timed and self.bad.timed

    @cached_property
    def beginning(self) -> str:
        """Say which capture is the beginning of the other one, cut short; "" if none is."""
        if self.bad.traits.blocks.begins(self.good.traits.blocks):
            return "the second capture is the beginning of the first: that it ends earlier is no difference"
        if self.good.traits.blocks.begins(self.bad.traits.blocks):
            return "the first capture is the beginning of the second: that it ends earlier is no difference"
        return ""

    def who(self, side: MeasuredSide, node: Node) -> str:
        """Return what people call a node: `ch5`, else nothing."""
        bus = side.facts.bus_names[node[0]]
        for one in side.capture.nodes:
            if (one.bus, one.node) == (bus, node[1]) and one.label:
                return one.label
        facts = (self.mine if side is self.good else self.theirs).get(node)
        return f"ch{facts.channels[0]}" if facts is not None and len(facts.channels) == 1 else ""

    @cached_property
    def _before(self) -> dict[Node, Node]:
        return {there: node for node, there in self.matching.nodes.items()}

    def of_node(self, node: Node, *, in_bad: bool = True, **given: Any) -> Difference:
        """Return a difference of a node of the second capture, or of the first one."""
        side = self.bad if in_bad else self.good
        bus = side.facts.bus_names[node[0]]
        who = self.who(side, node)
        if not who and in_bad and node in self._before:  # it no longer says so
            who = self.who(self.good, self._before[node])
        return self.placed(Difference(who=who, bus=bus, node=node[1], **given))

    def placed(self, one: Difference, margin: str = "1s") -> Difference:
        """Return a difference with a time that is believed, and the command that shows where it begins, if known."""
        if one.t_ns is not None:
            one = replace(one, t_ns=self.bad.traits.clock.believed(one.t_ns))
        command = self.command(one.t_ns, one.frame, margin)
        return replace(one, command=command) if command else one

    def command(self, t: int | None, frame: int | None, margin: str) -> str:
        """Return the command, for a POSIX shell, that shows a place of the second capture; empty for none."""
        around = f"{t // SECOND}.{t % SECOND // MILLISECOND:03d}+-{margin}" if t is not None else ""
        shown, capture = window(t, frame, around), self.bad.capture
        words = ["tailbyte", "decode", argument(capture.path), *map(quoted, capture.arguments)]
        return " ".join([*words, *shown]) if shown else ""

    def support(self, size: float, count: float, least: float, *, complete: bool = False) -> Support:
        """Return how sure a difference is, of what is drawn from `count` where `least` would be enough.

        Where one side lost frames, and what is compared suffers from that (not `complete`), nothing is more than
        possible.
        """
        if not complete and (self.good.incomplete or self.bad.incomplete):
            return "possible"
        if size >= _CLEAR and count >= _SURE * least:
            return "well supported"
        return "likely" if size >= _PLAIN or count >= _RATHER * least else "possible"
