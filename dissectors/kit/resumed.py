"""Since when frames have come without a gap, of many times at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from dissectors.kit.array import Array
    from dissectors.kit.view import View


def all_resumed(view: View, t: Array) -> Array:
    """Return `View.resumed` of times, in ns, arbitrary of `NO_TIME`."""
    timed = t[t != NO_TIME]
    if not len(timed):
        return np.full(len(t), NO_TIME)
    begins = resumptions(view, int(timed.min()), int(timed.max()))
    found: Array = begins[np.maximum(np.searchsorted(begins, t, "right") - 1, 0)]
    return found


def resumptions(view: View, since: int, until: int) -> Array:
    """Return since when frames have come without a gap at a time, and then the ends of all gaps up to another one."""
    begins, end = [view.resumed(since)], view.resumed(until)
    later = []
    while end > begins[0]:
        later.append(end)
        end = view.resumed(end - 1)
    return np.array([*begins, *reversed(later)], np.int64)
