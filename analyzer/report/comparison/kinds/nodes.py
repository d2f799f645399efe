"""Nodes that only one capture has, that changed places or hardware, run other software, send other types, restart."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.facts.names import short
from analyzer.report.comparison.identity import NodeIdentity
from analyzer.report.comparison.matching import types_of
from analyzer.report.wording import plural
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.facts.senders import SenderFacts
    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Difference, Support
    from analyzer.report.comparison.pair import Pair

NONE = "not there"
_THERE = "node on the bus"
_RESTART = "BUS-021"
_AT_ONCE = 2 * SECOND  # nodes say once a second that they are there


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them, those of one node together."""
    few = pair.limits["block_counts"]
    for node in pair.matching.missing:
        one = pair.mine[node]
        yield pair.of_node(
            node, in_bad=False, kind="node", weight="error" if one.count >= few else "note", what=_THERE,
            good=_sends(one), bad=NONE, support=_seen(pair, one), good_count=one.count, since="throughout",
        )  # fmt: skip
    for node in pair.matching.added:
        one = pair.theirs[node]
        found = pair.of_node(
            node, kind="node", weight="warning" if one.count >= few else "note", what=_THERE,
            good=NONE, bad=_sends(one), support=_seen(pair, one), bad_count=one.count,
            since="throughout" if _early(pair, one) else "from", t_ns=None if _early(pair, one) else one.first,
        )  # fmt: skip
        yield pair.placed(found)
    for swap in pair.matching.exchanged:
        proof = "the same unique ID" if swap.serial else "the only ones of their kind that moved"
        yield pair.of_node(
            swap.bad, kind="exchange", weight="warning", what="node ID", good=_named(pair, swap.good, good=True),
            bad=_named(pair, swap.bad), support="well supported" if swap.serial else "likely", since="throughout",
            remark=f"{proof}: compared with each other",
        )  # fmt: skip
    for node, there in sorted(pair.matching.nodes.items(), key=lambda pair_: pair_[1]):
        yield from _software(pair, node, there)
        yield from _types(pair, node, there)
        yield from _late(pair, node, there)
        yield from _restarts(pair, node, there)


def _software(pair: Pair, node: Node, there: Node) -> Iterator[Difference]:
    mine, theirs = pair.mine[node].software or "", pair.theirs[there].software or ""
    nobody = NodeIdentity()
    before = pair.good.traits.identities.all.get(node, nobody)
    after = pair.bad.traits.identities.all.get(there, nobody)
    told = before != nobody != after and (before.version, before.build) != (after.version, after.build)
    other = bool(mine and theirs) and not _same(mine, theirs)
    if other or told:
        yield pair.of_node(
            there, kind="firmware", weight="warning", what="software", good=_told(mine if other else "", before),
            bad=_told(theirs if other else "", after), support="well supported", since="throughout",
        )  # fmt: skip
    if before.hardware and after.hardware and before.hardware != after.hardware:
        yield pair.of_node(
            there, kind="hardware", weight="warning", what="hardware", good=before.hardware, bad=after.hardware,
            support="well supported", since="throughout",
        )  # fmt: skip
    if node in pair.matching.replaced:
        yield pair.of_node(
            there, kind="hardware", weight="warning", what="unique ID", good=_serial(pair, node, before),
            bad=_serial(pair, there, after, good=False), support="well supported", since="throughout",
            remark="another device has this node ID",
        )  # fmt: skip


def _early(pair: Pair, one: SenderFacts) -> bool:
    """Return whether a node of the second capture is there from its start, as far as times tell."""
    start = pair.bad.start
    return start is None or one.first is None or one.first - start <= _AT_ONCE


def _told(text: str, one: NodeIdentity) -> str:
    """Return a version as a node tells it in full, else as it answers, with its build."""
    return " ".join(filter(None, (text or one.version, one.build))) or "unknown"


def _same(one: str, other: str) -> bool:
    """Return whether two versions may be one: `2.2`, that a node answers, is `V2.2.0` as it tells in full."""
    numbers, text = sorted((one, other), key=len)
    found = re.fullmatch(r"\d+\.\d+", numbers) and re.search(rf"(?<!\d){re.escape(numbers)}(?!\d)", text)
    return one == other or bool(found)


