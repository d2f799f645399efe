"""The sessions of a node in which several devices send, by the starts of their transfers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.counters.id_steps import COPIED, QUIET
from analyzer.rules.counters.interleaved_senders import InterleavedSenders, named, onset
from analyzer.rules.counters.resumed_counter import ResumedCounter
from analyzer.rules.counters.session_starts import OddStart, SessionStarts
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.counters.id_steps import IdStep
    from dissectors.kit import View


class Shared(NamedTuple):
    """A session that several devices share: what shows it, the time before the second one came, and frames of them."""

    evidence: str
    since: int
    frames: Sequence[int]


class _Session:
    """The starts of a session, and what they may show."""

    def __init__(self, place: int, start: OddStart, data: bytes) -> None:
        self.starts = SessionStarts(place, start, data)
        self._senders = InterleavedSenders()
        self._resumed = ResumedCounter(start.before)

    def add(self, one: OddStart) -> bool:
        """Add a start; return whether one of several senders took over with it."""
        took_over = self._senders.add(one)
        return self._resumed.add(one) or took_over

    def shared(self, type_: str, least: int) -> Shared | None:
        """Return what shows several senders, each with so many transfers."""
        if not self._senders.likely and not self._resumed.likely(least):
            return None
        chains, resumed = self._senders.counters(least), self._resumed
        if chains:
            frames = [one.start for one in chains if one.start >= 0]
            return Shared(named(chains, type_), onset(chains), frames)
        other = resumed.other(least)
        if other is None:
            return None
        evidence = f"a transfer-ID counter in {type_} at {resumed.last}, and in between {other}"
        return Shared(evidence, resumed.since, (resumed.number,))


class SeveralSenders:
    """Follows the sessions of a node whose counters broke; `seen` is when one of several senders took over last."""

    def __init__(self) -> None:
        self._followed: dict[int, _Session] = {}
        self.seen = NO_TIME

    def clear(self) -> None:
        """Forget all sessions."""
        self._followed.clear()

    def __contains__(self, place: object) -> bool:
        """Return whether a session is followed."""
        return place in self._followed

    def shows(self, place: int, code: int, number: int, view: View) -> int | None:
        """Take the starts of a session that is followed, up to a frame.

        Return the first start with which several senders show, None if they do not.
        """
        followed = self._followed[place]
        least, type_ = int(view.number("BUS-010", "min_transfers")), view.type_name(code)
        for start in followed.starts.until(number, view):
            if _counts(start, view):
                took_over = followed.add(start)
                if followed.shared(type_, least) is not None:
                    self.seen = start.t if took_over else self.seen
                    return start.number
        return None

    def shared(self, one: IdStep, view: View) -> Shared | None:
        """Return what shows several senders in a session, up to an odd step of it; None if one is enough."""
        followed = self._followed.get(one.place)
        if followed is None:
            start = OddStart(one.frames[0], one.t, one.before, one.transfer_id, one.since)
            kept = view.frame(one.frames[0])
            if kept is None or not kept.data:
                return None
            followed = self._followed[one.place] = _Session(one.place, start, kept.data)
            if one.rule != COPIED and _counts(start, view):
                followed.add(start)
        least, type_ = int(view.number("BUS-010", "min_transfers")), view.type_name(one.code)
        for start in followed.starts.until(one.frames[-1], view):
            if _counts(start, view) and followed.add(start) and followed.shared(type_, least) is not None:
                self.seen = start.t
        return followed.shared(type_, least)


def _counts(start: OddStart, view: View) -> bool:
    """Return whether nothing but another sender or a loss explains a start: no silence, no gap of the capture."""
    if NO_TIME in (start.t, start.since):
        return True
    return start.t - start.since <= QUIET and start.since >= view.resumed(start.t)
