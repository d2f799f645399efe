"""Where frames of senders are missing, in columns: a bus full of faults has very many such places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, by_key

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.bus.keyed import KeyedRows
    from dissectors.kit import Array

UNASKED = 255  # in place of what is `seen`
_SWAPPED = 100 * MILLISECOND  # within which a frame that was overtaken is still to come


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


# The latest one of a session: its second frame, and what of it decides about the next one.
LATEST = {"behind": -1, "until": 0, "wanted": -1, "void": 0}


def compared(new: LackRows, latest: KeyedRows) -> tuple[LackRows, Array]:
    """Take back what was missing if it comes now, and so what is odd about the frames around it.

    Return the rows, and the second frames of those from before that are void now, too. `latest` has `LATEST` of
    each session, which become the last ones of these.
    """
    if not len(new.session):
        return new, new.behind
    order, first = by_key(new.session)
    of = new.take(order)
    each = of.session[first]
    at = latest.find(each)
    before = {name: latest.get(name, at) for name in LATEST}
    past = [np.roll(column, 1) for column in (of.behind, of.until, of.wanted)]
    for column, name in zip(past, LATEST, strict=False):
        column[first] = before[name]
    behind, until, wanted = past
    returns = of.tail == wanted
    swaps = returns & (of.until - until <= _SWAPPED)
    goes_on = behind == of.number
    was = before["void"] != 0
    void = _in_turn(swaps, goes_on, first, was)
    back = first[swaps[first] & ~was]
    gone = behind[back]
    also = np.append(swaps[1:], False)
    also[first[1:] - 1] = False
    last = np.append(first[1:], len(order)) - 1
    latest.set(each, behind=of.behind[last], until=of.until[last], wanted=of.wanted[last], void=void[last])
    left, found = np.empty_like(behind), np.empty(len(order), bool)
    left[order], found[order] = np.where(returns, behind, -1), void | also
    return new._replace(left=left, void=found), gone


def _in_turn(swaps: Array, goes_on: Array, first: Array, was: Array) -> Array:
    """Return which are void, by what the one before each is: one that swaps if that is not, one that goes on if it is.

    `first` is where sessions begin, and `was` says so of the ones before these.
    """
    turns = swaps & ~goes_on
    settled = swaps == goes_on  # one way or the other
    value = swaps & goes_on
    settled[first] = True
    value[first] = np.where(was, goes_on[first], swaps[first])
    turns[first] = False
    at = np.maximum.accumulate(np.where(settled, np.arange(len(swaps)), 0))
    count = np.cumsum(turns)
    found: Array = value[at] ^ ((count - count[at]) % 2 != 0)
    return found
