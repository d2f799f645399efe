"""Rates of messages: other ones than before, and senders that are slow or silent for a while."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.names import short
from analyzer.report.comparison.rhythm import of_node
from analyzer.tables import KINDS
from dissectors.records import dataclass, replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Difference
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.rhythm import Pulse, SentKey

_FEWEST = 5  # blocks in which a pause shows
_TOGETHER = 2 * SECOND  # apart at most, and everybody fell silent at once
_MESSAGE = KINDS.index("message")


@dataclass(frozen=True, slots=True)
class _Pause:
    """A sender and type that was slow for `good` and `bad` of the time, and where that begins in the second capture."""

    node: Node
    name: str
    good: float
    bad: float
    begin: int | None
    lasting: bool
    silent: bool
    count: int


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them; nothing where one capture has no times."""
    if not pair.timed:
        return
    pauses: list[_Pause] = []
    heard: set[Node] = set()
    for node, there in sorted(pair.matching.nodes.items(), key=lambda both: both[1]):
        for key, mine, theirs in _pulses(pair, node, there):
            heard.add(there)
            name = _name(pair, key)
            told = [*_level(pair, there, name, mine, theirs)]
            paused = [*_paused(pair, there, name, mine, theirs)]
            yield from told or ([] if paused else _in_part(pair, there, name, mine, theirs))
            pauses += paused
    yield from _silences(pair, pauses, heard)


def compared(pair: Pair) -> int:
    """Return of how many senders and types the rates are compared."""
    if not pair.timed:
        return 0
    return sum(1 for node, there in pair.matching.nodes.items() for _ in _pulses(pair, node, there))


def _pulses(pair: Pair, node: Node, there: Node) -> Iterator[tuple[SentKey, Pulse, Pulse]]:
    """Yield what both send, and at least one of them at a steady rate."""
    least, steady = int(pair.limits["block_counts"]), pair.limits["steady"]
    mine, theirs = pair.good.traits.rhythms, pair.bad.traits.rhythms
    for key in of_node(mine.all, *node):
        if key[2] != _MESSAGE or (*there, *key[2:]) not in theirs.all:
            continue
        one, other = mine.pulse(key, least), theirs.pulse((*there, *key[2:]), least)
        if one is not None and other is not None and min(one.spread, other.spread) <= steady:
            yield key, one, other


def _name(pair: Pair, key: SentKey) -> str:
    names = pair.good.facts.bus_names
    for one in pair.good.facts.nodes:
        if (names.index(one.bus), one.node, one.type_id) == (*key[:2], key[3]) and one.kind == KINDS[key[2]]:
            return short(one.sends)
    return f"type {key[3]}"


def _level(pair: Pair, there: Node, name: str, mine: Pulse, theirs: Pulse) -> Iterator[Difference]:
    before, after = mine.hz, theirs.hz
    limit = pair.limits["rate"] * max(before, after)
    counts = abs(before - after) * min(mine.width, theirs.width) / SECOND
    if abs(before - after) <= limit or counts < pair.limits["rate_counts"]:
        return
    size = abs(before - after) / limit
    off = np.abs(theirs.blocks[:-1] * (SECOND / theirs.width) - before) > limit
    runs = _runs(off)
    begin = next((run[0] for run in runs if run[1] - run[0] > 1), runs[0][0] if runs else 0)
    t = theirs.start + begin * theirs.width if begin else None
    one = pair.of_node(
        there, kind="rate", weight="warning", what=f"{name} rate", good=f"{before:.1f} Hz", bad=f"{after:.1f} Hz",
        good_value=round(before, 3), bad_value=round(after, 3), unit="Hz", size=round(size, 2),
        support=pair.support(size, min(mine.count, theirs.count), pair.limits["rate_messages"]),
        good_count=mine.count, bad_count=theirs.count, since="throughout" if t is None else "from", t_ns=t,
    )  # fmt: skip
    yield pair.placed(one)


