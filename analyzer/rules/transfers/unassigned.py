"""Frames that no transfer names, though they are DroneCAN's: remote, empty, stray, repeated or wrongly begun ones.

A session is DroneCAN for certain once a transfer of it came out of the core. Until then its frames wait here: they may
be settled as foreign, or the end of the capture gives them the benefit of the doubt.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.frames.foreign import session_bits, session_of
from analyzer.rules.frames.malformed import IMPOSSIBLE, Malformed, has, tail
from analyzer.rules.frames.malformed import KINDS as MALFORMED
from analyzer.rules.transfers.missing_start import LooseFrame
from analyzer.rules.transfers.out_of_order import KINDS, OutOfOrder, preceding, sender_of
from analyzer.tables import FD, FRAME_ANOMALIES, TAIL_END, TAIL_ID, TAIL_TOGGLE, VERDICTS
from dissectors.kit import Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Kept, Occurrences, Severity, Values, View

_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_CLOSE = 64  # frames before a start in which the one before it is looked for
MOST_SESSIONS = 1 << 16
MOST_HELD = 4096


class _Held(NamedTuple):
    loose: LooseFrame
    about: tuple[tuple[str, Values, Severity | None], ...]


class UnassignedFrames(Rule):
    """Follows which sessions are DroneCAN's, from their first transfers."""

    rules = ("CAN-002", "CAN-003", "CAN-005", "CAN-008", "CAN-009", "TRF-002", "TRF-004", "TRF-005", "TRF-009")

    def __init__(self) -> None:
        self._begun: dict[int, tuple[int, int]] = {}
        self._held: dict[int, _Held] = {}
        self._out_of_order = OutOfOrder(self._begun)

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames of this batch, and earlier ones that became certain."""
        ready = self._corrected(view)
        if self._follow(view):
            ready += [held for held in self._held.values() if held.loose.session in self._begun]
        yield from self._report(view, ready)
        yield from self._new(view)
        yield from self._out_of_order.feed(view)

    def _new(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames of this batch."""
        f = view.frames
        if not f.verdict.any() and not int(np.bitwise_or.reduce(f.anomaly)) & IMPOSSIBLE:
            return
        odd = (f.verdict > _FOREIGN) | ((f.verdict == _USED) & (f.anomaly & IMPOSSIBLE != 0) & (f.flags & FD == 0))
        rows = np.flatnonzero(odd)
        if not len(rows):
            return
        session = f.bus[rows].astype(np.int64) << 32 | session_bits(f.id[rows], f.verdict[rows])
        certain = np.fromiter(map(self._begun.__contains__, session.tolist()), bool, len(rows))
        yield from self._certain(view, rows[certain], session[certain])
        for row, key in zip(rows[~certain].tolist(), session[~certain].tolist(), strict=True):
            number = row + f.first
            kept = view.frame(number)
            if kept is not None:
                self._held[number] = _held(view, number, key, kept, int(f.anomaly[row]))
        if len(self._held) > MOST_HELD:
            yield from self._report(view, list(self._held.values())[: len(self._held) - MOST_HELD])

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield what nobody has called foreign."""
        yield from self._report(view, list(self._held.values()))
        yield from self._out_of_order.finish(view)

    def _follow(self, view: View) -> bool:
        """Note first transfers of sessions; whether there were any."""
        t = view.transfers
        rows = np.flatnonzero(~t.has("step"))
        if not len(rows) or len(self._begun) >= MOST_SESSIONS:
            return False
        kind, type_id, src = (column[rows].astype(np.int64) for column in (t.kind, t.type_id, t.src))
        service = type_id << 16 | (kind == 2) << 15 | t.dst[rows].astype(np.int64) << 8 | 0x80 | src
        session = t.bus[rows].astype(np.int64) << 32 | np.where(kind > 1, service, type_id << 8 | src)
        before = len(self._begun)
        for key, row in zip(session.tolist(), rows.tolist(), strict=True):
            if key not in self._begun:
                self._begun[key] = int(t.t[row]), int(t.lead[row])
        return len(self._begun) > before

    def _corrected(self, view: View) -> list[_Held]:
        """Return frames that turned out to be DroneCAN's."""
        late = []
        for number, verdict, anomaly in view.settled:
            self._held.pop(number, None)
            kept = view.frame(number)
            if verdict != _FOREIGN and kept is not None:
                key = kept.bus << 32 | session_of(kept.id, verdict)
                late.append(_held(view, number, key, kept._replace(verdict=verdict), anomaly))
        return late

    def _report(self, view: View, held: list[_Held]) -> Iterator[Occurrence]:
        for one in sorted(held, key=lambda one: one.loose.number):
            loose, kept = one.loose, one.loose.kept
            self._held.pop(loose.number, None)
            node, type_, _ = sender_of(view, kept)
            for rule, values, severity in one.about:
                yield Occurrence(
                    rule, kept.t, kept.bus, node, type_, (loose.number,), values, severity=severity, lines=loose.lines
                )
            if kept.verdict in KINDS:
                self._out_of_order.add(loose)

    def _certain(self, view: View, rows: Array, session: Array) -> Iterator[Occurrences | Occurrence]:
        f = view.frames
        verdict, anomaly, flags = f.verdict[rows], f.anomaly[rows], f.flags[rows]
        for kind in _KINDS:
            mine = rows[kind.picks(verdict, anomaly, flags)]
            if kind.rule == "TRF-002":
                later = np.array(
                    [_goes_on(view, row + f.first, view.frame(row + f.first)) for row in mine.tolist()], bool
                )
                yield view.among_frames(kind.rule, mine[later], partial(_values_of, view, kind), severity="note")
                mine = mine[~later]
            if len(mine):
                yield view.among_frames(kind.rule, mine, partial(_values_of, view, kind))
        loose = np.isin(verdict, KINDS)
        for row, key in zip(rows[loose].tolist(), session[loose].tolist(), strict=True):
            kept = view.frame(row + f.first)
            if kept is not None:
                self._out_of_order.add(LooseFrame(row + f.first, key, kept, view.lines((row + f.first,))))


def _held(view: View, number: int, session: int, kept: Kept, anomaly: int) -> _Held:
    facts = (np.array([value]) for value in (kept.verdict, anomaly, kept.flags))
    verdict, bits, flags = facts
    kinds = [kind for kind in _KINDS if kind.picks(verdict, bits, flags)[0]]
    later: Severity | None = (
        "note" if any(kind.rule == "TRF-002" for kind in kinds) and _goes_on(view, number, kept) else None
    )
    about = [(kind.rule, kind.values(view, number, kept), later if kind.rule == "TRF-002" else None) for kind in kinds]
    return _Held(LooseFrame(number, session, kept, view.lines((number,))), tuple(about))


def _goes_on(view: View, number: int, kept: Kept | None) -> bool:
    """Return whether a start with toggle 1 is the next frame of a transfer, of which another rule says so (TRF-006)."""
    if kept is None or not kept.data:
        return False
    before = next((other.data[-1] for _, other in preceding(view, number, kept, _CLOSE)), None)
    return before is not None and not (before ^ kept.data[-1]) & TAIL_ID and not before & (TAIL_END | TAIL_TOGGLE)


def _values_of(view: View, kind: Malformed, row: int) -> Values:
    number = row + view.frames.first
    kept = view.frame(number)
    assert kept is not None  # noqa: S101 - a frame of this batch
    return kind.values(view, number, kept)


_KINDS = (*MALFORMED, Malformed("TRF-002", has(1 << FRAME_ANOMALIES.index("start toggle")), tail))
