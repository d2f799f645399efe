"""Calculating with columns of numbers: whole ones in 64 bits, and as floats where these do not hold them."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit.cells import floats

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.kit import Array

_LEAST, _MOST = np.iinfo(np.int64).min, np.iinfo(np.int64).max


def signed(values: Array) -> Array:
    """Return numbers that can become negative: integers of 64 bits, or floats if these do not hold them."""
    found = np.asarray(values)
    real = found.dtype.kind == "f" or (found.dtype == np.uint64 and bool(found.size) and found.max() > _MOST)
    return floats(found) if real else found.astype(np.int64)


def calculated(make: Callable[[Any, Any], Any], a: Array, b: Array) -> Array:
    """Return sums, differences or products: of whole numbers exactly, unless they are too large for that."""
    a, b = signed(a), signed(b)
    if "f" not in (a.dtype.kind, b.dtype.kind) and a.size and b.size:
        ends = [(int(one.min()), int(one.max())) for one in (a, b)]
        if not all(_LEAST <= make(*pair) <= _MOST for pair in product(*ends)):
            a, b = floats(a), floats(b)
    found: Array = make(a, b)
    return found


def masked(a: Array, b: Array) -> Array:
    """Return the bits that both of two whole numbers have."""
    a, b = np.asarray(a), np.asarray(b)
    kind = np.uint64 if np.uint64 in (a.dtype, b.dtype) else np.int64
    found: Array = a.astype(kind) & b.astype(kind)
    return found


def divided(a: Array, b: Array) -> tuple[Array, Array]:
    """Return quotients, of integers without what is behind the point, and where there is one."""
    whole = "f" not in (np.asarray(a).dtype.kind, np.asarray(b).dtype.kind)
    a, b = signed(a), signed(b)
    good = np.broadcast_to(b != 0, np.broadcast_shapes(a.shape, b.shape))
    safe = np.where(b == 0, 1, b)
    if a.dtype.kind == "f" or b.dtype.kind == "f":
        return np.trunc(a / safe) if whole else a / safe, good
    return np.where((a < 0) == (safe < 0), 1, -1) * (np.abs(a) // np.abs(safe)), good


def rest(a: Array, b: Array) -> tuple[Array, Array]:
    """Return remainders with the sign of what is divided, and where there is one."""
    a, b = signed(a), signed(b)
    good = np.broadcast_to(b != 0, np.broadcast_shapes(a.shape, b.shape))
    return np.fmod(a, np.where(b == 0, 1, b)), good
