"""Where frames of a sender are missing, found in columns: what the core finds session by session is to be the same."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.bus.sessions import (
    CODE_BITS,
    MOST_SESSIONS,
    Session,
    bus_frames,
    node_of,
)
from analyzer.rules.joint.lack_rows import UNASKED, LackRows
from analyzer.rules.joint.times import FEW, LONGEST, SETTLED, WIDEST, WINDOW
from analyzer.tables import ERROR, KINDS, STATUSES, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE
from dissectors.kit import MILLISECOND, NO_TIME, by_key
from kit.keyed import KeyedRows

if TYPE_CHECKING:
    from analyzer.rules.bus.sessions import BusFrames
    from dissectors.kit import Array, FrameTable, TransferTable, View

_SERVICE, _ASKS = 1 << 16, 1 << 7  # of the type ID in the code of a session
_COMPLETE = STATUSES.index("ok")
_KNOWN_BY = 2  # complete transfers of a type that is defined: a session of DroneCAN, and no other protocol's
_MOST_KNOWN = 1 << 16  # sessions that are, or may become so: every node may ask every other one for every service
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
_SWAPPED = 100 * MILLISECOND  # within which a frame that was overtaken is still to come
# The latest one of a session: its second frame, and what of it decides about the next one.
LATEST = {"behind": -1, "until": 0, "wanted": -1, "void": 0}


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


def _first_rows(t: TransferTable, good: Array, most: int) -> tuple[Array, Array]:
    """Return the first good rows of each session, at most so many, and in front of them the codes of the sessions."""
    count, found = Counter[int](), []
    for row in np.flatnonzero(good).tolist():
        kind, type_id = KINDS[t.kind[row]], int(t.type_id[row])
        if kind in ("request", "response"):
            type_id = _SERVICE | type_id << 8 | (kind == "request") * _ASKS | int(t.dst[row])
        elif kind != "message":
            continue
        code = Session(int(t.bus[row]), int(t.src[row]), type_id).code
        count[code] += 1
        if count[code] <= most:
            found.append((code, row))
    codes, rows = np.array(found, np.int64).reshape(-1, 2).T
    return codes, rows


def _of_service(codes: Array) -> Array:
    found: Array = codes & _SERVICE != 0
    return found


def _of_responses(codes: Array) -> Array:
    found: Array = codes & (_SERVICE | _ASKS) == _SERVICE
    return found


def _beyond(ours: BusFrames, held: KeyedRows, first: KeyedRows) -> Array:
    """Return a mask of the sessions without room: those of `first` go first, then those that were heard first."""
    found: Array = ~held.has(ours.codes)
    new = np.flatnonzero(found)
    new = new[np.lexsort((ours.place[ours.first[new]], ~first.has(ours.codes[new])))]
    found[new[: held.room]] = False
    return found


class LacksInColumns:
    """Follows the tail bytes of all transfers; sessions are at most 4096.

    A type that begins anew at 0 lacks nothing: its node restarted. Answers of which a whole one is not there were not
    given, perhaps.
    """

    def __init__(self) -> None:
        # The last frame of each session, how many did not follow the one before as they should, transfers begun.
        last = {"tail": 0, "t": NO_TIME, "number": -1, "place": -1, "odd": 0, "begun": 0}
        self._last = KeyedRows({**last, **LATEST}, MOST_SESSIONS)
        self._heard: dict[int, int] = {}  # frames by bus
        self._since: dict[int, int] = {}  # its first frame
        self._senders: dict[int, set[int]] = {}  # the nodes that were heard
        self._complete: set[int] = set()  # codes of sessions of which one transfer is not enough to be known
        self._known = KeyedRows({"since": _NEVER}, _MOST_KNOWN)  # when each one became known
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
            self._senders.setdefault(bus, set()).update(node_of(ours.codes).tolist())
            some = np.flatnonzero(~_beyond(ours, self._last, self._known))
            codes = ours.codes[some]
            new = self._last.find(codes) < 0
            self._last.add(codes)
            tails = self._last.look_up("tail", codes)
            odd = _odd(ours)[some] | _odd_behind(tails, ours.tail[ours.first[some]])
            looked = odd | new | errors
            self._pass_over(frames, ours, some[~looked], base)
            found.append(self._follow(frames, ours, some[looked], base))
        rows = LackRows.joined(found)
        return compared(rows.take(np.argsort(rows.place_behind, kind="stable")), self._last)

    def _pass_over(self, frames: FrameTable, ours: BusFrames, some: Array, base: int) -> None:
        """Note the last frames of sessions in which each follows the one before it."""
        if not len(some):
            return
        codes = ours.codes[some]
        end = _frames(frames, ours, ours.first[some + 1] - 1, base)
        begun = np.add.reduceat(ours.tail & TAIL_START != 0, ours.first[:-1], dtype=np.int64)[some]
        self._last.put(self._last.find(codes), **end._asdict(), begun=self._last.look_up("begun", codes) + begun)

    def known(self, lacks: LackRows, within: int) -> Array:
        """Return whether the sessions were known to be DroneCAN's up to a time after each."""
        found: Array = self._known.look_up("since", lacks.session) <= lacks.until + within
        return found

    def _all_known(self, frames: FrameTable) -> bool:
        """Return whether every session that was heard is known: then transfers prove nothing new."""
        if not self._last.room or not self._known.has(self._last.keys).all():
            return False
        return all(self._known.has(ours.codes).all() for ours in bus_frames(frames).values())

    def _prove(self, view: View) -> None:
        """Note when sessions became known; types that have no definition come out late, and prove nothing."""
        t = view.transfers
        good = (t.status == _COMPLETE) & (t.t_end != NO_TIME)
        codes, rows = _first_rows(t, good, _KNOWN_BY)
        types, which = np.unique(t.code[rows], return_inverse=True)
        defined = np.array([view.type_of(code) is not None for code in types.tolist()], bool)
        new = np.flatnonzero(defined[which] & ~self._known.has(codes))
        proved: dict[int, int] = {}
        for code, at in zip(codes[new].tolist(), t.t_end[rows[new]].tolist(), strict=True):
            if code in proved:
                continue
            if code in self._complete:
                self._complete.remove(code)
                proved[code] = at
            elif len(self._complete) < _MOST_KNOWN:
                self._complete.add(code)
        self._known.add(np.array([*proved], np.int64), since=np.array([*proved.values()], np.int64))
        for session, at in ((Session.of(code), at) for code, at in proved.items()):
            if not session.type_id & _SERVICE:
                nodes = self.nodes.setdefault(session.bus, {})
                nodes[session.node] = min(nodes.get(session.node, at), at)

    def _follow(self, frames: FrameTable, ours: BusFrames, some: Array, base: int) -> LackRows:
        """Look at each frame of some sessions of a bus; `base` are the frames of the bus before the batch."""
        which, own = _of_sessions(frames, ours, some, base)
        if not len(own.tail):
            return LackRows.none()
        first = np.flatnonzero(np.diff(which, prepend=-1))
        codes = ours.codes[some[which[first]]]
        rows = self._last.find(codes)
        last = {name: self._last.get(name, rows) for name in (*_Frames._fields, "odd", "begun")}
        group = np.repeat(np.arange(len(codes)), np.diff(first, append=len(which)))

        def summed(mask: Array, before: Array) -> Array:
            """Return how many there are up to each frame of a session, on top of those before the batch."""
            sums = np.cumsum(mask)
            total: Array = sums + (before - (sums[first] - mask[first]))[group]
            return total

        tail = np.empty_like(own.tail)
        tail[1:] = own.tail[:-1]
        tail[first] = last["tail"]
        wanted = _WANTED[tail]
        odd = _odd_behind(tail, own.tail)
        odd[first] &= last["number"] >= 0
        odd &= (own.t >= self._known.look_up("since", codes)[group]) | (summed(odd, last["odd"]) <= _MOST_UNKNOWN)
        odd &= (tail & TAIL_END == 0) | (own.tail & _FOLLOWS != TAIL_START)
        starts = own.tail & TAIL_START != 0
        begins, count = summed(starts, last["begun"]), summed(odd, last["odd"])
        odd &= (_HABIT * count <= begins) | ~_of_service(codes)[group]
        odd &= (tail & TAIL_END == 0) | ~starts | ~_of_responses(codes)[group]
        lacks = np.flatnonzero(odd)
        bus = int(codes[0]) >> CODE_BITS
        if len(lacks) and len(self._senders[bus]) == 1 and ours.forward:
            lacks = self._near_end(lacks, codes[group[lacks]], _Wanted(own, wanted), int(frames.t.max()))
        before = {name: np.roll(getattr(own, name), 1) for name in ("t", "number", "place")}
        for name, column in before.items():
            column[first] = last[name]
        mine = _Frames(*(column[lacks] for column in own))
        each = np.maximum(mine.t - self._since[bus], 0) // mine.place
        code = codes[group[lacks]]
        none = np.full(len(lacks), -1)
        ends = np.append(first[1:], len(which)) - 1
        self._last.put(self._last.find(codes), **{name: column[ends] for name, column in own._asdict().items()},
                       odd=count[ends], begun=begins[ends])  # fmt: skip
        return LackRows(
            code, node_of(code), before["number"][lacks], mine.number, before["t"][lacks], mine.t,
            before["place"][lacks], mine.place, (mine.tail & _FOLLOWS).astype(np.int64),
            wanted[lacks].astype(np.int64), np.clip(FEW * each, WINDOW, WIDEST), none, np.zeros(len(lacks), bool),
            np.full(len(lacks), UNASKED, np.uint8),
        )  # fmt: skip

    def _near_end(self, rows: Array, codes: Array, own: _Wanted, end: int) -> Array:
        """Leave out of what the only sender of a bus lacks what no later one can lack together with it.

        Where frames may have come in another order nothing is left out.

        Args:
            rows: of frames behind which something is missing.
            codes: of their sessions.
            own: the frames.
            end: the time of the last frame.
        """
        tail, wanted = own.frames.tail[rows] & _FOLLOWS, own.wanted[rows]
        first = np.flatnonzero(np.diff(codes, prepend=-1))
        sessions = codes[first]
        again = np.append(tail[1:] == wanted[:-1], False)
        again[first[1:] - 1] = False
        keep = own.frames.t[rows] >= end - _REACH
        keep[:-1] |= keep[1:]
        whole = np.logical_or.reduceat(again, first) | (self._last.look_up("void", sessions) != 0)
        whole |= self._last.look_up("wanted", sessions) == tail[first]
        keep |= np.repeat(whole, np.diff(first, append=len(rows)))
        forget = sessions[~np.logical_and.reduceat(keep, first)]
        self._last.put(self._last.find(forget), **{name: np.full(len(forget), none) for name, none in LATEST.items()})
        return rows[keep]