def _in_part(pair: Pair, there: Node, name: str, mine: Pulse, theirs: Pulse) -> Iterator[Difference]:
    """Yield that one capture has another rate for a part of the time, which the other one has not."""
    here, other = (one.off(max(pair.limits["rate"] * one.usual, pair.limits["rate_counts"])) for one in (mine, theirs))
    if min(len(here), len(other)) < _FEWEST:
        return
    good, bad = float(here.mean()), float(other.mean())
    if abs(good - bad) <= pair.limits["slow_share"]:
        return
    odd, which = (theirs, other) if bad > good else (mine, here)
    runs = [run for run in _runs(which) if run[1] - run[0] > 1]
    if not runs:
        return
    first, last = max(runs, key=lambda run: run[1] - run[0])
    hz = float(np.median(odd.blocks[first:last])) * SECOND / odd.width
    before, after = (mine.hz, hz) if bad > good else (hz, theirs.hz)
    size, count = abs(before - after) / (pair.limits["rate"] * max(before, after)), min(mine.count, theirs.count)
    t = odd.start + first * odd.width if bad > good else None
    one = pair.of_node(
        there, kind="rate", weight="warning" if bad > good else "note", what=f"{name} rate in a part",
        good=f"{before:.1f} Hz", bad=f"{after:.1f} Hz", good_value=round(before, 3), bad_value=round(after, 3),
        unit="Hz", size=round(size, 2), support=pair.support(size, count, pair.limits["rate_messages"]),
        good_count=mine.count, bad_count=theirs.count, since="" if t is None else "from", t_ns=t,
        remark=f"{_percent(abs(bad - good))} of {'the time' if t is not None else 'the first capture'}",
    )  # fmt: skip
    yield pair.placed(one)


def _paused(pair: Pair, there: Node, name: str, mine: Pulse, theirs: Pulse) -> Iterator[_Pause]:
    slow = pair.limits["slow"]
    here, other = mine.below(slow * mine.hz), theirs.below(slow * theirs.hz)
    if min(len(here), len(other)) < _FEWEST:
        return
    good, bad = float(here.mean()), float(other.mean())
    if abs(good - bad) <= pair.limits["slow_share"]:
        return
    runs = [run for run in _runs(theirs.below(slow * theirs.hz)) if run[1] - run[0] > 1]
    first, last = runs[0] if runs and bad > good else (None, None)
    silent = first is not None and not theirs.blocks[first:last].any()
    begin = None if first is None else theirs.start + first * theirs.width
    yield _Pause(
        there, name, good, bad, begin, last == len(other), silent, min(mine.count, theirs.count)
    )  # fmt: skip


def _silences(pair: Pair, pauses: list[_Pause], heard: set[Node]) -> Iterator[Difference]:
    """Yield the pauses, all types of a node as one, and all nodes at once as the bus's."""
    by_node: dict[Node, list[_Pause]] = {}
    for one in pauses:
        by_node.setdefault(one.node, []).append(one)
    begins = [min((one.begin for one in some if one.begin is not None), default=None) for some in by_node.values()]
    known = [begin for begin in begins if begin is not None]
    everybody = len(by_node) == len(heard) > 2 and len(known) == len(begins) and max(known) - min(known) <= _TOGETHER
    if everybody:
        some = max(by_node.values(), key=len)
        silence = _difference(pair, some[0], "all senders")
        bus = pair.bad.facts.bus_names[some[0].node[0]]
        yield replace(
            silence,
            kind="bus",
            who="",
            node=None,
            bus=bus,
            remark="of the time: the recorder, its wire, or the whole bus",
        )
        return
    sent = {there: sum(1 for _ in _pulses(pair, node, there)) for node, there in pair.matching.nodes.items()}
    for node, some in by_node.items():
        if len(some) > 1 and len(some) == sent[node]:
            first = min(some, key=lambda one: one.begin or 0)
            yield _difference(pair, replace(first, silent=all(one.silent for one in some)), f"all {len(some)} types")
        else:
            yield from (_difference(pair, one, one.name) for one in some)


def _difference(pair: Pair, one: _Pause, what: str) -> Difference:
    size = abs(one.good - one.bad) / pair.limits["slow_share"]
    word = "silent" if one.silent else "slow or silent"
    worse = one.bad > one.good
    until = "to the end" if worse and one.lasting else ""
    found = pair.of_node(
        one.node, kind="rate", weight="note" if not worse else "error" if one.silent else "warning",
        what=f"{what} {word}", good=_percent(one.good), bad=_percent(one.bad), good_value=round(one.good, 4),
        bad_value=round(one.bad, 4), unit="share", size=round(size, 2), good_count=one.count, bad_count=one.count,
        support=pair.support(size, one.count, pair.limits["rate_messages"]),
        since="from" if one.begin is not None else "", t_ns=one.begin, remark=f"of the time; {until}".rstrip("; "),
    )  # fmt: skip
    return pair.placed(found)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the runs of rows that are true: from, to (behind it)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
