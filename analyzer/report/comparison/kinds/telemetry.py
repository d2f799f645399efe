"""Telemetry of ESCs at equal command: medians in narrow ranges of it, each ESC against itself and then its peers.

An ESC is compared with its own past first; what all of them have in common (another pack, another day) is told once,
and what one has beyond that is its own. Temperatures are compared after as long a time, too. Each quarter of a capture
is compared beside the whole of it, so that what begins late is seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from analyzer.report.comparison.model import Difference
from analyzer.report.comparison.samples import QUANTITIES
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.report.comparison.model import Weight
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.samples import EscKey
    from dissectors.kit import Array

_UNITS = {"rpm": "rpm", "current": "A", "voltage": "V", "temperature": "degC", "reported": "%"}
_WORDS = {"rpm": "speed", "reported": "command received"}
_COMMON: dict[str, Weight] = {"temperature": "note", "voltage": "note"}  # of all ESCs: the day, the charge
_OTHERS = {"temperature": "weather, or how warm it was", "voltage": "charge or another pack"}
_AGES = np.array([10, 30, 60, 120, 300, 600, 1200, 2400]) * SECOND  # how long it has run: in ranges
_AGE = 1000  # more than there are ranges
_PARTS = 4
_BEYOND = 1.5  # times what comes and goes inside one capture
_LASTING = 0.8  # of the reports behind its onset show it
_RUN = 8  # reports that show it together, and it is no chance
_EARLY = 0.05  # of the reports: it was there from the start


@dataclass(frozen=True, slots=True)
class _Shift:
    """How far one ESC's quantity lies off, as the median over ranges; the range of that median says so in numbers.

    `counts` are reports in this range, `reports` those that all ranges have in both captures; `good_part` says that it
    is a part of the first capture that lies off.
    """

    by: float
    limit: float
    good: float
    bad: float
    command: float
    counts: tuple[int, int]
    reports: int
    good_part: bool


@dataclass(frozen=True, slots=True)
class _Cut:
    """The whole of one capture, 0 or 1, or a quarter of it."""

    side: int
    part: int | None = None


@dataclass(frozen=True, slots=True)
class _Esc:
    """One ESC in both captures: times, values by row, and the range of command that each row is in."""

    t: tuple[Array, Array]
    values: tuple[Array, Array]
    ranges: tuple[Array, Array]
    ages: tuple[Array, Array]

    def places(self, side: int, quantity: str) -> Array:
        """Return what each row is compared under, below 0 for nothing: its range, for temperatures its age too."""
        ranges, ages = self.ranges[side], self.ages[side]
        places: Array = np.where(ranges >= 0, ranges + ages * _AGE, -1) if quantity == "temperature" else ranges
        return places


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them."""
    escs = _escs(pair)
    for quantity in QUANTITIES:
        whole = _shifts(pair, escs, quantity, _Cut(0), _Cut(1))
        common = _common(pair, whole)
        found = {key: (one, one.by - common) for key, one in whole.items() if abs(one.by - common) > one.limit}
        if whole:
            middle, shift = min(whole.items(), key=lambda one: abs(one[1].by - common))
            if abs(common) > shift.limit:
                yield _of_all(pair, quantity, escs[middle], shift, len(whole))
        for key, late in _of_parts(pair, escs, quantity).items():
            found.setdefault(key, late)
        for key, (shift, own) in found.items():
            yield _of_one(pair, key, escs[key], quantity, shift, own)


def compared(pair: Pair) -> tuple[int, int]:
    """Return how many ESCs are compared, and from how many reports."""
    escs = _escs(pair)
    ready = [esc for esc in escs.values() if any(_shift(pair.limits, esc, q, _Cut(0), _Cut(1)) for q in QUANTITIES)]
    return len(ready), sum(min(len(esc.t[0]), len(esc.t[1])) for esc in ready)