def _serial(pair: Pair, node: Node, one: NodeIdentity, *, good: bool = True) -> str:
    side = pair.good if good else pair.bad
    return one.unique_id or side.traits.parameters.serials.get(node, "another")


def _late(pair: Pair, node: Node, there: Node) -> Iterator[Difference]:
    """Yield how much later a node is heard for the first time, where both captures have times."""
    starts = pair.good.start, pair.bad.start
    firsts = pair.mine[node].first, pair.theirs[there].first
    if not pair.timed or None in starts or None in firsts:
        return
    before, after = (max((first or 0) - (start or 0), 0) for first, start in zip(firsts, starts, strict=True))
    size = abs(after - before) / SECOND / pair.limits["late"]
    few = min(pair.mine[node].count, pair.theirs[there].count) < pair.limits["rate_messages"]
    if size > 1 and not few:
        one = pair.of_node(
            there, kind="node", weight="warning" if after > before else "note", what="heard first",
            good=f"after {before / SECOND:.1f} s", bad=f"after {after / SECOND:.1f} s", unit="s",
            good_value=round(before / SECOND, 3), bad_value=round(after / SECOND, 3), size=round(size, 2),
            support="likely", since="from", t_ns=firsts[1],
        )  # fmt: skip
        yield pair.placed(one)


def _restarts(pair: Pair, node: Node, there: Node) -> Iterator[Difference]:
    before, after = pair.mine[node].restarts or 0, pair.theirs[there].restarts or 0
    if before == after:
        return
    at = pair.bad.facts.bus_names[there[0]], there[1]
    found = [one.first for one in pair.bad.report.findings if (one.bus, one.node) == at and one.rule == _RESTART]
    place = min(found, key=lambda one: one.t_ns or 0, default=None) if not before else None
    yield pair.of_node(
        there, kind="node", weight="warning" if after > before else "note", what="restarts", good=str(before),
        bad=str(after), good_value=before, bad_value=after, support="well supported", since="first" if place else "",
        t_ns=place.t_ns if place else None, frame=place.frame if place else None,
    )  # fmt: skip


def _types(pair: Pair, node: Node, there: Node) -> Iterator[Difference]:
    mine, theirs = types_of(pair.good, node), types_of(pair.bad, there)
    least = pair.limits["block_counts"]
    for sent in sorted({*mine} ^ {*theirs}):
        count = mine.get(sent, 0) or theirs.get(sent, 0)
        if count < least:
            continue
        side, whose = (pair.good, node) if sent in mine else (pair.bad, there)
        names = side.facts.bus_names
        found = [
            one
            for one in side.facts.nodes
            if (names.index(one.bus), one.node) == whose and (one.sends, one.kind) == sent
        ]
        steady = any(
            pulse.spread <= pair.limits["steady"]
            for one in found
            if (pulse := side.traits.rhythms.pulse((*whose, 0, one.type_id), int(least))) is not None
        )
        words = f"{found[0].hz:.1f} Hz" if steady and found[0].hz is not None else plural(count, "time")
        weight = "note" if not steady or sent in theirs else "error" if pair.mine[node].channels else "warning"
        first = min((one.first for one in found if one.first is not None), default=None)
        t = first if sent in theirs and first is not None and first - (side.start or 0) > _AT_ONCE else None
        name = f"{short(sent[0])}{'' if sent[1] == 'message' else f' {sent[1]}'}"
        yield pair.of_node(
            there, kind="rate", weight=weight, what=name, good=words if sent in mine else "never",
            bad=words if sent in theirs else "never", support=pair.support(2, count, least),
            good_count=mine.get(sent, 0), bad_count=theirs.get(sent, 0), t_ns=t,
            since="throughout" if sent in mine else "from" if t is not None else "",
        )  # fmt: skip


def _seen(pair: Pair, one: SenderFacts) -> Support:
    return pair.support(2, one.count, pair.limits["block_counts"], complete=one.count > pair.limits["rate_messages"])


def _sends(one: SenderFacts) -> str:
    return f"{one.hz:.1f} Hz" if one.hz is not None else plural(one.count, "time")


def _named(pair: Pair, node: Node, *, good: bool = False) -> str:
    who = pair.who(pair.good if good else pair.bad, node)
    return f"{node[1]} ({who})" if who else str(node[1])
