"""Transfers that come again after later ones: their IDs seem to count back, and on from where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.transfers.id_patterns import MOST_MOVED
from analyzer.rules.transfers.id_steps import COPIED, GAP, RESTARTED
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import MILLISECOND, NO_TIME, SESSION

if TYPE_CHECKING:
    from analyzer.rules.transfers.id_steps import IdStep
    from dissectors.kit import View

LOOK = 4096  # frames before a copy among which those are that it repeats


def see_copy(held: list[IdStep], view: View, near: int) -> None:
    """Make one of the last two of a session's steps, among so many, if both are of a transfer that came again."""
    last = len(held) - 1
    before = range(last - 1, max(last - near, 0) - 1, -1)
    at = next((k for k in before if held[k].session == held[last].session), None)
    copy = None if at is None else _as_copy(held[at], held[last], view)
    if at is not None and copy is not None:
        held[at] = copy
        held.pop()


def _as_copy(back: IdStep, on: IdStep, view: View) -> IdStep | None:
    """Return a step back as that to a copy, if the next odd step of its session counts on behind it.

    Of 5, 6, 5, 7 the steps are (6, 5) and (5, 7). Each frame of the copy has to be there already, byte for byte.
    """
    behind = (back.before - back.transfer_id) % TRANSFER_IDS
    again = (on.before - back.transfer_id) % TRANSFER_IDS
    fits = back.rule in (GAP, RESTARTED) and 0 < behind <= MOST_MOVED and again < behind
    if not fits or on.rule != GAP or on.transfer_id != (back.before + 1) % TRANSFER_IDS:
        return None
    t = _time_before(back, view)
    if NO_TIME in (t, back.t):
        return None
    values = {"transfer_id": back.transfer_id, "expected": back.values["expected"]}
    return back._replace(rule=COPIED, severity=None, values={**values, "milliseconds": (back.t - t) / MILLISECOND})


def _time_before(one: IdStep, view: View) -> int:
    """Return when the first frame was there before, NO_TIME if not all frames were."""
    wanted = [view.frame(number) for number in one.frames]
    first, session = one.frames[0], wanted[-1]
    if session is None:
        return NO_TIME
    for number in view.numbers_before(first, LOOK, session.bus, session.id & SESSION):
        like, kept = wanted[-1], view.frame(number)
        if like is None or kept is None:
            return NO_TIME
        if (kept.bus, kept.id, kept.data) == (like.bus, like.id, like.data):
            wanted.pop()
            if not wanted:
                return kept.t
    return NO_TIME
