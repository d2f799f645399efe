"""Frames that no transfer names, though they are DroneCAN's: remote, empty, stray, repeated or wrongly begun ones.

A session is DroneCAN for certain once a transfer of it came out of the core. Until then its frames wait here: they may
be settled as foreign, or the end of the capture gives them the benefit of the doubt.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer._native import Firsts, tails_before
from analyzer.decode.sent import cells
from analyzer.facts.identifiers import who
from analyzer.rules.frames.foreign import session_bits
from analyzer.rules.frames.malformed import IMPOSSIBLE, Malformed, has, tail
from analyzer.rules.frames.malformed import KINDS as MALFORMED
from analyzer.rules.transfers.loose_frames import LooseFrames
from analyzer.rules.transfers.out_of_order import KINDS, OutOfOrder
from analyzer.tables import FD, FRAME_ANOMALIES, TAIL_END, TAIL_ID, TAIL_TOGGLE, VERDICTS
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, Values, View

_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_OUT_OF_ORDER = np.array([verdict in KINDS for verdict in range(len(VERDICTS))])
_CLOSE = 64  # frames before a start in which the one before it is looked for
MOST_SESSIONS = 1 << 16
MOST_HELD = 4096


class UnassignedFrames(Rule):
    """Follows which sessions are DroneCAN's, from their first transfers."""

    rules = ("CAN-002", "CAN-003", "CAN-005", "CAN-008", "CAN-009", "TRF-002", "TRF-004", "TRF-005", "TRF-009")

    def __init__(self) -> None:
        self._begun = Firsts(MOST_SESSIONS)
        self._held = LooseFrames.none()
        self._out_of_order = OutOfOrder(self._begun)

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames of this batch, and earlier ones that became certain."""
        self._held.keep_lines(view)  # of those that still wait
        ready = [self._corrected(view)]
        begun = self._follow(view)
        if len(begun) and len(self._held):
            held = self._held.session
            ready.append(self._let_go(begun[np.minimum(begun.searchsorted(held), len(begun) - 1)] == held))
        yield from self._report(view, LooseFrames.joined(ready))
        yield from self._new(view)
        yield from self._out_of_order.feed(view)

    def _new(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames of this batch."""
        f = view.frames
        if not f.verdict.any() and not int(np.bitwise_or.reduce(f.anomaly)) & IMPOSSIBLE:
            return
        odd = (f.verdict > _FOREIGN) | ((f.verdict == _USED) & (f.anomaly & IMPOSSIBLE != 0) & (f.flags & FD == 0))
        rows = odd.nonzero()[0]
        if not len(rows):
            return
        session = f.bus[rows].astype(np.int64) << 32 | session_bits(f.id[rows], f.verdict[rows])
        new = LooseFrames.of(view, rows, session)
        new.kinds[:] = _kinds(view, new, f.anomaly[rows])
        certain = self._begins(session)
        told, wait = new.take(certain), new.take(~certain)
        del new, session, rows, odd  # they are large
        yield from self._report(view, told)
        self._held = LooseFrames.joined((self._held, wait))
        over = len(self._held) - MOST_HELD
        if over > 0:
            oldest, self._held = self._held.take(slice(over)), self._held.take(slice(over, None))
            yield from self._report(view, oldest)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what nobody has called foreign."""
        yield from self._report(view, self._held)
        yield from self._out_of_order.finish(view)

    def _follow(self, view: View) -> Array:
        """Note first transfers of sessions; return these sessions in order if any is new."""
        t = view.transfers
        rows = (~t.has("step")).nonzero()[0]
        if not len(rows):
            return rows
        kind, type_id, src = (column[rows].astype(np.int64) for column in (t.kind, t.type_id, t.src))
        service = type_id << 16 | (kind == 2) << 15 | t.dst[rows].astype(np.int64) << 8 | 0x80 | src
        session = t.bus[rows].astype(np.int64) << 32 | np.where(kind > 1, service, type_id << 8 | src)
        if not self._begun.add(session, t.t[rows], t.lead[rows]):
            return rows[:0]
        return np.sort(session[self._begins(session)])

    def _begins(self, session: Array) -> Array:
        """Return which sessions have had a transfer."""
        return cells(self._begun.has(session), bool)

    def _let_go(self, mask: Array) -> LooseFrames:
        """Return some of those that are held, which wait no longer."""
        if not mask.any():
            return LooseFrames.none()
        found, self._held = self._held.take(mask), self._held.take(~mask)
        return found

    def _corrected(self, view: View) -> LooseFrames:
        """Return frames that turned out to be DroneCAN's."""
        settled = view.settled
        if len(settled.number) and len(self._held):
            held = self._held.number
            at = np.minimum(held.searchsorted(settled.number), len(held) - 1)
            mask = np.zeros(len(held), bool)
            mask[at[held[at] == settled.number]] = True
            self._let_go(mask)
        some = (settled.known & (settled.verdict != _FOREIGN)).nonzero()[0]
        if not len(some):
            return LooseFrames.none()
        late = settled.of(some)
        session = late.bus << 32 | session_bits(late.id, late.verdict)
        columns = (late.number, late.verdict, session, *who(late.id, late.flags, late.verdict))
        rows, found = [], []
        for row, (number, verdict, key, *sender) in enumerate(zip(*(one.tolist() for one in columns), strict=True)):
            kept = view.frame(number)
            if kept is not None:
                rows.append(row)
                found.append((number, key, kept._replace(verdict=verdict), *sender))
        frames = LooseFrames.of_kept(found)
        frames.kinds[:] = _kinds(view, frames, late.anomaly[np.array(rows, np.int64)])
        return frames

    def _report(self, view: View, frames: LooseFrames) -> Iterator[Occurrences]:
        if not len(frames):
            return
        kinds, kept = frames.kinds, frames.kept != 0
        every = int(np.bitwise_or.reduce(kinds))
        of_kind = [(kind, kinds >> k & 1 == 1) for k, kind in enumerate(_KINDS) if every >> k & 1]
        each = [(kind, (mask & now).nonzero()[0]) for kind, mask in of_kind for now in (~kept, kept)]
        for kind, rows in sorted((one for one in each if len(one[1])), key=lambda one: one[1].item(0)):
            some = frames.take(rows)
            yield some.breaches(view, kind.rule, partial(_values_of, kind, some), severity=kind.severity)
        self._out_of_order.add(frames.take(_OUT_OF_ORDER[frames.verdict]))


