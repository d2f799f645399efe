"""The odd ones: each against its own past first, then against the others of its group."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.motors.halves import speeds_alone, supply_alone
from analyzer.flight.odd.cells import NEVER
from analyzer.flight.odd.course import courses
from analyzer.flight.odd.layers import layers
from analyzer.flight.odd.quantities import QUANTITIES, VOLTAGE
from analyzer.flight.odd.words import layer_words, odd_words
from analyzer.flight.robust import FEWEST, against_others, others, spread
from analyzer.flight.thresholds import threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.odd.cells import EscCells
    from analyzer.flight.odd.course import QuantityCourse
    from analyzer.flight.odd.past import QuantityPast
    from analyzer.flight.odd.quantities import EscQuantity
    from dissectors.kit import Array

OWN_PAST, PEERS = "own past", "peers"
_NEAR = 2  # slots, by which noise may move the begin of a change
_NEEDS_OTHERS = frozenset({"temperature", "voltage"})  # change in the course of every flight


@dataclass(frozen=True, slots=True)
class OddEsc:
    """An ESC that is odd in one quantity, by `difference` in `unit`, `z` standard deviations.

    `against` its own past it is so since `since` (capture clock, ns; `ran` is recorded time); against its peers all the
    time, which is a fact of the vehicle and no cause. `text` says it in words, `gist` without what was equal.
    """

    bus: int
    node: int
    ch: int | None
    quantity: str
    difference: float
    unit: str
    z: float
    against: str
    since: int
    ran: int
    gist: str
    text: str

    @property
    def always(self) -> bool:
        """Return whether it was never otherwise."""
        return self.against == PEERS


@dataclass(frozen=True, slots=True)
class ComparedEsc:
    """An ESC and how far it is from the median of all, by the keys of quantities, in their units; None if unknown."""

    bus: int
    node: int
    ch: int | None
    reports: int
    levels: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class OddReport:
    """The odd ones, the farthest first; `facts` of whole groups; what was compared, and in how many ways."""

    odd: Sequence[OddEsc]
    facts: Sequence[str]
    compared: Sequence[ComparedEsc]
    comparisons: int = 0


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A difference that may be told: of which device, how far (unit of the quantity), in which slot it began."""

    device: int
    course: QuantityCourse
    z: float
    difference: float
    slot: int | None


def judged(devices: Sequence[EscCells], flights: Sequence[Flight], width: int) -> OddReport:
    """Return who is odd among devices; `width` is that of a slot, in ns."""
    found: list[OddEsc] = []
    facts: list[str] = []
    compared: list[ComparedEsc] = []
    several: list[tuple[Sequence[EscCells], list[_Candidate]]] = []
    comparisons = 0
    for group in _groups(devices):
        candidates: list[_Candidate] = []
        told, chs = list(courses(group, width)), [one.ch for one in group]
        for course in told:
            least = course.quantity.layer / course.quantity.scale
            upper = layers(course.level, least, _tolerated(course.quantity), chs)
            if upper.any():
                facts.append(layer_words(course.quantity, _names(group, upper), _gap(course, upper)))
            own, tried = _own_past(course, upper)
            peers = _peers(course, upper)
            candidates += [*own, *peers]
            comparisons += tried + len(course.level)
        compared += _compared(group, told)
        several.append((group, candidates))
    limit = _limit(comparisons)
    for group, candidates in several:
        found += _told(group, candidates, limit, flights, width)
    found.sort(key=lambda one: (one.always, -abs(one.z)))
    return OddReport(found, facts, compared, comparisons)


def _groups(devices: Sequence[EscCells]) -> Iterator[Sequence[EscCells]]:
    """Yield devices that report in the same type; of two interfaces that show the same ones each for itself."""
    fewest = threshold("odd_reports")
    some = [one for one in devices if one.numbers("came").sum() >= fewest]
    halves = {one.key for one in some if speeds_alone(one.plot)}
    some = [one for one in some if not (supply_alone(one.plot) and one.key in halves)]  # is told with its speeds
    for table in dict.fromkeys(one.plot.table for one in some):
        mine = sorted((one for one in some if one.plot.table == table), key=lambda one: one.key)
        nodes = [split(one.key)[1:] for one in mine]
        if len(set(nodes)) == len(nodes):
            yield mine
            continue
        for bus in dict.fromkeys(split(one.key)[0] for one in mine):
            yield [one for one in mine if split(one.key)[0] == bus]


def _own_past(course: QuantityCourse, upper: Array) -> tuple[list[_Candidate], int]:
    """Return how much each device changed, where it changed most; and how many comparisons that were."""
    quantity, past = course.quantity, course.past
    count = len(course.level)
    at = np.arange(past.series.shape[1])
    change = past.change(at, at)
    known = np.isfinite(change)
    if not known.any():
        return [], 0
    side = upper if quantity is VOLTAGE else np.zeros(count, bool)
    common, series = _common(change, side, quantity), _common(past.series, side, quantity)
    own = change - common
    wide = np.zeros_like(own)
    for k in range(count):
        rest = [j for j in range(count) if j != k and side[j] == side[k]]
        if len(rest) >= FEWEST - 1:
            wide[k] = np.nan_to_num(spread(own[rest], 0))
    wander = threshold(f"wander_{quantity.key}") / quantity.scale
    z = own / np.sqrt(np.nan_to_num(past.noise(series), posinf=0.0) ** 2 + wide**2 + wander**2)
    found = []
    for k in range(count):
        if not np.isfinite(z[k]).any():
            continue
        slot = int(np.nanargmax(np.abs(z[k])))
        now = _now(past, k, slot, side, quantity)
        now = now if np.isfinite(now) else float(own[k, slot])
        if now * own[k, slot] > 0 and abs(now) >= abs(own[k, slot]) / 2:
            found.append(_Candidate(k, course, float(z[k, slot]), quantity.difference(now), slot))
    return found, int(known.any(axis=1).sum() * threshold("odd_splits"))


