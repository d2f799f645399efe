"""Buses: those that only one capture has, their frames a second, error frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.kinds.nodes import NONE
from analyzer.report.comparison.model import Difference
from analyzer.report.wording import plural
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.facts.summary import BusFacts
    from analyzer.report.comparison.model import Support, Weight
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.traits import MeasuredSide

_SURE: Support = "well supported"
_RATE, _ERRORS = "frames a second", "error frames"


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them."""
    mine, theirs = ({bus.name: bus for bus in side.facts.buses} for side in (pair.good, pair.bad))
    names, others = pair.good.facts.bus_names, pair.bad.facts.bus_names
    pairs = {names[a]: others[b] for a, b in pair.matching.buses.items()}
    for name in sorted({*mine} - {*pairs}):
        weight: Weight = "error" if mine[name].frames >= pair.limits["block_counts"] else "note"
        yield replace(_bus(name, weight, "bus", plural(mine[name].frames, "frame"), NONE, _SURE), since="throughout")
    for name in sorted({*theirs} - {*pairs.values()}):
        yield replace(_bus(name, "note", "bus", NONE, plural(theirs[name].frames, "frame"), _SURE), since="throughout")
    for name, other in pairs.items():
        if name not in mine or other not in theirs or not pair.timed:
            continue
        before, after = _mean(pair.good, mine[name]), _mean(pair.bad, theirs[other])
        if before is None or after is None:
            continue
        limit = pair.limits["frames"] * max(before, after)
        count = min(mine[name].frames, theirs[other].frames)
        if abs(before - after) > limit and count >= pair.limits["bus_frames"]:
            size = abs(before - after) / limit
            sure = pair.support(size, count, pair.limits["rate_messages"])
            yield _bus(other, "note", _RATE, f"{before:.0f}/s", f"{after:.0f}/s", sure, (before, after), size)
    yield from _errors(pair)


def _mean(side: MeasuredSide, bus: BusFacts) -> float | None:
    """Return frames a second, without the time that a stray stamp adds."""
    if not side.traits.clock.stray or side.start is None or side.end is None:
        return bus.mean
    return bus.frames * SECOND / max(side.end - side.start, 1)


def _errors(pair: Pair) -> Iterator[Difference]:
    before, after = (side.facts.lines["error_frames"] for side in (pair.good, pair.bad))
    if bool(before) == bool(after):
        return
    known = (pair.bad if before else pair.good).facts.judge["errors"] == "yes"
    none = "none" if known else "not recorded"
    weight: Weight = "warning" if after else "note"
    one = _bus("", weight, _ERRORS, str(before or none), str(after or none), _SURE if known else "possible")
    yield replace(one, good_value=before if before or known else None, bad_value=after if after or known else None)


def _bus(
    name: str, weight: Weight, what: str, good: str, bad: str, support: Support,
    values: tuple[float, float] | None = None, size: float = 1.0,
) -> Difference:  # fmt: skip
    return Difference(
        kind="bus", weight=weight, who="", bus=name, node=None, what=what, good=good, bad=bad, support=support,
        size=round(size, 2), good_value=None if values is None else round(values[0], 3),
        bad_value=None if values is None else round(values[1], 3),
    )  # fmt: skip
