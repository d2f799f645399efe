"""Transfers that come again after later ones: their IDs seem to count back, and on from where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.counters.id_patterns import MOST_MOVED
from analyzer.rules.counters.id_steps import GAP, RESTARTED
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME, SESSION

if TYPE_CHECKING:
    from analyzer.rules.counters.id_steps import IdStep
    from dissectors.kit import View

LOOK = 4096  # frames before a copy among which those are that it repeats


def time_before(back: IdStep, on: IdStep, view: View) -> int:
    """Return when what a step back repeats was there, if the next odd step of its session counts on; else `NO_TIME`.

    Of 5, 6, 5, 7 the steps are (6, 5) and (5, 7). Each frame of the copy has to be there already, byte for byte.
    """
    behind = (back.before - back.transfer_id) % TRANSFER_IDS
    again = (on.before - back.transfer_id) % TRANSFER_IDS
    fits = back.rule in (GAP, RESTARTED) and 0 < behind <= MOST_MOVED and again < behind
    if not fits or on.rule != GAP or on.transfer_id != (back.before + 1) % TRANSFER_IDS:
        return NO_TIME
    return NO_TIME if back.t == NO_TIME else _time_before(back, view)


def _time_before(one: IdStep, view: View) -> int:
    """Return when the first frame was there before, NO_TIME if not all frames were."""
    wanted = [view.frame(number) for number in one.frames]
    first, session = one.frames[0], wanted[-1]
    if session is None:
        return NO_TIME
    for number in reversed(view.numbers_between(first - LOOK, first, session.bus, session.id & SESSION)):
        like, kept = wanted[-1], view.frame(number)
        if like is None or kept is None:
            return NO_TIME
        if (kept.bus, kept.id, kept.data) == (like.bus, like.id, like.data):
            wanted.pop()
            if not wanted:
                return kept.t
    return NO_TIME
