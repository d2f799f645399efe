"""Commands of ESCs while their motors are driven: what one needs beyond the others is its own.

The longer capture counts as long as the shorter one: who climbs needs more than who hovers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.flight.thresholds import threshold
from analyzer.report.comparison.model import Difference
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.samples import EscKey, EscRows
    from dissectors.kit import Array

_WHAT = "command, median"


@dataclass(frozen=True, slots=True)
class _Driven:
    """Medians of an ESC's command in both captures, in percent, and how many reports they are drawn from."""

    good: float
    bad: float
    counts: tuple[int, int]

    @property
    def by(self) -> float:
        """How much more it is in the second one."""
        return self.bad - self.good


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield what all ESCs have in common, then who is given more or less beyond that."""
    driven = _driven(pair)
    limit, enough = pair.limits["commanded_least"], len(driven) >= pair.limits["peers"]
    common = float(np.median([one.by for one in driven.values()])) if enough else 0.0
    if abs(common) > limit:
        middle = min(driven.values(), key=lambda one: abs(one.by - common))
        yield Difference(
            kind="telemetry", weight="note", who=f"all {len(driven)} ESCs", bus="", node=None,
            remark="load, charge, or another way to fly", **_words(pair, middle, common / limit),
        )  # fmt: skip
    for key, one in driven.items():
        own = one.by - common
        if abs(own) > limit:
            others = f"others {common:+.0f} %" if round(common) else ""
            yield pair.of_node(
                key[:2], kind="telemetry", weight="warning", remark=others, **_words(pair, one, own / limit)
            )


def _words(pair: Pair, one: _Driven, size: float) -> dict[str, Any]:
    good, bad = one.counts
    return {
        "what": _WHAT,
        "good": f"{one.good:.0f} %",
        "bad": f"{one.bad:.0f} %",
        "good_value": round(one.good, 2),
        "bad_value": round(one.bad, 2),
        "unit": "%",
        "good_count": good,
        "bad_count": bad,
        "size": round(abs(size), 2),
        "support": pair.support(abs(size), min(one.counts), pair.limits["reports"], complete=True),
    }


def _driven(pair: Pair) -> dict[EscKey, _Driven]:
    """Return the ESCs whose motors were driven for long enough in both captures, by that of the second."""
    found = {}
    for key, rows, other in pair.escs():
        (began, before), (begun, after) = _commands(rows), _commands(other)
        if not (len(before) and len(after)):
            continue
        shared = min(began[-1], begun[-1])
        before, after = before[began <= shared], after[begun <= shared]
        if min(len(before), len(after)) >= pair.limits["reports"]:
            medians = float(np.median(before)), float(np.median(after))
            found[key] = _Driven(*medians, (len(before), len(after)))
    return found


def _commands(rows: EscRows) -> tuple[Array, Array]:
    """Return the commands of a motor that is driven, and how long it has been by then, in ns."""
    t, values = rows.arrays()
    driven = values[:, 0] > threshold("command_idle_percent")
    t = np.maximum.accumulate(t[driven])  # where a clock was set back
    return t - t[:1], values[driven, 0]
