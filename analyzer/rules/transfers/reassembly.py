"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.diagnosis import checksums, proofs
from analyzer.rules.diagnosis.budgets import LIKE, MOST_SENDERS, NOT_SEARCHED, KnownCauses, SearchBudget
from analyzer.rules.diagnosis.checksums import Formula
from analyzer.rules.diagnosis.losses import NO_ORDER, missing
from analyzer.rules.diagnosis.neighbours import AHEAD, NeighbourFinder
from analyzer.rules.diagnosis.proofs import Cause
from analyzer.rules.diagnosis.tail_bits import EVERY_ID, in_a_row
from analyzer.rules.transfers.formulas import Formulas
from analyzer.rules.transfers.incomplete import (
    CHECKSUM,
    CUT,
    DROPS,
    LATE,
    SECONDS,
    SEQUENCE,
    Incomplete,
    Unsearched,
    occurrence,
    occurrences_of,
    take_row,
    with_end,
)
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.diagnosis.neighbours import Neighbours
    from analyzer.rules.diagnosis.proofs import Part, Proof
    from dissectors.kit import Array, Occurrences, Severity, Values, View

_TOGGLE, _CRC, _ABANDONED, _TIMEOUT = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "abandoned", "timeout")
)
_DAMAGES = 2  # after so many of a sender two have to agree on any mistake
_TWO = 2  # frames: either may have the wrong ID
_NEXT = 20 * MILLISECOND  # in which the next frame of a transfer would have come


