"""Transfers that are missing or came broken, in shares of what was sent."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.losses import LossPlace
    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Difference
    from analyzer.report.comparison.pair import Pair

_SIGMAS = 3.0


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them, of nodes that both captures have and that are one device each: what is lost is of what was sent."""
    shared = pair.good.shared, pair.bad.shared
    for node, there in sorted(pair.matching.nodes.items(), key=lambda both: both[1]):
        mine, theirs = pair.mine[node], pair.theirs[there]
        if (mine.bus, mine.node) in shared[0] or (theirs.bus, theirs.node) in shared[1]:
            continue
        if mine.lost is None or theirs.lost is None:
            continue
        before, after = (mine.lost, mine.lost + mine.count), (theirs.lost, theirs.lost + theirs.count)
        yield from _of(pair, there, "lost transfers", before, after, pair.bad.traits.losses.lost)
        before, after = (mine.bad, mine.count), (theirs.bad, theirs.count)
        yield from _of(pair, there, "broken transfers", before, after, pair.bad.traits.losses.broken)


def _of(
    pair: Pair, there: Node, what: str, mine: tuple[int, int], theirs: tuple[int, int], places: dict[Node, LossPlace]
) -> Iterator[Difference]:
    (before, sent), (after, sent_there) = mine, theirs
    good, bad = before / max(sent, 1), after / max(sent_there, 1)
    apart = abs(good - bad)
    more, expected = (after, good * sent_there) if bad > good else (before, bad * sent)
    chance = 2 * (more**0.5 - expected**0.5) < _SIGMAS  # as counts scatter
    beyond = more - expected
    if apart <= pair.limits["loss"] or chance or beyond < pair.limits["loss_counts"]:
        return
    size = apart / pair.limits["loss"]
    place = places.get(there) if bad > good else None
    one = pair.of_node(
        there, kind="loss", weight="warning" if bad > good else "note", what=what, good=_words(before, sent),
        bad=_words(after, sent_there), good_value=round(good, 6), bad_value=round(bad, 6), unit="share",
        size=round(size, 2), support=pair.support(size, beyond, pair.limits["loss_counts"], complete=True),
        good_count=sent, bad_count=sent_there, since="" if place is None else "first",
        t_ns=None if place is None else place.t, frame=None if place is None else place.frame,
    )  # fmt: skip
    yield pair.placed(one)


def _words(count: int, of: int) -> str:
    return f"{count} of {of}" if count else "none"
