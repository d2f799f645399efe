"""Where frames of a sender are missing: between two frames of a session that cannot follow each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.bus.sessions import MOST_SESSIONS, bus_frames, first_transfers
from analyzer.rules.joint.lack_rows import LackRows, LatestLack, compared
from analyzer.rules.joint.times import FEW, LONGEST, SETTLED, WIDEST, WINDOW
from analyzer.tables import ERROR, STATUSES, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.bus.sessions import BusFrames, Session
    from dissectors.kit import Array, FrameTable, View

_COMPLETE = STATUSES.index("ok")
_KNOWN_BY = 2  # complete transfers of a type that is defined: a session of DroneCAN, and no other protocol's
_MOST_UNKNOWN = 32  # frames that did not, of a session that may become known
_REACH = SETTLED + LONGEST + WIDEST  # what is missing before may not be joint with what is missing now
_NEVER = np.iinfo(np.int64).max
_HABIT = 4  # one of so many requests may have an odd ID; of tools that count otherwise more have
_FOLLOWS = TAIL_START | TAIL_TOGGLE | TAIL_ID  # whether a frame is the last one is not known before
_TAILS = np.arange(256)
# What the tail byte behind each one should have of `_FOLLOWS`.
_WANTED = np.where(
    _TAILS & TAIL_END != 0, TAIL_START | (_TAILS + 1) & TAIL_ID, _TAILS & TAIL_ID | ~_TAILS & TAIL_TOGGLE
).astype(np.uint8)


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
        self._latest: dict[int, LatestLack] = {}  # by the codes of sessions
        self._heard: dict[int, int] = {}  # frames by bus
        self._since: dict[int, int] = {}  # its first frame
        self._senders: dict[int, set[int]] = {}  # the nodes that were heard
        self._complete: dict[Session, int] = {}  # transfers of those that are not known yet
        self._known: dict[Session, int] = {}  # when each one became known
        self._since_known: dict[int, int] = {}  # the same by codes of sessions
        self.nodes: dict[int, dict[int, int]] = {}  # by bus: when each node that sends messages became known

    def feed(self, view: View) -> tuple[LackRows, Array]:
        """Add a batch; return what is missing, in the order of the frames behind it.

        What was missing before is void now where the frame behind it is one of those that are returned, too.
        """
        frames = view.frames
        if not self._all_known(frames) or not view.transfers.src.all():
            self._prove(view)
        errors = bool((frames.flags & ERROR).any())
        found: list[LackRows] = []
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
            found.append(self._follow(frames, ours, followed, base))
        rows = LackRows.joined(found)
        return compared(rows.take(np.argsort(rows.place_behind, kind="stable")), self._latest)

    def known(self, lacks: LackRows, within: int) -> Array:
        """Return whether the sessions were known to be DroneCAN's up to a time after each."""
        each, which = np.unique(lacks.session, return_inverse=True)
        known = np.array([self._since_known.get(code, _NEVER) for code in each.tolist()], np.int64)
        found: Array = known[which] <= lacks.until + within
        return found

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
            self._known[session] = self._since_known[session.code] = at = int(t.t_end[row])
            if not session.of_service:
                nodes = self.nodes.setdefault(session.bus, {})
                nodes[session.node] = min(nodes.get(session.node, at), at)

    def _follow(self, frames: FrameTable, ours: BusFrames, some: Sequence[int], base: int) -> LackRows:
        """Look at each frame of some sessions of a bus; `base` are the frames of the bus before the batch."""
        which, own = _of_sessions(frames, ours, some, base)
        if not len(own.tail):
            return LackRows.none()
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
        past, number, place = (column[rows] for column in before)
        mine = _Frames(*(column[rows] for column in own))
        each = np.maximum(mine.t - self._since[sessions[0].bus], 0) // mine.place
        window = np.clip(FEW * each, WINDOW, WIDEST)
        code, node = np.array([(session.code, session.node) for session in sessions], np.int64)[group[rows]].T
        behind = ((mine.tail & _FOLLOWS).astype(np.int64), wanted[rows].astype(np.int64))
        none, void = np.full(len(rows), -1), np.zeros(len(rows), bool)
        found = LackRows(code, node, number, mine.number, past, mine.t, place, mine.place, *behind, window, none, void)
        ends = np.append(first[1:], len(which)) - 1
        columns = (column[ends].tolist() for column in (*own, count, begins))
        self._last.update(zip(sessions, map(_Last._make, zip(*columns, strict=True)), strict=True))
        return found

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
            past = self._latest.get(session.code)
            if again[low : high - 1].any() or (past is not None and (past.void or past.wanted == tail[low])):
                keep[low:high] = True
            elif not keep[low:high].all():
                self._latest.pop(session.code, None)
        return rows[keep]


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