def _escs(pair: Pair) -> dict[EscKey, _Esc]:
    """Return the ESCs of both captures by that of the second."""
    found = {}
    for key, rows, other in pair.escs():
        both = rows.arrays(), other.arrays()
        width = pair.limits["command"]
        ranges = [np.where(np.isnan(v[:, 0]), -1, np.rint(np.nan_to_num(v[:, 0]) / width)).astype(int) for _, v in both]
        starts = [side.start or 0 for side in (pair.good, pair.bad)]
        ages = [np.searchsorted(_AGES, t - start) for (t, _), start in zip(both, starts, strict=True)]
        found[key] = _Esc(
            (both[0][0], both[1][0]), (both[0][1], both[1][1]), (ranges[0], ranges[1]), (ages[0], ages[1])
        )
    return found


def _shifts(pair: Pair, escs: Mapping[EscKey, _Esc], quantity: str, here: _Cut, there: _Cut) -> dict[EscKey, _Shift]:
    """Return the shifts of all ESCs that have enough reports."""
    found = {key: _shift(pair.limits, esc, quantity, here, there) for key, esc in escs.items()}
    return {key: shift for key, shift in found.items() if shift is not None}


def _common(pair: Pair, shifts: Mapping[EscKey, _Shift]) -> float:
    """Return what all ESCs have in common; nothing where they are too few to tell."""
    if len(shifts) < pair.limits["peers"]:
        return 0.0
    return float(np.median([one.by for one in shifts.values()]))


def _of_parts(pair: Pair, escs: Mapping[EscKey, _Esc], quantity: str) -> dict[EscKey, tuple[_Shift, float]]:
    """Return what lies off in a quarter of one capture, by more than anything does inside the other one."""
    found: dict[EscKey, tuple[_Shift, float]] = {}
    for side in (0, 1):
        usual: dict[EscKey, float] = {}
        for part in range(_PARTS):
            for key, _, own in _own(pair, escs, quantity, _Cut(1 - side), _Cut(1 - side, part)):
                usual[key] = max(usual.get(key, 0.0), abs(own))
        for part in range(_PARTS):
            cuts = (_Cut(0), _Cut(1, part)) if side else (_Cut(0, part), _Cut(1))
            for key, one, own in _own(pair, escs, quantity, *cuts):
                if abs(own) > max(one.limit, _BEYOND * usual.get(key, 0.0)) and (
                    key not in found or abs(own) > abs(found[key][1])
                ):
                    found[key] = one, own
    return found


def _own(
    pair: Pair, escs: Mapping[EscKey, _Esc], quantity: str, here: _Cut, there: _Cut
) -> Iterator[tuple[EscKey, _Shift, float]]:
    """Yield the shift of each ESC, and how much of it is its own."""
    shifts = _shifts(pair, escs, quantity, here, there)
    common = _common(pair, shifts)
    yield from ((key, one, one.by - common) for key, one in shifts.items())


def _shift(limits: Mapping[str, float], esc: _Esc, quantity: str, here: _Cut, there: _Cut) -> _Shift | None:
    """Return how far a cut lies off another one; None for too few reports at equal command."""
    column = 1 + QUANTITIES.index(quantity)
    sides = []
    for cut in (here, there):
        values, where = esc.values[cut.side], esc.places(cut.side, quantity)
        rows = np.flatnonzero((where >= 0) & ~np.isnan(values[:, column]))
        if cut.part is not None:
            rows = np.array_split(rows, _PARTS)[cut.part]
        sides.append((where[rows], values[rows, column].astype(np.float64)))
    (mine_at, mine), (theirs_at, theirs) = sides
    least = limits["samples"]
    found = []
    for one in np.intersect1d(mine_at, theirs_at).tolist():
        a, b = mine[mine_at == one], theirs[theirs_at == one]
        if min(len(a), len(b)) >= least:
            before, after = float(np.median(a)), float(np.median(b))
            found.append((after - before, before, after, one, len(a), len(b)))
    reports = sum(min(one[4], one[5]) for one in found)
    if reports < limits["reports"]:
        return None
    found.sort()
    weights = np.cumsum([min(one[4], one[5]) for one in found])
    by, good, bad, where, *counts = found[int(np.searchsorted(weights, weights[-1] / 2))]
    limit = max(limits[quantity] * max(abs(good), abs(bad)), limits[f"{quantity}_least"])
    command, part = where % _AGE * limits["command"], here.part is not None
    return _Shift(by, limit, good, bad, command, (counts[0], counts[1]), reports, part)


