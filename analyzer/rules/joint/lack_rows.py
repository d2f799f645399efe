"""Where frames of senders are missing, in columns: a bus full of faults has very many such places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

UNASKED = 255  # in place of what is `seen`


class LackRows(NamedTuple):
    """Frames of a session are missing between two of its frames, a row each: their numbers, times and places.

    `session` is a `Session.code`. A place counts the frames of the bus that have a sender and a time. `tail` is what
    the second frame has in its tail byte, `wanted` what it should have, `window` how far joint ones are apart at most,
    in ns, `left` the frame at which the session left off where it goes on now, or -1. `void` says that nothing is
    missing: frames only came in another order. `seen` is what `Repeats` found out of the frames around it.
    """

    session: Array
    node: Array
    number: Array
    behind: Array
    since: Array
    until: Array
    place: Array
    place_behind: Array
    tail: Array
    wanted: Array
    window: Array
    left: Array
    void: Array
    seen: Array

    @classmethod
    def none(cls) -> LackRows:
        """Return no rows."""
        kinds = {"void": bool, "seen": np.uint8}
        return cls._make(np.empty(0, kinds.get(name, np.int64)) for name in cls._fields)

    @classmethod
    def joined(cls, parts: Sequence[LackRows]) -> LackRows:
        """Return several, one after the other."""
        return parts[0] if len(parts) == 1 else cls(*map(np.concatenate, zip(cls.none(), *parts, strict=True)))

    def take(self, rows: Array | slice) -> LackRows:
        """Return some of them."""
        return LackRows(*(column[rows] for column in self))
