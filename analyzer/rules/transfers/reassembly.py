"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
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
    occurrence,
    turned_bit,
    with_end,
)
from analyzer.rules.transfers.unsearched import ENDED, TURNED_BIT, Rows, Told
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Rule
from dissectors.kit.definitions import crc_start
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.diagnosis.budgets import Sender, Shape
    from analyzer.rules.diagnosis.neighbours import Neighbours
    from analyzer.rules.diagnosis.proofs import Part, Proof
    from analyzer.rules.transfers.incomplete import Incomplete
    from dissectors.kit import Array, Occurrence, Occurrences, Severity, TransferTable, View

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
        self._waiting: dict[str, deque[Rows]] = {rule: deque() for rule in rules}
        self._told = Told()
        self._neighbours = NeighbourFinder()
        self._ways: dict[Sender, Formula] = {}
        self._formulas = Formulas()
        self._damages: dict[Sender, int] = {}  # wrong CRCs of a sender that no mistake explains
        self._mistaken: set[Sender] = set()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        bits = view.transfers.anomaly & (_TOGGLE | _CRC | _ABANDONED | _TIMEOUT)
        if bits.any():
            self._add(view.transfers, bits)
        yield from self._ready(view, view.frames.first + len(view.frames) - AHEAD)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those at the end of the capture."""
        yield from self._ready(view, None)
        yield from self._formulas.finish()

    def _add(self, t: TransferTable, bits: Array) -> None:
        """Add what a batch shows."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        kinds = {SEQUENCE: ~whole, CUT: whole & cut, LATE: whole & late, CHECKSUM: bits & _CRC != 0}
        ended = np.where(cut, ENDED.index(CUT), np.where(late, ENDED.index(LATE), 0))
        for rule, mask in kinds.items():
            rows = np.flatnonzero(mask)
            if len(rows):
                self._waiting[rule].append(Rows.of(rule, t, rows, ended[rows]))

    def _ready(self, view: View, end: int | None) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose last frame came before `end`, None for all."""
        for waiting in self._waiting.values():
            while waiting:
                rows = waiting.popleft()
                ready = len(rows.row) if end is None else rows.before(end)
                yield from self._explained(view, rows.take(slice(ready)))
                if ready < len(rows.row):
                    waiting.appendleft(rows.take(slice(ready, None)))
                    break
        yield from self._told.occurrences(view)

    def _explained(self, view: View, rows: Rows) -> Iterator[Occurrence]:
        """Yield those that are searched; the others are told together."""
        budget, by_crc = self._budgets[rows.rule], rows.rule == CHECKSUM
        turned = rows.turned() if by_crc else None
        for k, (sender, shape, last) in enumerate(rows.each()):
            if by_crc and self._is_known(view, rows, k, sender):
                continue
            if budget.take(sender, last):
                yield from (self._checksum if by_crc else self._broken)(view, rows.one(k))
                continue
            if by_crc:
                yield from self._damage(sender)
            if turned is not None and turned[k]:
                self._told.add(rows, k, TURNED_BIT, drops=True)
                continue
            cause, noted = self._like(view, rows.rule, sender, shape, *rows.times(k))
            if cause is not None:
                self._told.add(rows, k, cause, noted=noted, drops=True)

    def _is_known(self, view: View, rows: Rows, k: int, sender: Sender) -> bool:
        """Tell of a wrong CRC if a mistake gives it that needs no search; return whether one does."""
        undefined = view.types.undefined(sender[-1])
        if not undefined and sender not in self._ways and sender not in self._mistaken:
            return False
        wire, payload = rows.crc_and_payload(k)
        name = next((name for sign, name in undefined.items() if crc_hqx(payload, crc_start(sign)) == wire), "")
        if name:
            self._told.add(rows, k, Cause(f"the CRC of {name}"))
            self._told.add(rows, k, Cause(name), rule="CAN-020")
            return True
        way = self._ways.get(sender)
        cause = Cause(way.name) if way is not None and way.gives(wire, payload) else None
        if cause is None and sender in self._mistaken:
            cause = self._common(view, rows.one(k))
        if cause is not None:
            self._told.add(rows, k, cause)
            self._told.add(rows, k, cause, rule="TRF-011")
        return cause is not None

    def _broken(self, view: View, one: Incomplete) -> Iterator[Occurrence]:
        here = self._neighbours.of(view, one.frames, one.code, fd=one.fd)
        if here is None:
            yield from self._alike(view, one)
            return
        behind = [part for part in here.near if part.number > one.frames[-1]]
        excused: Severity | None = "note" if _in_gap(view, one.rule, one.t, one.end, behind) else None
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

    def _like(self, view: View, rule: str, sender: Sender, shape: Shape, t: int, end: int) -> tuple[Cause | None, bool]:
        """Return the cause of one that is not searched, None if another one tells of it; and whether it is a note."""
        what = self._causes[rule].like(sender, shape)
        noted = what in {EVERY_ID, proofs.OTHER_ID} or (rule in DROPS and _in_gap(view, rule, t, end))
        return (Cause(what, "" if what == NOT_SEARCHED else LIKE) if what else None), noted

    def _alike(self, view: View, one: Incomplete) -> Iterator[Occurrence]:
        """Yield one whose surroundings are gone."""
        cause, noted = self._like(view, one.rule, one.sender, one.shape, one.t, one.end)
        if cause is not None:
            found = replace(occurrence(view, one, cause), severity="note" if noted else None, drops=True)
            yield from with_end(view, one, found)

    def _checksum(self, view: View, one: Incomplete) -> Iterator[Occurrence]:
        mistake = self._common(view, one) if self._damages.get(one.sender, 0) < _DAMAGES else None
        if mistake is not None:
            yield from (occurrence(view, one._replace(rule=rule), mistake) for rule in (CHECKSUM, "TRF-011"))
            return
        fits = self._formulas.of(view, one)
        proved = self._formulas.proved(one, fits)
        if proved is not None:
            self._learn(one, proved)
            yield from self._formulas.told(view, one, proved)
            return
        yield from self._damage(one.sender)
        found = self._damaged(view, one, alone=bool(fits))
        if not fits:
            yield from found
            return
        otherwise = [*found]
        if not self._formulas.hold(view, one, fits, otherwise):
            yield from otherwise

    def _damage(self, sender: Sender) -> Iterator[Occurrence]:
        """Note a wrong CRC that no mistake explains; yield what is said of the one before it that fits one."""
        yield from self._formulas.release(sender)
        if sender in self._damages or len(self._damages) < MOST_SENDERS:
            self._damages[sender] = min(self._damages.get(sender, 0) + 1, _DAMAGES)

    def _damaged(self, view: View, one: Incomplete, *, alone: bool) -> Iterator[Occurrence]:
        """Yield a wrong CRC that no known mistake explains, but its surroundings may; `alone`: no other one like it."""
        here = self._neighbours.of(view, one.frames, one.code, fd=one.fd)
        if here is None:
            yield from self._alike(view, one)
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
        bit = turned_bit(one)
        if short is not None and not bit.detail:
            cause = Cause(checksums.SHORT_FRAME, f" ({len(short.body) + 1} bytes in frame {short.number + 1}, TRF-012)")
            self._causes[CHECKSUM].note(one.sender, one.shape, cause.what)
            yield replace(occurrence(view, one, cause), severity="note")
            return
        common = "" if alone or bit.detail else _shared(view, one, here)
        if common:
            self._remember(one, Formula(common, _start_of(one)))
            yield occurrence(view, one, Cause(common))
            yield occurrence(view, one._replace(rule="TRF-011"), Cause(common))
            return
        other = bit if here.expected.lengths else Cause(checksums.DOUBTFUL)
        cause = bit if bit.detail else missing(here.parts, here.expected) or other
        self._causes[CHECKSUM].note(one.sender, one.shape, cause.what)
        yield replace(occurrence(view, one, cause), drops=True)

    def _common(self, view: View, one: Incomplete) -> Cause | None:
        """Return what the sender computed instead, if that is a common mistake."""
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


def _in_gap(view: View, rule: str, t: int, end: int, behind: Sequence[Part] = ()) -> bool:
    """Return whether what a transfer lacks may have come in a gap of the capture (CAP-002).

    `behind` are the frames of its session that come after its last one, at `end`.
    """
    if t == NO_TIME:
        return False
    if rule == LATE:
        return view.paused(t, t + round(SECONDS * SECOND))
    if rule == CUT and view.paused(end, end + _NEXT):
        later = (view.frame(part.number) for part in behind)
        return not any(kept is not None and kept.t - end <= _NEXT for kept in later)
    return view.paused(t, end)


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


def _shared(view: View, one: Incomplete, here: Neighbours) -> str:
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