def _kinds(view: View, frames: LooseFrames, anomaly: Array) -> Array:
    """Return which kinds frames are of: bits in their order."""
    found = np.zeros(len(anomaly), np.int16)
    for k, kind in enumerate(_KINDS):
        found |= kind.picks(frames.verdict, anomaly, frames.flags) * np.int16(1 << k)
    starts = (found & _STARTS).nonzero()[0]
    if not len(starts):
        return found
    later = _goes_on(view, frames.take(starts))
    found[starts] &= ~np.where(later, 1 << _WRONG_START, 1 << _GOES_ON)
    return found


def _goes_on(view: View, starts: LooseFrames) -> Array:
    """Return which starts with toggle 1 are the next frame of a transfer, of which another rule says so (TRF-006)."""
    low, high = int(starts.number.min()), int(starts.number.max())
    batches = [*view.indexes(max(low - _CLOSE, 0), high)]
    before = cells(tails_before(batches, starts.number, starts.session, _CLOSE), np.int16)
    odd = (before ^ starts.tail) & TAIL_ID | before & (TAIL_END | TAIL_TOGGLE)
    found: Array = (before >= 0) & (odd == 0) & (starts.size > 0)
    return found


def _values_of(kind: Malformed, frames: LooseFrames, k: int) -> Values:
    return kind.values(frames.form(k))


_picks_start = has(1 << FRAME_ANOMALIES.index("start toggle"))
_KINDS = (
    *MALFORMED, Malformed("TRF-002", _picks_start, tail, severity="note"), Malformed("TRF-002", _picks_start, tail),
)  # fmt: skip
_GOES_ON, _WRONG_START = len(MALFORMED), len(MALFORMED) + 1  # places among them
_STARTS = 1 << _GOES_ON | 1 << _WRONG_START
