"""Frames that no transfer names, though they are DroneCAN's: remote, empty, stray, repeated or wrongly begun ones.

A session is DroneCAN for certain once a transfer of it came out of the core. Until then its frames wait here: they may
be settled as foreign, or the end of the capture gives them the benefit of the doubt.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import who
from analyzer.rules.frames.foreign import session_bits
from analyzer.rules.frames.malformed import IMPOSSIBLE, Malformed, has, tail
from analyzer.rules.frames.malformed import KINDS as MALFORMED
from analyzer.rules.joint.gathered import Gathered
from analyzer.rules.transfers.missing_start import LooseFrame
from analyzer.rules.transfers.out_of_order import KINDS, OutOfOrder, preceding
from analyzer.tables import FD, FRAME_ANOMALIES, TAIL_END, TAIL_ID, TAIL_TOGGLE, VERDICTS
from dissectors.kit import Kept, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array, Occurrences, Severity, Values, View

_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_CLOSE = 64  # frames before a start in which the one before it is looked for
MOST_SESSIONS = 1 << 16
_WRONG_START = "TRF-002"
MOST_HELD = 4096


class _Held(NamedTuple):
    """A frame, and what is said of it: rule, values, severity."""

    loose: LooseFrame
    about: Sequence[tuple[str, Values, Severity | None]]


class UnassignedFrames(Rule):
    """Follows which sessions are DroneCAN's, from their first transfers."""

    rules = ("CAN-002", "CAN-003", "CAN-005", "CAN-008", "CAN-009", "TRF-002", "TRF-004", "TRF-005", "TRF-009")

    def __init__(self) -> None:
        self._begun: dict[int, tuple[int, int]] = {}
        self._held: dict[int, _Held] = {}
        self._out_of_order = OutOfOrder(self._begun)
        self._told = Gathered()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames of this batch, and earlier ones that became certain."""
        self._keep_lines(view)
        ready = self._corrected(view)
        if self._follow(view):
            ready += [held for held in self._held.values() if held.loose.session in self._begun]
        yield from self._report(view, ready)
        yield from self._new(view)
        yield from self._told.occurrences()
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
        for held in _held(view, rows[~certain], session[~certain]):
            self._held[held.loose.number] = held
        if len(self._held) > MOST_HELD:
            yield from self._report(view, list(self._held.values())[: len(self._held) - MOST_HELD])

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what nobody has called foreign."""
        yield from self._report(view, list(self._held.values()))
        yield from self._told.occurrences()
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
        for number in view.settled.number.tolist():
            self._held.pop(number, None)
        late = view.settled.of(np.flatnonzero(view.settled.known & (view.settled.verdict != _FOREIGN)))
        session = late.bus << 32 | session_bits(late.id, late.verdict)
        picked = _picked(late.verdict, late.anomaly, late.flags)
        columns = (late.number, late.verdict, session, picked, *who(late.id, late.flags, late.verdict))
        found = []
        for number, verdict, key, bits, node, code in zip(*(column.tolist() for column in columns), strict=True):
            kept = view.frame(number)
            if kept is not None:
                loose = LooseFrame(number, key, kept._replace(verdict=verdict), None if node < 0 else node, code)
                found.append(_Held(loose, _about(view, loose, bits) if bits else ()))
        return found

    def _keep_lines(self, view: View) -> None:
        """Keep the frames that still wait: they may be gone when they are told."""
        for one in self._held.values():
            if not one.loose.lines:
                one.loose.lines = view.lines((one.loose.number,))

    def _report(self, view: View, held: list[_Held]) -> Iterator[Occurrence]:
        for loose, about in sorted(held, key=lambda one: one.loose.number):
            self._held.pop(loose.number, None)
            for rule, values, severity in about:
                if not loose.lines:
                    self._told.add(rule, loose.sent, (loose.number,), values, severity=severity, drops=False)
                    continue
                sent, place = loose.sent, (loose.number,)
                type_ = view.type_name(sent.code)
                yield Occurrence(
                    rule, sent.t, sent.bus, sent.node, type_, place, values, severity=severity, lines=loose.lines
                )
            if loose.kept.verdict in KINDS:
                self._out_of_order.add(loose)

    def _certain(self, view: View, rows: Array, session: Array) -> Iterator[Occurrences | Occurrence]:
        f = view.frames
        verdict, anomaly, flags = f.verdict[rows], f.anomaly[rows], f.flags[rows]
        for kind in _KINDS:
            mine = rows[kind.picks(verdict, anomaly, flags)]
            if kind.rule == _WRONG_START:
                later = np.array(
                    [_goes_on(view, row + f.first, view.frame(row + f.first)) for row in mine.tolist()], bool
                )
                yield view.among_frames(kind.rule, mine[later], partial(_values_of, view, kind), severity="note")
                mine = mine[~later]
            if len(mine):
                yield view.among_frames(kind.rule, mine, partial(_values_of, view, kind))
        loose = np.isin(verdict, KINDS)
        for one in _loose(view, rows[loose], session[loose]):
            self._out_of_order.add(one)


def _loose(view: View, rows: Array, session: Array) -> Iterator[LooseFrame]:
    """Yield frames of a batch."""
    f = view.frames
    own = [column[rows] for column in (f.t, f.bus, f.id, f.flags, f.verdict)]
    sender = who(own[2], own[3], np.where(own[4] == _FOREIGN, _USED, own[4]))
    columns = (column.tolist() for column in (rows, session, *own, *sender))
    for row, key, t, bus, identifier, flags, verdict, node, code in zip(*columns, strict=True):
        kept = Kept(t, bus, identifier, flags, f.data(row), verdict)
        yield LooseFrame(row + f.first, key, kept, None if node < 0 else node, code)


def _held(view: View, rows: Array, session: Array) -> Iterator[_Held]:
    """Yield frames of a batch whose sessions are not certain yet, and what is to be said of them."""
    f = view.frames
    picked = _picked(f.verdict[rows], f.anomaly[rows], f.flags[rows])
    for loose, bits in zip(_loose(view, rows, session), picked.tolist(), strict=True):
        yield _Held(loose, _about(view, loose, bits) if bits else ())


def _picked(verdict: Array, anomaly: Array, flags: Array) -> Array:
    """Return which kinds frames are of: bits in their order."""
    found = np.zeros(len(verdict), np.int64)
    for k, kind in enumerate(_KINDS):
        found |= kind.picks(verdict, anomaly, flags) * np.int64(1 << k)
    return found


def _about(view: View, loose: LooseFrame, picked: int) -> Sequence[tuple[str, Values, Severity | None]]:
    found: list[tuple[str, Values, Severity | None]] = []
    for kind in (kind for k, kind in enumerate(_KINDS) if picked >> k & 1):
        later = kind.rule == _WRONG_START and _goes_on(view, loose.number, loose.kept)
        found.append((kind.rule, kind.values(view, loose.number, loose.kept), "note" if later else None))
    return found


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


_KINDS = (*MALFORMED, Malformed(_WRONG_START, has(1 << FRAME_ANOMALIES.index("start toggle")), tail))