def _frames(frames: FrameTable, ours: BusFrames, mine: Array, base: int) -> _Frames:
    """Return frames of sessions; `base` are those of the bus before the batch."""
    rows = ours.row[mine]
    return _Frames(ours.tail[mine], frames.t[rows], rows + frames.first, ours.place[mine] + base)


def _of_sessions(frames: FrameTable, ours: BusFrames, some: Array, base: int) -> tuple[Array, _Frames]:
    """Return frames of some sessions that are no error frames, and which of the sessions each is of."""
    begins, counts = ours.first[some], np.diff(ours.first)[some]
    which = np.repeat(np.arange(len(some)), counts)
    mine = np.arange(len(which)) + (begins - (np.cumsum(counts) - counts))[which]
    good = frames.flags[ours.row[mine]] & ERROR == 0
    return which[good], _frames(frames, ours, mine[good], base)


def _odd(ours: BusFrames) -> Array:
    """Return of which sessions there are frames that do not follow the one before them in the batch."""
    odd = _odd_behind(ours.tail[:-1], ours.tail[1:])
    odd[ours.first[1:-1] - 1] = False
    found = np.zeros(len(ours.codes), bool)
    found[np.searchsorted(ours.first, np.flatnonzero(odd), "right") - 1] = True
    return found


def _odd_behind(before: Any, tail: Any) -> Any:
    """Return which tail bytes do not follow those before them, nor repeat them."""
    return (tail & _FOLLOWS != _WANTED[before]) & (tail != before)


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
    latest.put(latest.find(each), behind=of.behind[last], until=of.until[last], wanted=of.wanted[last], void=void[last])
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
