"""Since when frames have come without a gap, of many times at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from dissectors.kit import Array, View


def all_resumed(view: View, t: Array) -> Array:
    """Return `View.resumed` of times, arbitrary of `NO_TIME`."""
    timed = t[t != NO_TIME]
    last = view.resumed(int(timed.max())) if len(timed) else NO_TIME
    if not len(timed) or view.resumed(int(timed.min())) == last:
        return np.full(len(t), last)
    return np.array([view.resumed(one) for one in t.tolist()])
