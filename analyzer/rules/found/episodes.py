"""Episodes: what a state that lasts was like when it began, and at its worst.

A run of occurrences is an episode where its rule says numbers (`Occurrences.worst`): how the run began and what was
worst in it is remembered, however many occurrences it has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import NO_TIME, SECOND
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dissectors.kit import Array, Occurrences, Values, Worst

# So many of its sender's periods before the end, it still lasts: the shortest time between two reports is one.
_PERIODS = 3
_TENTH = SECOND // 10
_NEVER = 1 << 62

# What NaN is compared with is worse.
_WORST: Mapping[str, Callable[[Array], float]] = {
    "lowest": lambda values: float(np.fmin.reduce(values)),
    "highest": lambda values: float(np.fmax.reduce(values)),
    "slowest": lambda values: _by_size(values, np.nanargmin),
    "strongest": lambda values: _by_size(values, np.nanargmax),
}


def _worst(kind: Worst, values: Array) -> float:
    """Return the worst of some numbers."""
    if isinstance(kind, str):
        return _WORST[kind](values)
    return _by_size(values, np.nanargmax, kind)


def _by_size(values: Array, choose: Callable[[Array], Any], middle: float = 0.0) -> float:
    """Return the number, with its sign, that is chosen by how far it is from the middle; NaN if there is no number."""
    size = np.abs(values - middle)
    return float(values[int(choose(size))]) if not np.isnan(size).all() else float("nan")


@dataclass(slots=True)
class Episode:
    """Of a run: the values of its first occurrence, the worst numbers, and how often its sender fell into the state.

    `risen` says that the first occurrence was one of these times; else the sender was in that state before. `apart` is
    the shortest time between two occurrences.
    """

    onset: Values
    kinds: Mapping[str, Worst]
    worst: dict[str, float]
    times: int
    risen: bool
    apart: int

    def copy(self) -> Episode:
        """Return one that grows apart from this."""
        return Episode(self.onset, self.kinds, dict(self.worst), self.times, self.risen, self.apart)

    def take(self, other: Episode, between: int, *, later: bool) -> None:
        """Join another one of the same key, that began `later` or earlier, so long `between` them."""
        for name, kind in self.kinds.items():
            self.worst[name] = _worst(kind, np.array([self.worst[name], other.worst[name]]))
        self.times += other.times
        self.apart = min(self.apart, other.apart, between if between > 0 else _NEVER)
        if not later:
            self.onset, self.risen = other.onset, other.risen

    def values(self, count: int, span: tuple[int, int], end: int, *, over: bool) -> Values:
        """Return what the text of a finding may name: values at onset, `worst_NAME`, and how long it `lasted`.

        Args:
            count: reports.
            span: times of the first and the last one.
            end: the time of the last frame of a capture that is `over`, or goes on.
            over: no more will come.
        """
        worst = {f"worst_{name}": value for name, value in self.worst.items()}
        return {**self.onset, **worst, "lasted": self._lasted(count, span, end, over=over)}

    def _lasted(self, count: int, span: tuple[int, int], end: int, *, over: bool) -> str:
        """Say how long, how often, and whether it lasts: up to the end, or so far."""
        first, last = span
        if NO_TIME in span:
            return f"in {count} reports"
        seconds = (last - first) / SECOND
        often = self.times + (not self.risen)
        length = f"{seconds:.2f} s" if seconds < 1 else f"{seconds:.1f} s"
        text = f"for {length}" if often == 1 else f"{often} times in {length}"
        lasts = end - last <= max(_PERIODS * self.apart, _TENTH)
        return text + (" to the end" if over else " so far") * lasts


def episode_of(found: Occurrences, rows: Array) -> Episode | None:
    """Return that of some rows, in order, still without its onset; None if the rule says no numbers."""
    if not found.worst:
        return None
    worst = {name: _worst(kind, values[rows]) for name, (kind, values) in found.worst.items()}
    kinds = {name: kind for name, (kind, _) in found.worst.items()}
    rises = np.zeros(len(found.t), bool) if found.rises is None else found.rises
    steps = np.diff(found.t[rows])
    apart = int(np.min(steps, initial=_NEVER, where=steps > 0))
    return Episode({}, kinds, worst, int(np.count_nonzero(rises[rows])), bool(rises[rows[0]]), apart)