class Reassembly(Rule):
    """Toggles that do not alternate, ends that never came, CRCs that do not fit."""

    rules = ("TRF-003", "TRF-006", "TRF-007", "TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        rules = (SEQUENCE, CUT, LATE, CHECKSUM)
        self._budgets = {rule: SearchBudget() for rule in rules}
        self._causes = {rule: KnownCauses() for rule in rules}
        # In the order in which they ended, so that what is known of a sender does not depend on the batches.
        self._waiting: dict[str, deque[Incomplete]] = {rule: deque() for rule in rules}
        self._unsearched: list[Unsearched] = []
        self._neighbours = NeighbourFinder()
        self._ways: dict[tuple[int, int, int], Formula] = {}
        self._formulas = Formulas()
        self._damages: dict[tuple[int, int, int], int] = {}  # wrong CRCs of a sender that no mistake explains
        self._mistaken: set[tuple[int, int, int]] = set()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        bits = view.transfers.anomaly & (_TOGGLE | _CRC | _ABANDONED | _TIMEOUT)
        if bits.any():
            self._add(view, bits)
        end = view.frames.first + len(view.frames)
        for waiting in self._waiting.values():
            while waiting and waiting[0].frames[-1] + AHEAD < end:
                yield from self._explained(view, waiting.popleft())
        yield from occurrences_of(view, self._unsearched)
        self._unsearched.clear()

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield those at the end of the capture."""
        for waiting in self._waiting.values():
            for one in waiting:
                yield from self._explained(view, one)
        yield from self._formulas.finish()
        for unsearched in self._unsearched:
            yield unsearched.alone(view)

    def _add(self, view: View, bits: Array) -> None:
        """Add what this batch shows."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        kinds = {SEQUENCE: ~whole, CUT: whole & cut, LATE: whole & late, CHECKSUM: bits & _CRC != 0}
        for rule, mask in kinds.items():
            for row in np.flatnonzero(mask).tolist():
                one = take_row(view, rule, row)
                ended = CUT if cut[row] else LATE if late[row] else ""
                searched = self._budgets[rule].take(one.sender)
                self._waiting[rule].append(one._replace(searched=searched, ended=ended))

    def _known(self, one: Incomplete) -> Cause | None:
        """Return the mistake that was found before and explains this one too."""
        way = self._ways.get(one.sender)
        return Cause(way.name) if way is not None and way.gives(one.wire, one.payload) else None

    def _explained(self, view: View, one: Incomplete) -> Iterator[Occurrence]:
        if one.rule == CHECKSUM:
            yield from self._checksum(view, one)
            return
        here = self._neighbours.of(view, one.frames, one.code, fd=one.fd) if one.searched else None
        if here is None:
            self._like(view, one)
            return
        excused: Severity | None = "note" if _in_gap(view, one, here.near) else None
        around = here.around()
        copy = _copy(here)
        proof = None if copy is not None else proofs.proven(here.parts, around, here.expected)
        row = None if proof is not None or copy is not None else in_a_row(here.parts, here.near, here.expected)
        same_id = [part for part in around if part.transfer_id == here.parts[0].transfer_id]
        if copy is not None:
            cause, elsewhere = copy, False
        elif proof is not None:
            cause = _surely(proof.cause, here)
            elsewhere = one.rule == CUT and _belongs_to_another(cause, proof.order, here.parts, around)
        elif row is not None:
            cause, elsewhere = row.cause, row.order[0] not in here.parts
        else:
            cause, elsewhere = missing(here.parts, here.expected) or Cause(NO_ORDER), False
            if not here.expected.starts and same_id:
                cause = Cause(proofs.UNPROVEN)
        misnumbered = _misnumbered(proof or row, here)
        if misnumbered:
            cause = Cause(proofs.OTHER_ID, f" in frame {' or '.join(str(part.number + 1) for part in misnumbered)}")
        self._causes[one.rule].note(one.sender, one.shape, "" if elsewhere else cause.what)
        if elsewhere:
            return
        if cause.what == EVERY_ID or (proof is not None and cause.what == proofs.OTHER_ID and not misnumbered):
            excused = "note"  # TRF-009 names the frames
        evidence = [part.number for part in same_id if proof is not None or one.rule == SEQUENCE]
        yield from with_end(view, one, replace(occurrence(view, one, cause, evidence), severity=excused))

    def _like(self, view: View, one: Incomplete) -> None:
        """Add one that nothing is searched for."""
        what = self._causes[one.rule].like(one.sender, one.shape)
        if what:
            cause = Cause(what, "" if what == NOT_SEARCHED else LIKE)
            noted = what in {EVERY_ID, proofs.OTHER_ID} or (one.rule in DROPS and _in_gap(view, one, ()))
            self._unsearched += Unsearched(one, cause, noted, drops=True).with_end()

    def _checksum(self, view: View, one: Incomplete) -> Iterator[Occurrence]:
        name = _undefined(view, one)
        if name:
            yield occurrence(view, one, Cause(f"the CRC of {name}"))
            yield occurrence(view, one._replace(rule="CAN-020"), Cause(name))
            return
        mistake = self._mistake(view, one)
        if mistake is not None:
            # They cost no search, so there may be any number of them.
            self._unsearched += (
                Unsearched(to, mistake, noted=False, drops=False) for to in (one, one._replace(rule="TRF-011"))
            )
            return
        fits = self._formulas.of(view, one) if one.searched else []
        proved = self._formulas.proved(one, fits)
        if proved is not None:
            self._learn(one, proved)
            yield from self._formulas.told(view, one, proved)
            return
        yield from self._formulas.release(one)
        if one.sender in self._damages or len(self._damages) < MOST_SENDERS:
            self._damages[one.sender] = min(self._damages.get(one.sender, 0) + 1, _DAMAGES)
        if not fits:
            yield from self._damaged(view, one, alone=False)
            return
        before = len(self._unsearched)
        found = [*self._damaged(view, one, alone=True)]
        found += (unsearched.alone(view) for unsearched in self._unsearched[before:])
        del self._unsearched[before:]
        if not self._formulas.hold(view, one, fits, found):
            yield from found

    def _damaged(self, view: View, one: Incomplete, *, alone: bool) -> Iterator[Occurrence]:
        """Yield a wrong CRC that no known mistake explains, but its surroundings may; `alone`: no other one like it."""
        here = self._neighbours.of(view, one.frames, one.code, fd=one.fd) if one.searched else None
        if here is None:
            self._like(view, one)
            return
        around = here.around()
        proof = proofs.proven(here.parts, around, here.expected)
        if proof is not None:
            self._causes[CHECKSUM].note(one.sender, one.shape, proof.cause.what)
            order = {part.number for part in proof.order}
            elsewhere = (
                proof.order[0] not in here.parts and proof.cause.what == proofs.START_BIT
            )  # by the part before (TRF-006)
            evidence = [part.number for part in around if part.number in order]
            noted = elsewhere or proof.cause.what == proofs.OTHER_ID
            yield replace(occurrence(view, one, proof.cause, evidence), severity="note" if noted else None)
            return
        short = next((p for p in here.parts[:-1] if len(p.body) < here.expected.room), None)
        bit = _bit(one)
        if short is not None and not bit.detail:
            cause = Cause(checksums.SHORT_FRAME, f" ({len(short.body) + 1} bytes in frame {short.number + 1}, TRF-012)")
            self._causes[CHECKSUM].note(one.sender, one.shape, cause.what)
            yield replace(occurrence(view, one, cause), severity="note")
            return
        common = "" if alone or bit.detail else _common(view, one, here)
        if common:
            self._remember(one, Formula(common, _start_of(one)))
            yield occurrence(view, one, Cause(common))
            yield occurrence(view, one._replace(rule="TRF-011"), Cause(common))
            return
        other = bit if here.expected.lengths else Cause(checksums.DOUBTFUL)
        cause = bit if bit.detail else missing(here.parts, here.expected) or other
        self._causes[CHECKSUM].note(one.sender, one.shape, cause.what)
        yield replace(occurrence(view, one, cause), drops=True)

    def _mistake(self, view: View, one: Incomplete) -> Cause | None:
        """Return what the sender computed instead.

        Of what is not searched any more only a mistake that it has made before.
        """
        known = self._known(one)
        again = one.sender in self._mistaken
        if known is not None or not (one.searched or again):
            return known
        if not again and self._damages.get(one.sender, 0) >= _DAMAGES:
            return None
        found = self._formulas.common(view, one)
        if found is not None:
            self._learn(one, Formula(found.what, _start_of(one)))
        return found

    def _learn(self, one: Incomplete, mistake: Formula) -> None:
        """Note a mistake of a sender, so that further ones cost no search."""
        if mistake.name in checksums.BY_PAYLOAD:
            if len(self._mistaken) < MOST_SENDERS:
                self._mistaken.add(one.sender)
        else:
            self._remember(one, mistake)

    def _remember(self, one: Incomplete, way: Formula) -> None:
        """Remember how a sender computes its CRCs."""
        if len(self._ways) < MOST_SENDERS:
            self._ways.setdefault(one.sender, way)


def _copy(here: Neighbours) -> Cause | None:
    """Return the cause of a copy, unless a sender counts every frame: its tail bytes come round by themselves."""
    copy = here.copy()
    row = None if copy is None else in_a_row(here.parts, here.near, here.expected)
    return None if row is not None and row.cause.what == EVERY_ID else copy


def _in_gap(view: View, one: Incomplete, near: Sequence[Part]) -> bool:
    """Return whether what a transfer lacks may have come in a gap of the capture (CAP-002)."""
    if one.t == NO_TIME:
        return False
    if one.rule == LATE:
        return view.paused(one.t, one.t + round(SECONDS * SECOND))
    if one.rule == CUT and view.paused(one.end, one.end + _NEXT):
        behind = (view.frame(part.number) for part in near if part.number > one.frames[-1])
        return not any(kept is not None and kept.t - one.end <= _NEXT for kept in behind)
    return view.paused(one.t, one.end)


def _misnumbered(proof: Proof | None, here: Neighbours) -> list[Part]:
    """Return the first frame of a transfer of two if its ID is wrong, both if nobody knows, none if it is right."""
    if proof is None or proof.cause.what != proofs.OTHER_ID or len(proof.order) != _TWO:
        return []
    wrong = here.misnumbered(proof.order)
    return wrong if proof.order[0] in wrong else []


def _surely(cause: Cause, here: Neighbours) -> Cause:
    """Return the cause; two equal frames that are swapped once and again are toggles that stand still."""
    return Cause(proofs.WRONG_BIT) if cause.what == proofs.EITHER and here.unsteady() else cause


def _belongs_to_another(cause: Cause, order: Sequence[Part], parts: Sequence[Part], around: Sequence[Part]) -> bool:
    """Return whether the last frame belongs to a later attempt with the same ID, of which the same is said."""
    later = any(part.start and not part.toggle and part.number > parts[-1].number for part in around)
    return later and cause.what in {proofs.REPEATED, proofs.SWAPPED} and order[-1] not in parts


def _start_of(one: Incomplete) -> int:
    return checksums.start_of(one.wire, one.payload)


def _bit(one: Incomplete) -> Cause:
    """Return the cause: corrupted, and where, if one turned bit explains it."""
    at = checksums.one_bit(one.wire ^ one.here, len(one.payload))
    place = None if at is None else checksums.BytePlace.of(at, 63 if one.fd else 7)
    if place is None or place.frame >= len(one.frames):
        return Cause(checksums.CORRUPTED)
    return Cause(checksums.CORRUPTED, f" (one bit turned in byte {place.byte} of frame {one.frames[place.frame] + 1})")


def corrupted(wire: int, here: int, length: int, frames: Sequence[int], *, fd: bool) -> Values:
    """Return what is said of a transfer whose CRC is `wire` and should be `here`, if nothing but its bytes is known."""
    one = Incomplete(CHECKSUM, 0, 0, 0, 0, fd, frames, wire, here, bytes(length), length, 0)
    cause = _bit(one)
    return {"crc_wire": wire, "crc_here": here, "cause": cause.what, "why": f": {cause.what}{cause.detail}"}


def _common(view: View, one: Incomplete, here: Neighbours) -> str:
    """Return the start value that explains this and most of the other wrong CRCs nearby; nothing if none does."""
    runs = [run for run in here.whole if not here.expected.fits(run)]
    wrong = [(b"".join(part.body for part in run), run[0].transfer_id) for run in runs]
    mine = one.wire.to_bytes(2, "little") + one.payload, here.parts[0].transfer_id
    others = [joined for joined, number in wrong if (joined, number) != mine and len(joined) > 2]
    wires = np.array([int.from_bytes(joined[:2], "little") for joined in others], np.int64)
    start = _start_of(one)
    same = int((checksums.starts_of(wires, [joined[2:] for joined in others]) == start).sum()) if others else 0
    if not same or 2 * same < len(others):
        return ""
    names = view.types.starting_from(start)
    if names:
        return f"{checksums.OF}{' or '.join(names)}"
    return checksums.FROM_ZERO if not start else f"wrong signature, a CRC that starts from {start:04X}"


def _undefined(view: View, one: Incomplete) -> str:
    """Return the name of a type without a definition whose signature gives the CRC of a transfer."""
    others = view.types.undefined(one.code)
    return next((name for sign, name in others.items() if crc_hqx(one.payload, crc_start(sign)) == one.wire), "")
