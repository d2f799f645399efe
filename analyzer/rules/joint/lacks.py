"""Where frames of a sender are missing: between two frames of a session that cannot follow each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.bus.sessions import MOST_SESSIONS, bus_frames, first_transfers
from analyzer.rules.joint.times import FEW, LONGEST, SETTLED, WIDEST, WINDOW
from analyzer.tables import ERROR, STATUSES, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE
from dissectors.kit import MILLISECOND, NO_TIME
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.bus.sessions import BusFrames, Session
    from dissectors.kit import Array, FrameTable, View

_COMPLETE = STATUSES.index("ok")
_KNOWN_BY = 2  # complete transfers of a type that is defined: a session of DroneCAN, and no other protocol's
_MOST_UNKNOWN = 32  # frames that did not, of a session that may become known
_REACH = SETTLED + LONGEST + WIDEST  # what is missing before may not be joint with what is missing now
_NEVER = np.iinfo(np.int64).max
_HABIT = 4  # one of so many requests may have an odd ID; of tools that count otherwise more have
_SWAPPED = 100 * MILLISECOND  # within which a frame that was overtaken is still to come
_FOLLOWS = TAIL_START | TAIL_TOGGLE | TAIL_ID  # whether a frame is the last one is not known before
_TAILS = np.arange(256)
# What the tail byte behind each one should have of `_FOLLOWS`.
_WANTED = np.where(
    _TAILS & TAIL_END != 0, TAIL_START | (_TAILS + 1) & TAIL_ID, _TAILS & TAIL_ID | ~_TAILS & TAIL_TOGGLE
).astype(np.uint8)


@dataclass(slots=True, eq=False)
class Lack:
    """Frames of a session are missing between two of its frames: their numbers, times and places on the bus.

    A place counts the frames of the bus that have a sender and a time. `tail` is what the second frame has in its tail
    byte, `wanted` what it should have, `window` how far joint ones are apart at most, in ns, `left` the frame at which
    the session left off where it goes on now. `void` says that nothing is missing: frames only came in another order.
    """

    session: Session
    frames: tuple[int, int]
    since: int
    until: int
    places: tuple[int, int]
    tail: int
    wanted: int
    window: int = WINDOW
    left: int | None = None
    void: bool = False


class _Frames(NamedTuple):
    """Frames of a session: tail bytes, times, numbers and places."""

    tail: Array
    t: Array
    number: Array
    place: Array


class _Wanted(NamedTuple):
    """Frames, and what each one should have of `_FOLLOWS` in its tail byte."""

    frames: _Frames
    wanted: Array


class _Last(NamedTuple):
    """The last frame of a session, how many did not follow the one before them as they should, and transfers begun."""

    tail: int = 0
    t: int = NO_TIME
    number: int = -1
    place: int = -1
    odd: int = 0
    begun: int = 0


class Lacks:
    """Follows the tail bytes of all transfers; sessions are at most 4096.

    A type that begins anew at 0 lacks nothing: its node restarted. Answers of which a whole one is not there were not
    given, perhaps.
    """

    def __init__(self) -> None:
        self._last: dict[Session, _Last] = {}
        self._latest: dict[Session, Lack] = {}
        self._heard: dict[int, int] = {}  # frames by bus
        self._since: dict[int, int] = {}  # its first frame
        self._senders: dict[int, set[int]] = {}  # the nodes that were heard
        self._complete: dict[Session, int] = {}  # transfers of those that are not known yet
        self._known: dict[Session, int] = {}  # when each one became known
        self.nodes: dict[int, dict[int, int]] = {}  # by bus: when each node that sends messages became known

    def feed(self, view: View) -> list[Lack]:
        """Add a batch; return what is missing, in the order of the frames behind it."""
        frames = view.frames
        if not self._all_known(frames) or not view.transfers.src.all():
            self._prove(view)
        errors = bool((frames.flags & ERROR).any())
        found: list[Lack] = []
        for bus, ours in bus_frames(frames).items():
            base = self._heard.get(bus, 0)
            if not base:
                self._since[bus] = int(frames.t[ours.row[ours.first[:-1]]].min())
            self._heard[bus] = base + len(ours.row)
            self._senders.setdefault(bus, set()).update(session.node for session in ours.sessions)
            begun = np.add.reduceat(ours.tail & TAIL_START != 0, ours.first[:-1], dtype=np.int64).tolist()
            followed: list[int] = []
            beyond = ours.beyond(ours.sessions, self._last, first=self._known)
            lasts = [self._last.get(session) for session in ours.sessions]
            tails = np.array([0 if last is None else last.tail for last in lasts], np.uint8)
            odd = _odd(ours) | _odd_behind(tails, ours.tail[ours.first[:-1]])
            for k, (session, last, is_odd) in enumerate(zip(ours.sessions, lasts, odd.tolist(), strict=True)):
                if session in beyond:
                    continue
                if errors or is_odd or last is None:
                    self._last.setdefault(session, _Last())
                    followed.append(k)
                else:
                    end = _frames(frames, ours, slice(ours.first[k + 1] - 1, ours.first[k + 1]), base)
                    place = _Last(*(int(column[0]) for column in end))
                    self._last[session] = place._replace(odd=last.odd, begun=last.begun + begun[k])
            found += self._follow(frames, ours, followed, base)
        found.sort(key=lambda one: one.places[1])
        for one in found:
            self._compare(one)
        return found

    def known(self, one: Lack, within: int) -> bool:
        """Return whether the session was known to be DroneCAN's up to a time after that."""
        return self._known.get(one.session, one.until + within + 1) <= one.until + within

    def _all_known(self, frames: FrameTable) -> bool:
        """Return whether every session that was heard is known: then transfers prove nothing new."""
        new = (session for ours in bus_frames(frames).values() for session in ours.sessions)
        room = len(self._last) < MOST_SESSIONS
        return room and self._known.keys() >= self._last.keys() and all(session in self._known for session in new)

    def _prove(self, view: View) -> None:
        """Note when sessions became known; types that have no definition come out late, and prove nothing."""
        t = view.transfers
        good = (t.status == _COMPLETE) & (t.t_end != NO_TIME)
        for session, row in first_transfers(t, good, _KNOWN_BY, services=True):
            if session in self._known or view.type_of(int(t.code[row])) is None:
                continue
            count = self._complete.pop(session, 0) + 1
            if count < _KNOWN_BY:
                self._complete[session] = count
                continue
            self._known[session] = at = int(t.t_end[row])
            if not session.of_service:
                nodes = self.nodes.setdefault(session.bus, {})
                nodes[session.node] = min(nodes.get(session.node, at), at)

    def _follow(self, frames: FrameTable, ours: BusFrames, some: Sequence[int], base: int) -> Iterator[Lack]:
        """Look at each frame of some sessions of a bus; `base` are the frames of the bus before the batch."""
        which, own = _of_sessions(frames, ours, some, base)
        if not len(own.tail):
            return
        first = np.flatnonzero(np.diff(which, prepend=-1))
        at = which[first].tolist()
        sessions = [ours.sessions[some[one]] for one in at]
        lasts = [self._last[session] for session in sessions]
        tails, odds, begun = (np.array([last[part] for last in lasts], np.int64) for part in (0, 4, 5))
        group = np.repeat(np.arange(len(at)), np.diff(first, append=len(which)))

        def summed(mask: Array, before: Array) -> Array:
            """Return how many there are up to each frame of a session, on top of those before the batch."""
            sums = np.cumsum(mask)
            total: Array = sums + (before - (sums[first] - mask[first]))[group]
            return total

        tail = np.empty_like(own.tail)
        tail[1:] = own.tail[:-1]
        tail[first] = tails
        wanted = _WANTED[tail]
        odd = _odd_behind(tail, own.tail)
        odd[first] &= np.array([last.number >= 0 for last in lasts])
        known = np.array([self._known.get(session, _NEVER) for session in sessions], np.int64)
        odd &= (own.t >= known[group]) | (summed(odd, odds) <= _MOST_UNKNOWN)
        odd &= (tail & TAIL_END == 0) | (own.tail & _FOLLOWS != TAIL_START)
        starts = own.tail & TAIL_START != 0
        begins, count = summed(starts, begun), summed(odd, odds)
        odd &= (_HABIT * count <= begins) | ~np.array([session.of_service for session in sessions])[group]
        odd &= (tail & TAIL_END == 0) | ~starts | ~np.array([session.of_responses for session in sessions])[group]
        rows = np.flatnonzero(odd)
        if len(rows) and len(self._senders[sessions[0].bus]) == 1 and ours.forward:
            rows = self._near_end(rows, group, sessions, _Wanted(own, wanted), int(frames.t.max()))
        before = [np.roll(column, 1) for column in own[1:]]
        for column, part in zip(before, zip(*(last[1:4] for last in lasts), strict=True), strict=True):
            column[first] = part
        said = group, own.number, own.t, own.place, own.tail & _FOLLOWS, wanted
        parts = [column[rows] for column in (*before, *said)]
        each = np.maximum(own.t[rows] - self._since[sessions[0].bus], 0) // own.place[rows]
        parts.append(np.clip(FEW * each, WINDOW, WIDEST))
        listed = (column.tolist() for column in parts)
        for past, number, place, one, behind, t, at_, tail_, due, window in zip(*listed, strict=True):
            yield Lack(sessions[one], (number, behind), past, t, (place, at_), tail_, due, window)
        ends = np.append(first[1:], len(which)) - 1
        columns = (column[ends].tolist() for column in (*own, count, begins))
        self._last.update(zip(sessions, map(_Last._make, zip(*columns, strict=True)), strict=True))

    def _near_end(self, rows: Array, group: Array, sessions: Sequence[Session], own: _Wanted, end: int) -> Array:
        """Leave out of what the only sender of a bus lacks what no later one can lack together with it.

        Where frames may have come in another order nothing is left out.

        Args:
            rows: of frames behind which something is missing.
            group: which of the sessions each frame is of.
            sessions: these.
            own: the frames.
            end: the time of the last frame.
        """
        tail, wanted = own.frames.tail[rows] & _FOLLOWS, own.wanted[rows]
        which = group[rows]
        first = np.flatnonzero(np.diff(which, prepend=-1))
        again = tail[1:] == wanted[:-1]
        again[first[1:] - 1] = False
        keep = own.frames.t[rows] >= end - _REACH
        keep[:-1] |= keep[1:]
        for low, high in zip(first.tolist(), np.append(first[1:], len(rows)).tolist(), strict=True):
            session = sessions[which[low]]
            past = self._latest.get(session)
            if again[low : high - 1].any() or (past is not None and (past.void or past.wanted == tail[low])):
                keep[low:high] = True
            elif not keep[low:high].all():
                self._latest.pop(session, None)
        return rows[keep]

    def _compare(self, one: Lack) -> None:
        """Take back what was missing if it comes now, and so what is odd about the frames around it."""
        past = self._latest.get(one.session)
        self._latest[one.session] = one
        if past is None:
            return
        one.left = past.frames[1] if one.tail == past.wanted else None
        if not past.void and one.tail == past.wanted and one.until - past.until <= _SWAPPED:
            past.void = one.void = True
        elif past.void and past.frames[1] == one.frames[0]:
            one.void = True