def _of_one(pair: Pair, key: EscKey, esc: _Esc, quantity: str, shift: _Shift, own: float) -> Difference:
    since, t = ("", None) if shift.good_part else _onset(pair.limits, esc, quantity, shift, own)
    size = abs(own) / shift.limit
    others = _signed(shift.by - own, quantity)
    others = others and f"others {others}"
    part = "in a part of the first capture" if shift.good_part else ""
    one = pair.of_node(
        key[:2], kind="telemetry", weight="warning", size=round(size, 2), since=since, t_ns=t,
        remark="; ".join(filter(None, (others, part))),
        support=pair.support(size, shift.reports, pair.limits["reports"], complete=True), **_words(quantity, shift),
    )  # fmt: skip
    return pair.placed(one)


def _of_all(pair: Pair, quantity: str, esc: _Esc, shift: _Shift, many: int) -> Difference:
    size = abs(shift.by) / shift.limit
    since, t = _onset(pair.limits, esc, quantity, shift, shift.by)
    one = Difference(
        kind="telemetry", weight=_COMMON.get(quantity, "warning"), who=f"all {many} ESCs", bus="", node=None,
        size=round(size, 2), remark=_OTHERS.get(quantity, ""), since=since, t_ns=t,
        support=pair.support(size, shift.reports, pair.limits["reports"], complete=True), **_words(quantity, shift),
    )  # fmt: skip
    return pair.placed(one)


def _words(quantity: str, shift: _Shift) -> dict[str, Any]:
    unit = _UNITS[quantity]
    return {
        "what": f"{_WORDS.get(quantity, quantity)} at {shift.command:.0f} %",
        "good": f"{_number(shift.good, quantity)} {unit}",
        "bad": f"{_number(shift.bad, quantity)} {unit}",
        "good_value": round(shift.good, 4),
        "bad_value": round(shift.bad, 4),
        "unit": unit,
        "good_count": shift.counts[0],
        "bad_count": shift.counts[1],
    }


def _number(value: float, quantity: str) -> str:
    return f"{value:.0f}" if quantity in ("rpm", "temperature", "reported") else f"{value:.1f}"


def _signed(value: float, quantity: str) -> str:
    """Return a shift with its sign and unit; nothing for what rounds to none."""
    size = _number(abs(value), quantity)
    return f"{'+' if value > 0 else '-'}{size} {_UNITS[quantity]}" if float(size) else ""


def _onset(
    limits: Mapping[str, float], esc: _Esc, quantity: str, shift: _Shift, own: float
) -> tuple[Literal["throughout", "from"], int | None]:
    """Return since when the second capture's reports lie off what the first one's were where both can be compared.

    What counts in shares grows with the value: where it is too small to show anything, reports say nothing.
    """
    column, common = 1 + QUANTITIES.index(quantity), shift.by - own
    (mine_at, theirs_at), t = (esc.places(side, quantity) for side in (0, 1)), esc.t[1]
    mine, theirs = (values[:, column] for values in esc.values)
    off, grows = np.full(len(theirs), np.nan), limits[quantity] > 0 and shift.good
    for one in np.unique(theirs_at[theirs_at >= 0]).tolist():
        usual = mine[(mine_at == one) & ~np.isnan(mine)]
        if len(usual) >= limits["samples"]:
            middle = float(np.median(usual))
            scale = abs(middle / shift.good) if grows else 1.0
            if shift.limit * scale >= limits[f"{quantity}_least"]:
                off[theirs_at == one] = (theirs[theirs_at == one] - middle - common) / scale
    rows = np.flatnonzero(~np.isnan(off))
    if len(rows) < _RUN or not t[rows].any():
        return "throughout", None
    shows = off[rows] * np.sign(own) > shift.limit / 2
    behind = np.cumsum(shows[::-1])[::-1] / np.arange(len(shows), 0, -1)
    run = np.lib.stride_tricks.sliding_window_view(shows, _RUN).mean(axis=1) >= _LASTING
    begins = shows[: len(run)] & run
    lasting = np.flatnonzero(begins & (behind[: len(run)] >= _LASTING))
    found = lasting if len(lasting) else np.flatnonzero(begins)
    if not len(found) or found[0] <= _EARLY * len(shows):
        return "throughout", None
    return "from", int(t[rows[int(found[0])]])