def _now(past: QuantityPast, device: int, slot: int, side: Array, quantity: EscQuantity) -> float:
    """Return how far the end of what is behind a slot is from the start of what is before it; NaN if unknown."""
    known = np.flatnonzero(past.slots[device])
    before, behind = known[known < slot], known[known >= slot]
    at = [np.array([int(half)]) for half in (before[(len(before) - 1) // 2] + 1, behind[len(behind) // 2])]
    change = past.change(at[0], at[1])
    return float((change - _common(change, side, quantity))[device, 0])


def _common(values: Array, side: Array, quantity: EscQuantity) -> Array:
    """Return what the others have in common, for each device; nothing where there are too few to tell."""
    found = np.full(values.shape, np.nan)
    for which in (False, True):
        mine = np.flatnonzero(side == which)
        if len(mine):
            found[mine] = others(values[mine].T).T
    if len(values) < FEWEST and quantity.key not in _NEEDS_OTHERS:
        return np.zeros(values.shape)
    return found


def _peers(course: QuantityCourse, upper: Array) -> list[_Candidate]:
    """Return how far each device is from the others of its group."""
    found = []
    for which in (False, True):
        mine = np.flatnonzero(upper == which)
        level = course.level[mine]
        z = against_others(level, _tolerated(course.quantity))
        apart = level - others(level)
        same = np.abs(_since_middle(course.past)[mine]) < np.abs(apart) / 2
        found += [
            _Candidate(int(mine[k]), course, float(z[k]), course.quantity.difference(float(apart[k])), None)
            for k in np.flatnonzero(np.isfinite(z) & same).tolist()
        ]
    return found


def _since_middle(past: QuantityPast) -> Array:
    """Return how much each device changed since the middle, more than the others did; NaN if that is not known."""
    found = np.full(len(past.series), np.nan)
    for k, known in enumerate(past.slots):
        at = np.array([_last_half(known, 0)])
        change = past.change(at, at)[:, 0]
        found[k] = change[k] - np.nan_to_num(others(change)[k])
    return found


def _told(
    group: Sequence[EscCells], candidates: Sequence[_Candidate], limit: float, flights: Sequence[Flight], width: int
) -> Iterator[OddEsc]:
    """Yield the candidates that are far enough: against the own past, and against peers what the past does not tell."""
    changed = set()
    alone = threshold("odd_alone") if len(group) < FEWEST else 1.0
    for one in candidates:
        quantity = one.course.quantity
        key = one.device, quantity.name
        far = abs(one.z) >= limit and abs(one.difference) >= quantity.least * alone
        if not far or key in changed:
            continue
        device = group[one.device]
        bus, node, _ = split(device.key)
        slot = int(np.argmax(device.first[0] < NEVER)) if one.slot is None else one.slot
        ran, t = (int(times[slot]) for times in device.first)
        if one.slot is not None:
            changed.add(key)
            ran, t = _begun(ran, t, width, flights)
        gist, text = odd_words(quantity, one.difference, None if one.slot is None else ran, flights)
        yield OddEsc(
            bus, node, device.ch, quantity.name, round(one.difference, 3), quantity.unit,
            round(one.z, 2), PEERS if one.slot is None else OWN_PAST, t, ran, gist, text,
        )  # fmt: skip


def _begun(ran: int, t: int, width: int, flights: Sequence[Flight]) -> tuple[int, int]:
    """Return since when a change is: since a flight began, if that was nearly then."""
    for flight in flights[1:]:
        if abs(flight.first.ran - ran) <= _NEAR * width:
            return flight.first.ran, flight.first.t
    return ran, t


def _last_half(slots: Array, slot: int) -> int:
    """Return where the second half of the slots behind one begins that have something."""
    behind = np.flatnonzero(slots[slot:])
    return slot + int(behind[len(behind) // 2]) if len(behind) else slot


def _limit(comparisons: int) -> float:
    """Return how many standard deviations chance reaches seldom enough in so many comparisons."""
    from statistics import NormalDist  # noqa: PLC0415 - asked at the end, of few captures

    share = threshold("odd_chance") / (2 * max(comparisons, 1))
    return max(threshold("odd_least_z"), NormalDist().inv_cdf(1 - share))


def _tolerated(quantity: EscQuantity) -> float:
    return quantity.tolerated / quantity.scale


def _gap(course: QuantityCourse, upper: Array) -> float:
    """Return how far two groups are apart, in the unit of the quantity."""
    gap = np.nanmedian(course.level[upper]) - np.nanmedian(course.level[~upper])
    return course.quantity.difference(float(gap))


def _names(group: Sequence[EscCells], which: Array) -> list[str]:
    chs = [one.ch for one, mine in zip(group, which.tolist(), strict=True) if mine]
    nodes = [split(one.key)[1] for one, mine in zip(group, which.tolist(), strict=True) if mine]
    return [f"ch{ch}" if ch is not None else f"node {node}" for ch, node in zip(chs, nodes, strict=True)]


def _compared(group: Sequence[EscCells], told: Sequence[QuantityCourse]) -> Iterator[ComparedEsc]:
    for place, device in enumerate(group):
        bus, node, _ = split(device.key)
        levels: dict[str, Any] = dict.fromkeys(one.key for one in QUANTITIES)
        for course in told:
            value = course.quantity.difference(float(course.level[place]))
            levels[course.quantity.key] = None if np.isnan(value) or len(group) < 2 else round(value, 3)
        reports = int(device.numbers("came").sum())
        yield ComparedEsc(bus, node, device.ch, reports, levels)
