"""How well outputs and commands agree at a place, and how surely no other place is meant."""

from __future__ import annotations

from math import log10, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from analyzer.flight.autopilot.track import Signal
    from dissectors.kit import Array

APART = 0.1  # seconds over which moves are compared: autopilots log their outputs 10 times a second at least
AROUND = 0.06  # seconds around a candidate that are looked at: three steps of the search
GLANCE = 0.005  # seconds between places at a first look
RIVAL = 0.3  # seconds: agreement farther away is another place, nearer it is part of the error
PULSE = 10.0  # microseconds of a pulse for a percent of throttle: nearly so on every autopilot
_HOLD = 0.02  # seconds that a command holds: of one that was lost nothing is known
_SURE = 4.0  # standard deviations of what is unexplained: with more, a place is left out
_LEAST_MOVE = 2.0  # microseconds: pulses are whole ones, and moves by one or two say little
_BETTER = 2.0  # times less unexplained than anywhere else
_FINE = 48


class Match(NamedTuple):
    """A place: `shift` is added to the times of the outputs, `error` is how far off it may be, both in seconds.

    `moves` counts moves that are independent of each other, `unexplained` is their share that the commands do not have,
    `chance` the decimal logarithm of how likely it is that outputs of something else agree like this anywhere. What was
    compared is between `since` and `until`, seconds of the outputs.
    """

    shift: float
    error: float
    moves: float
    unexplained: float
    chance: float
    since: float
    until: float

    @property
    def middle(self) -> float:
        """The middle of what was compared."""
        return (self.since + self.until) / 2

    @property
    def proven(self) -> bool:
        """Return whether the outputs are those that made the commands, and nowhere else."""
        return (
            self.unexplained <= threshold("unexplained")
            and self.chance <= -threshold("chance_digits")
            and self.error <= threshold("align_error_s")
        )


class OutputMatch:
    """Outputs and commands of the same channels, row by row. `trials` is how many places there are to try."""

    def __init__(self, commands: Signal, outputs: Signal, trials: float) -> None:
        self._time, self._values = commands.time, commands.values
        self._period = max(float(np.median(np.diff(commands.time))), 1e-4) if len(commands) > 1 else _HOLD
        self._at = outputs.time
        spacing = float(np.median(np.diff(outputs.time))) if len(outputs) > 1 else APART
        self._far = max(1, round(APART / max(spacing, 1e-4)))
        self._moves = outputs.values[:, self._far :] - outputs.values[:, : -self._far]
        even = outputs.time[self._far :] - outputs.time[: -self._far] < 2.5 * max(APART, spacing * self._far)
        self._even = even & ~np.isnan(self._moves).any(axis=0)
        self._trials = trials
        self._size = _sizes(self._moves)
        usual = float(np.median(self._size[self._size > 0])) if (self._size > 0).any() else 0.0
        self._usual = max(usual, _LEAST_MOVE * sqrt(len(self._moves)))

    def near(self, shift: float, around: float = AROUND, step: float = 0.0) -> tuple[float, float]:
        """Return the best place around one, and what is unexplained there; `step` is for a first look."""
        shifts = self._shifts(shift - around, shift + around, step)
        left = self._unexplained(shifts)
        best = int(np.argmin(left))
        return float(shifts[best]), float(left[best])

    def at(self, shift: float, rivals: float = 1.0) -> Match:
        """Return the place at a shift that `near` found; `rivals` is the least unexplained of any place far from it."""
        step = max(GLANCE, self._period / 2)
        shifts = shift + step * np.arange(-round(RIVAL / step), round(RIVAL / step) + 1)
        left = self._unexplained(shifts)
        least = float(left.min())
        rows, _ = self._rows(float(shifts[int(np.argmin(left))]))
        moves = self._independent(rows)
        if moves <= 2 or least >= 1:
            return Match(shift, RIVAL, moves, least, 0.0, 0.0, 0.0)
        since, until = float(self._at[rows[0]]), float(self._at[rows[-1] + self._far])
        sure = 1 + _SURE * sqrt(2 / moves)
        level = least * sure
        near = shifts[left <= level]
        low, high = near[0] - step, near[-1] + step
        grain = (high - low) / (_FINE + round((near[-1] - near[0]) / step))
        fine = np.sort(np.append(np.arange(low, high, grain), shift))
        left = self._unexplained(fine)
        least = max(float(left.min()), 1e-9)
        inside = fine[left <= max(least, 1e-6) * sure]
        middle, half = (inside[0] + inside[-1]) / 2, (inside[-1] - inside[0]) / 2 + grain
        chance = (moves - 2) / 2 * log10(least) + log10(max(self._trials, 1))
        digits = moves / 2 * log10(max(rivals, 1e-9) / least)  # by which it is likelier than the next best place
        ambiguous = rivals < _BETTER * least or digits < threshold("chance_digits")
        error = RIVAL * 2 if ambiguous else float(half) + self._period
        return Match(float(middle), error, moves, least, chance, since, until)

    def _shifts(self, low: float, high: float, step: float = 0.0) -> Array:
        return np.linspace(low, high, max(3, 1 + round((high - low) / max(step, self._period / 2))))

    def _rows(self, shift: float) -> tuple[Array, Array]:
        """Return which moves of the outputs are compared at a shift, and the moves of the commands there."""
        hold = max(_HOLD, 3 * self._period)
        first, last = np.searchsorted(self._at, [self._time[0] - shift, self._time[-1] + hold - shift])
        if last - first <= self._far:
            return np.zeros(0, np.int64), self._moves[:, :0]
        t = self._at[first:last] + shift
        place = np.maximum(np.searchsorted(self._time, t, "right") - 1, 0)
        has = (t >= self._time[0]) & (t - self._time[place] <= hold)
        values = self._values[:, place]
        moves = values[:, self._far :] - values[:, : -self._far]
        has = has[self._far :] & has[: -self._far] & self._even[first : last - self._far]
        has &= ~np.isnan(moves).any(axis=0)
        return first + np.flatnonzero(has), moves[:, has]

    def _unexplained(self, shifts: Array) -> Array:
        left = np.ones(len(shifts))
        for k, shift in enumerate(shifts):
            rows, theirs = self._rows(float(shift))
            mine = self._moves[:, rows]
            # A take-off counts hardly more than what is usual in the air, on whatever side it is a little earlier.
            weight = 1 / (self._usual + np.maximum(self._size[rows], PULSE * _sizes(theirs)))
            mine, theirs = mine * weight, theirs * weight
            power = float((mine**2).sum()) * float((theirs**2).sum())
            both = float((mine * theirs).sum())
            if power > 0 and both > 0:
                left[k] = max(0.0, 1 - both * both / power)
        return left

    def _independent(self, rows: Array) -> float:
        """Return how many moves say something of their own: few large ones count little, slow ones too."""
        rows = rows[:: self._far]  # moves that do not overlap
        mine = self._moves[:, rows] / (self._usual + self._size[rows])
        size = (mine**2).sum(axis=0)
        if not size.any():
            return 0.0
        count = float(size.sum() ** 2 / (size**2).sum())
        alike = float(np.clip((mine[:, 1:] * mine[:, :-1]).sum() / size.sum(), 0, 0.99))
        return count * (1 - alike**2) / (1 + alike**2)


def _sizes(moves: Array) -> Array:
    """Return how large moves of all channels together are; 0 where they are not known."""
    found: Array = np.nan_to_num(np.sqrt((moves**2).sum(axis=0)))
    return found
