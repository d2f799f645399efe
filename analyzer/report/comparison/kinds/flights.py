"""Flights: what broke first in them, how many there were, and how the last one ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.model import Difference
from analyzer.report.wording import triage
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.flights import Flight
    from analyzer.flight.verdict.model import Triage, Verdict
    from analyzer.report.comparison.matching import Node
    from analyzer.report.comparison.model import Weight
    from analyzer.report.comparison.pair import Pair

_ENDS = {"cut": "recording ends", "lost": "reports end", "landed": "landed"}
_NO, _YES = "no", "yes"
_CUT = "CAP-005"  # the finding that a recording ends with motors turning
_RECORDER = "recorder"  # whose losses are none of the vehicle

_What = tuple[str, "Node | None", tuple[int, ...]]  # kind, node of the second capture, channels


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them: causes that only one capture shows, then how many flights there were and how the last one ended."""
    good, bad = pair.good.triage, pair.bad.triage
    if good is None or bad is None:
        return
    yield from _causes(pair, good, bad)
    if pair.beginning or not (pair.good.whole and pair.bad.whole and pair.timed):
        return
    if len(good.flights) != len(bad.flights):
        yield from _flights(pair, good, bad)
    ends = _end_words(good), _end_words(bad)
    told = len({_CUT in (one.rule for one in side.report.findings) for side in (pair.good, pair.bad)}) > 1
    if good.flights and bad.flights and ends[0] != ends[1] and not told:
        yield _end(pair, ends, bad.flights[-1])


def compared(pair: Pair) -> int:
    """Return how many flights both captures have."""
    return min(len(one.flights) if (one := side.triage) is not None else 0 for side in (pair.good, pair.bad))


def cannot(pair: Pair) -> Iterator[str]:
    """Say that one capture, or none of them, has a flight."""
    good, bad = pair.good.triage, pair.bad.triage
    if good is None or bad is None or (good.flights and bad.flights):
        return
    whose = "the second capture has none" if good.flights else "the first capture has none" if bad.flights else "none"
    yield f"how flights went: {whose}"


def _causes(pair: Pair, good: Triage, bad: Triage) -> Iterator[Difference]:
    """Yield the verdicts on the last flights that are not the same in both."""
    mine = {_what(pair, one, in_bad=False): one for one in good.verdicts if one.told}
    theirs = {_what(pair, one, in_bad=True): one for one in bad.verdicts if one.told}
    for what, one in theirs.items():
        if what not in mine:
            weight: Weight = "warning" if one.support == "possible" or one.kind == _RECORDER else "error"
            yield _cause(pair, one, weight, in_bad=True)
    for what, one in mine.items():
        if what not in theirs:
            yield replace(_cause(pair, one, "note", in_bad=False), eased=True)


def _what(pair: Pair, one: Verdict, *, in_bad: bool) -> _What:
    if one.bus is None or one.node is None:
        return one.kind, None, tuple(one.chs)
    node = one.bus, one.node
    return one.kind, node if in_bad else pair.matching.nodes.get(node, (-1, one.node)), tuple(one.chs)


def _cause(pair: Pair, one: Verdict, weight: Weight, *, in_bad: bool) -> Difference:
    side = pair.bad if in_bad else pair.good
    node = None if one.bus is None or one.node is None else (one.bus, one.node)
    found = Difference(
        kind="flight", weight=weight, who="" if node is None else pair.who(side, node),
        bus=side.facts.bus_names[one.bus or 0], node=one.node, what=one.gist, good=_NO if in_bad else _YES,
        bad=_YES if in_bad else _NO, support=one.support, since="first" if in_bad and one.t_end else "",
        t_ns=one.t_end if in_bad else None, frame=one.frame + 1 if in_bad and one.frame is not None else None,
        remark="; ".join(one.reasons[:1]),
    )  # fmt: skip
    return replace(pair.placed(found), command=triage(side.capture))


def _flights(pair: Pair, good: Triage, bad: Triage) -> Iterator[Difference]:
    """Yield another number of flights; none is one where there was time for it."""
    if not good.flights or not bad.flights:
        some, side, without = (bad, pair.bad, pair.good) if bad.flights else (good, pair.good, pair.bad)
        took = (some.flights[0].first.t - (side.start or 0)) / SECOND + pair.limits["flight_late"]
        if ((without.end or 0) - (without.start or 0)) / SECOND < took:
            return
    yield Difference(
        kind="flight", weight="note" if bad.flights else "warning", who="", bus="", node=None, what="flights",
        good=str(len(good.flights) or "none"), bad=str(len(bad.flights) or "none"), support="well supported",
        good_value=len(good.flights), bad_value=len(bad.flights), remark="" if bad.flights else bad.judged,
    )  # fmt: skip


def _end_words(found: Triage) -> str:
    """Say how the last flight ended; motors that stop where a cause is told have not simply landed."""
    end = found.flights[-1].end if found.flights else ""
    return "motors stop" if end == "landed" and found.first.told else _ENDS.get(end, end)


def _end(pair: Pair, ends: tuple[str, str], bad: Flight) -> Difference:
    """Return another end; a recording may end anywhere."""
    lost = bad.end == "lost"
    one = Difference(
        kind="flight", weight="warning" if lost else "note", who="", bus="", node=None, what="end of the last flight",
        good=ends[0], bad=ends[1], support="well supported", since="from" if lost else "",
        t_ns=bad.last.t if lost else None, frame=bad.frame_end + 1 if lost else None,
    )  # fmt: skip
    return pair.placed(one)
