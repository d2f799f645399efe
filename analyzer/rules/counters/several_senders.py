"""The sessions of a node in which several devices send, by the starts of their transfers.

Transfers are told in the order of their ends, and what never ends is told late; only the starts say who counted how.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer._native import SessionCounters
from analyzer.rules.counters.id_steps import COPIED
from dissectors.kit import NO_TIME, SESSION

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.rules.counters.id_steps import IdStep
    from dissectors.kit import Array, View

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
_NEVER = 1 << 62


class Shared(NamedTuple):
    """A session that several devices share: what shows it, the time before the second one came, and frames of them."""

    evidence: str
    since: int
    frames: Sequence[int]


class _Chain(NamedTuple):
    """One sender's counter: its ID, the time before its first start, how often it took over; when it began, its frame.

    `begun` counts odd starts.
    """

    last: int
    since: int
    turns: int
    begun: int
    start: int | None


class SeveralSenders:
    """Follows the sessions of a node whose counters broke; `seen` is when one of several senders took over last."""

    def __init__(self) -> None:
        self._followed: dict[int, SessionCounters] = {}
        self.seen = NO_TIME

    def clear(self) -> None:
        """Forget all sessions."""
        self._followed.clear()

    def __contains__(self, place: object) -> bool:
        """Return whether a session is followed."""
        return place in self._followed

    def unfollowed(self, places: Iterable[int]) -> list[bool]:
        """Return which of some sessions are not followed."""
        return [place not in self._followed for place in places]

    def shows(self, place: int, number: int, view: View) -> int | None:
        """Take the starts of a session that is followed, up to a frame.

        Return the first start with which several senders show, None if they do not.
        """
        followed = self._followed[place]
        _read(followed, number, view)
        return self._next(followed, number, view)

    def shared(self, one: IdStep, view: View) -> Shared | None:
        """Return what shows several senders in a session, up to an odd step of it; None if one is enough."""
        followed = self._followed.get(one.place)
        if followed is None:
            start = one.frames[0], one.t, one.before, one.transfer_id, one.since
            kept = view.frame(one.frames[0])
            if kept is None or not kept.data:
                return None
            bus, bits, least = one.place >> 32, one.place & SESSION, int(view.number("BUS-010", "min_transfers"))
            followed = self._followed[one.place] = SessionCounters(bus, bits, start, kept.data, least)
            if one.rule != COPIED:
                followed.add(start, _gaps(view))
        number = one.frames[-1]
        _read(followed, number, view)
        while self._next(followed, number, view) is not None:
            pass
        return _shared(followed, one.code, view)

    def _next(self, followed: SessionCounters, number: int, view: View) -> int | None:
        """Return the next start up to a frame with which several senders show, and note who took over with it."""
        found = followed.shows(number, _gaps(view))
        if found is None:
            return None
        start, t, took_over = found
        if took_over:
            self.seen = t
        return start


def _read(followed: SessionCounters, number: int, view: View) -> None:
    """Read the frames that were not read yet, if a frame is among them."""
    if number >= followed.unread:
        for index in view.indexes(followed.unread, _NEVER):
            followed.read(index)


def _gaps(view: View) -> tuple[int, Array]:
    """Return what begins anew: nothing counts across a gap of the capture."""
    return view.start, view.gap_ends


def _shared(followed: SessionCounters, code: int, view: View) -> Shared | None:
    """Return what shows several senders in a session of a type."""
    chains = [*map(_Chain._make, followed.chains())]
    if chains:
        *places, last = (str(one.last) for one in chains)
        evidence = (
            f"{_NUMBERS[len(chains)]} transfer-ID counters in {view.type_name(code)}, at {', '.join(places)} and {last}"
        )
        return Shared(evidence, _onset(chains), [one.start for one in chains if one.start is not None])
    resumed = followed.goes_on()
    if resumed is None:
        return None
    at, since, number, other = resumed
    between = "no order" if other is None else f"always {other}"
    evidence = f"a transfer-ID counter in {view.type_name(code)} at {at}, and in between {between}"
    return Shared(evidence, since, () if number is None else (number,))


def _onset(chains: Sequence[_Chain]) -> int:
    """Return the time before the second counter began. One that never took over again was left behind by a loss."""
    alive = [one for one in chains if one.turns > 1]
    return sorted(alive if len(alive) > 1 else chains, key=lambda one: one.begun)[1].since