def _frames(frames: FrameTable, ours: BusFrames, mine: Array | slice, base: int) -> _Frames:
    """Return frames of sessions; `base` are those of the bus before the batch."""
    rows = ours.row[mine]
    return _Frames(ours.tail[mine], frames.t[rows], rows + frames.first, ours.place[mine] + base)


def _of_sessions(frames: FrameTable, ours: BusFrames, some: Sequence[int], base: int) -> tuple[Array, _Frames]:
    """Return frames of some sessions that are no error frames, and which of the sessions each is of."""
    first = np.array(ours.first, np.int64)
    begins, counts = first[some], np.diff(first)[some]
    which = np.repeat(np.arange(len(some)), counts)
    mine = np.arange(len(which)) + (begins - (np.cumsum(counts) - counts))[which]
    good = frames.flags[ours.row[mine]] & ERROR == 0
    return which[good], _frames(frames, ours, mine[good], base)


def _odd(ours: BusFrames) -> Array:
    """Return of which sessions there are frames that do not follow the one before them in the batch."""
    odd = _odd_behind(ours.tail[:-1], ours.tail[1:])
    odd[np.array(ours.first[1:-1], np.int64) - 1] = False
    found = np.zeros(len(ours.sessions), bool)
    found[np.searchsorted(ours.first, np.flatnonzero(odd), "right") - 1] = True
    return found


def _odd_behind(before: Any, tail: Any) -> Any:
    """Return which tail bytes do not follow those before them, nor repeat them."""
    return (tail & _FOLLOWS != _WANTED[before]) & (tail != before)
