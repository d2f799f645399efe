"""The supply voltage that a current explains: V0 - R*I, fitted to what a device reported before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

_FIRST, _SHARE, _MOST = 32, 4, 1024  # as a past of motors is drawn
_LEAST_SPREAD = 2.0  # A of standard deviation, below which nothing is known of a resistance
_HALF = 4096  # reports after which what came before counts half


class SupplyLine:
    """Sums over reports. What is expected depends on how many came before, not on how they came."""

    def __init__(self) -> None:
        self._count = 0
        self._next = _FIRST
        self._sums = np.zeros(5)  # one, I, V, I*I, I*V
        self._drawn: tuple[float, float] | None = None
        self._older: tuple[float, float] | None = None

    def feed(self, volts: Array, amperes: Array) -> Array:
        """Take reports of one device, in order; return what was to be expected of each, NaN where nothing is known."""
        expected = np.full(len(volts), np.nan)
        start = 0
        while start < len(volts):
            count = min(len(volts) - start, self._next - self._count)
            part = slice(start, start + count)
            v, i = volts[part], amperes[part]
            if self._older is not None:
                expected[part] = self._older[0] + self._older[1] * i
            good = np.isfinite(v) & np.isfinite(i)
            v, i = v[good], i[good]
            self._sums += (len(v), i.sum(), v.sum(), (i * i).sum(), (i * v).sum())
            self._count += count
            start += count
            if self._count == self._next:
                self._draw()
        return expected

    def _draw(self) -> None:
        self._next += min(max(_FIRST, self._count // _SHARE), _MOST)
        self._older = self._drawn
        one, i, v, ii, iv = self._sums.tolist()
        if one >= _FIRST:
            spread = ii / one - (i / one) ** 2
            slope = (iv / one - i * v / one / one) / spread if spread > _LEAST_SPREAD**2 else None
            self._drawn = None if slope is None or slope > 0 else (v / one - slope * i / one, slope)
        if one > _HALF:
            self._sums /= 2
