"""Where in the commands of a bus the outputs of an autopilot may lie: places to look at more closely."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.autopilot.track import Signal
    from dissectors.kit import Array

GRID = 0.02  # seconds: finer is not needed to find a place, and slower moves tell it
SLOWEST = 4.0  # seconds: slower moves are left out, all flights have them
MOST_ROWS = 4  # channels that a place is searched by: with more it is not found better
MOST_CANDIDATES = 24  # by each of two measures
_NEAR = 3  # grid steps that are one place


@dataclass(frozen=True, slots=True)
class _Gridded:
    """A signal on a grid, without its slow moves; `has` is 1 where there is something."""

    start: float
    values: Array
    has: Array


class CommandSearch:
    """The commands of a piece, made ready for several searches."""

    def __init__(self, commands: Signal) -> None:
        self._bus = _gridded(commands, float(commands.time[0]), float(commands.time[-1]))
        self._square = (self._bus.values**2).sum(axis=0)
        self._spectra: dict[int, tuple[Array, Array, Array]] = {}

    @property
    def places(self) -> int:
        """How many places there are in it."""
        return len(self._bus.has)

    def candidates(self, outputs: Signal) -> Iterator[float]:
        """Yield what is to be added to the times of outputs, the most likely first; rows are the same channels."""
        log = _gridded(outputs, float(outputs.time[0]), float(outputs.time[-1]))
        count, width = len(self._bus.has), len(log.has)
        size = 1 << (count + width).bit_length()
        values, square, has = self._of(size)
        x = np.fft.rfft(log.values, size)
        cross = np.fft.irfft((values * x.conj()).sum(axis=0), size)
        power = np.fft.irfft(square * np.fft.rfft(log.has, size).conj(), size)
        mine = np.fft.irfft(has * np.fft.rfft((log.values**2).sum(axis=0), size).conj(), size)
        shared = np.fft.irfft(has * np.fft.rfft(log.has, size).conj(), size)
        least = 1e-6 * max(float(mine.max()), 1e-9)
        sound = (power > 1e-9 * max(float(power.max()), 1e-9)) & (mine > least) & (shared > 1.5) & (cross > 0)
        explained = np.where(sound, cross**2 / np.maximum(power, 1e-12), 0)
        r = np.sqrt(np.clip(explained / np.maximum(mine, least), 0, 0.9999))
        alike = np.where(sound, np.arctanh(r) * np.sqrt(np.maximum(shared, 0)), 0)
        for lag in _best(explained, alike):
            steps = lag if lag < count else lag - size
            yield self._bus.start - log.start + steps * GRID

    def _of(self, size: int) -> tuple[Array, Array, Array]:
        if size not in self._spectra:
            parts = self._bus.values, self._square, self._bus.has
            self._spectra[size] = tuple(np.fft.rfft(part, size) for part in parts)  # type: ignore[assignment]
        return self._spectra[size]


def _best(*measures: Array) -> Iterator[int]:
    """Yield the places at which any of the measures is highest, each once."""
    seen: set[int] = set()
    rows = [_peaks(measure) for measure in measures]
    for place in range(MOST_CANDIDATES):
        for row in rows:
            if place < len(row) and not seen.intersection(range(row[place] - _NEAR, row[place] + _NEAR + 1)):
                seen.add(row[place])
                yield row[place]


def _peaks(measure: Array) -> list[int]:
    """Return the highest local maxima, the highest first."""
    peaks = np.flatnonzero((measure > 0) & (measure >= np.roll(measure, 1)) & (measure >= np.roll(measure, -1)))
    if len(peaks) > MOST_CANDIDATES:
        peaks = peaks[np.argpartition(measure[peaks], -MOST_CANDIDATES)[-MOST_CANDIDATES:]]
    found: list[int] = peaks[np.argsort(-measure[peaks], kind="stable")].tolist()
    return found


def _gridded(signal: Signal, start: float, end: float) -> _Gridded:
    size = int((end - start) / GRID) + 1
    cell = np.clip(((signal.time - start) / GRID).astype(np.int64), 0, size - 1)
    rows = signal.values[:MOST_ROWS]
    good = ~np.isnan(rows).any(axis=0)
    cell = cell[good]
    count = np.bincount(cell, minlength=size)
    has = (count > 0).astype(np.float64)
    sums = np.array([np.bincount(cell, row[good], size) for row in rows])
    values = sums / np.maximum(count, 1)
    return _Gridded(start, (values - _slow(values, has)) * has, has)


def _slow(values: Array, has: Array) -> Array:
    """Return the running means of rows."""
    half = round(SLOWEST / GRID / 2)
    low = np.maximum(np.arange(len(has)) - half, 0)
    high = np.minimum(np.arange(len(has)) + half + 1, len(has))
    sums = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values * has, axis=1)], axis=1)
    counts = np.concatenate([[0.0], np.cumsum(has)])
    found: Array = (sums[:, high] - sums[:, low]) / np.maximum(counts[high] - counts[low], 1)
    return found
