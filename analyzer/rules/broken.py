"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules import checksums, diagnosis
from analyzer.rules.bits import EVERY_ID, in_a_row
from analyzer.rules.definitions import crc_start
from analyzer.rules.diagnosis import Cause
from analyzer.rules.habits import LIKE, MOST_SENDERS, NOT_SOUGHT, Budget, Habits
from analyzer.rules.losses import NO_ORDER, missing
from analyzer.rules.surroundings import AHEAD, Scenes
from analyzer.rules.torn import (
    CHECKSUM,
    CUT,
    DROPS,
    LATE,
    SECONDS,
    SEQUENCE,
    Aside,
    Torn,
    occurrence,
    said,
    together,
    torn,
    types_of,
)
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.diagnosis import Part
    from analyzer.rules.surroundings import Scene
    from dissectors.conformance import Found, Severity, Values, View, Words

_TOGGLE, _CRC, _OTHER_TYPE, _ABANDONED, _TIMEOUT = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "other type", "abandoned", "timeout")
)
_NEXT = 20 * MILLISECOND  # in which the next frame of a transfer would have come


class Broken(Watcher):
    """Toggles that do not alternate, ends that never came, CRCs that do not fit."""

    rules = ("TRF-003", "TRF-006", "TRF-007", "TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        rules = (SEQUENCE, CUT, LATE, CHECKSUM)
        self._budgets = {rule: Budget() for rule in rules}
        self._habits = {rule: Habits() for rule in rules}
        # In the order in which they ended, so that what is known of a sender does not depend on the batches.
        self._waiting: dict[str, deque[Torn]] = {rule: deque() for rule in rules}
        self._aside: list[Aside] = []
        self._scenes = Scenes()
        self._starts: dict[tuple[int, int, int], tuple[int, str]] = {}
        self._mistaken: set[tuple[int, int, int]] = set()

    def look(self, view: View) -> Iterator[Found | Occurrence]:
        """Those whose surroundings are known by now."""
        self._scenes.add(view)
        bits = view.transfers.anomaly & (_TOGGLE | _CRC | _OTHER_TYPE | _ABANDONED | _TIMEOUT)
        if bits.any():
            yield from _plain(view, bits)
            self._add(view, bits)
        end = view.frames.first + len(view.frames)
        for waiting in self._waiting.values():
            while waiting and waiting[0].frames[-1] + AHEAD < end:
                yield from self._explained(view, waiting.popleft())
        yield from together(view, self._aside)
        self._aside.clear()

    def settle(self, view: View) -> Iterator[Occurrence]:
        """Those at the end of the capture."""
        for waiting in self._waiting.values():
            for one in waiting:
                yield from self._explained(view, one)
        for aside in self._aside:
            yield aside.alone(view)

    def _add(self, view: View, bits: Words) -> None:
        """Takes in what this batch shows."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        kinds = {SEQUENCE: ~whole, CUT: whole & cut, LATE: whole & late, CHECKSUM: bits & _CRC != 0}
        for rule, mask in kinds.items():
            for row in np.flatnonzero(mask).tolist():
                one = torn(view, rule, row)
                ended = CUT if cut[row] else LATE if late[row] else ""
                sought = self._budgets[rule].take(one.sender)
                self._waiting[rule].append(one._replace(sought=sought, ended=ended))

    def _known(self, one: Torn) -> Cause | None:
        """The mistake that was found before and explains this one too."""
        start, mistake = self._starts.get(one.sender, (0, ""))
        return Cause(mistake) if mistake and crc_hqx(one.payload, start) == one.wire else None

    def _explained(self, view: View, one: Torn) -> Iterator[Occurrence]:
        if one.rule == CHECKSUM:
            yield from self._checksum(view, one)
            return
        here = self._scenes.of(view, one.frames, one.code, fd=one.fd) if one.sought else None
        if here is None:
            self._like(view, one)
            return
        excused: Severity | None = "note" if _in_gap(view, one, here.near) else None
        around = here.around()
        proof = diagnosis.proven(here.parts, around, here.expected)
        row = None if proof is not None else in_a_row(here.parts, here.near, here.expected)
        strays = [part for part in around if part.transfer_id == here.parts[0].transfer_id]
        if proof is not None:
            cause = _surely(proof.cause, here)
            told = one.rule == CUT and _told_by_another(cause, proof.order, here.parts, around)
        elif row is not None:
            cause, told = row.cause, row.order[0] not in here.parts
        else:
            cause, told = missing(here.parts, here.expected) or Cause(NO_ORDER), False
            if not here.expected.starts and strays:
                cause = Cause(diagnosis.UNPROVEN)
        self._habits[one.rule].note(one.sender, one.shape, "" if told else cause.what)
        if told:
            return
        if cause.what == EVERY_ID or (proof is not None and cause.what == diagnosis.OTHER_ID):
            excused = "note"  # TRF-009 names the frames
        evidence = [part.number for part in strays if proof is not None or one.rule == SEQUENCE]
        yield from said(view, one, replace(occurrence(view, one, cause, evidence), severity=excused))

    def _like(self, view: View, one: Torn) -> None:
        """One that nothing is searched for."""
        what = self._habits[one.rule].like(one.sender, one.shape)
        if what:
            cause = Cause(what, "" if what == NOT_SOUGHT else LIKE)
            noted = what in {EVERY_ID, diagnosis.OTHER_ID} or (one.rule in DROPS and _in_gap(view, one, ()))
            self._aside += Aside(one, cause, noted, drops=True).with_end()

    def _checksum(self, view: View, one: Torn) -> Iterator[Occurrence]:
        name = _undefined(view, one)
        if name:
            yield occurrence(view, one, Cause(f"the CRC of {name}"))
            yield occurrence(view, one._replace(rule="CAN-020"), Cause(name))
            return
        mistake = self._mistake(view, one)
        if mistake is not None:
            # They cost no search, so there may be any number of them.
            self._aside += (Aside(to, mistake, noted=False, drops=False) for to in (one, one._replace(rule="TRF-011")))
            return
        here = self._scenes.of(view, one.frames, one.code, fd=one.fd) if one.sought else None
        if here is None:
            self._like(view, one)
            return
        around = here.around()
        proof = diagnosis.proven(here.parts, around, here.expected)
        if proof is not None:
            self._habits[CHECKSUM].note(one.sender, one.shape, proof.cause.what)
            taken = {part.number for part in proof.order}
            told = (
                proof.order[0] not in here.parts and proof.cause.what == diagnosis.START_BIT
            )  # by the part before (TRF-006)
            evidence = [part.number for part in around if part.number in taken]
            noted = told or proof.cause.what == diagnosis.OTHER_ID
            yield replace(occurrence(view, one, proof.cause, evidence), severity="note" if noted else None)
            return
        short = next((p for p in here.parts[:-1] if len(p.body) < here.expected.room), None)
        bit = _bit(one)
        if short is not None and not bit.detail:
            cause = Cause(checksums.SHORT_FRAME, f" ({len(short.body) + 1} bytes in frame {short.number + 1}, TRF-012)")
            self._habits[CHECKSUM].note(one.sender, one.shape, cause.what)
            yield replace(occurrence(view, one, cause), severity="note")
            return
        common = "" if bit.detail else _common(view, one, here)
        if common:
            self._remember(one, common)
            yield occurrence(view, one, Cause(common))
            yield occurrence(view, one._replace(rule="TRF-011"), Cause(common))
            return
        other = bit if here.expected.lengths else Cause(checksums.DOUBTFUL)
        cause = bit if bit.detail else missing(here.parts, here.expected) or other
        self._habits[CHECKSUM].note(one.sender, one.shape, cause.what)
        yield replace(occurrence(view, one, cause), drops=not bit.detail)

    def _mistake(self, view: View, one: Torn) -> Cause | None:
        """What the sender computed instead; of what is not searched any more only a mistake that it has made before."""
        known = self._known(one)
        if known is not None or not (one.sought or one.sender in self._mistaken):
            return known
        found = checksums.wrong_crc(
            one.wire, one.payload, view.types.signatures(one.code), view.types.mistaken(one.code)
        )
        if found is not None:
            if found.what == checksums.NO_SIGNATURE or found.what.startswith(checksums.OF):
                self._remember(one, found.what)
            elif len(self._mistaken) < MOST_SENDERS:
                self._mistaken.add(one.sender)
        return found

    def _remember(self, one: Torn, mistake: str) -> None:
        """What the CRCs of a sender start from."""
        if len(self._starts) < MOST_SENDERS:
            self._starts.setdefault(one.sender, (_start_of(one), mistake))


def _plain(view: View, bits: Words) -> Iterator[Found]:
    """What needs no search: types that a CRC names."""
    t = view.transfers
    names = {row: view.type_name(int(t.code[row])) for row in np.flatnonzero(bits & _OTHER_TYPE).tolist()}
    if names:
        yield view.among_transfers(
            "CAN-020", np.array([*names], np.int64), lambda row: types_of(view, int(t.code[row]), names[row])
        )


def _in_gap(view: View, one: Torn, near: Sequence[Part]) -> bool:
    """Whether what a transfer lacks may have come in a gap of the capture (CAP-002)."""
    if one.t == NO_TIME:
        return False
    if one.rule == LATE:
        return view.paused(one.t, one.t + round(SECONDS * SECOND))
    if one.rule == CUT and view.paused(one.end, one.end + _NEXT):
        behind = (view.frame(part.number) for part in near if part.number > one.frames[-1])
        return not any(kept is not None and kept.t - one.end <= _NEXT for kept in behind)
    return view.paused(one.t, one.end)


def _surely(cause: Cause, here: Scene) -> Cause:
    """Two equal frames that are swapped once and again are toggles that stand still."""
    return Cause(diagnosis.WRONG_BIT) if cause.what == diagnosis.EITHER and here.unsteady() else cause


def _told_by_another(cause: Cause, order: Sequence[Part], parts: Sequence[Part], around: Sequence[Part]) -> bool:
    """Whether the last frame belongs to a later attempt with the same ID, of which the same is said."""
    later = any(part.start and not part.toggle and part.number > parts[-1].number for part in around)
    return later and cause.what in {diagnosis.REPEATED, diagnosis.SWAPPED} and order[-1] not in parts


def _start_of(one: Torn) -> int:
    return int(checksums.starts_of(np.array([one.wire]), [one.payload])[0])


def _bit(one: Torn) -> Cause:
    """Corrupted; where, if one turned bit explains it."""
    at = checksums.one_bit(one.wire ^ one.here, len(one.payload))
    place = None if at is None else checksums.Place.of(at, 63 if one.fd else 7)
    if place is None or place.frame >= len(one.frames):
        return Cause(checksums.CORRUPTED)
    return Cause(checksums.CORRUPTED, f" (one bit turned in byte {place.byte} of frame {one.frames[place.frame] + 1})")


def corrupted(wire: int, here: int, length: int, frames: Sequence[int], *, fd: bool) -> Values:
    """What is said of a transfer whose CRC is `wire` and should be `here`, if nothing but its bytes is known."""
    one = Torn(CHECKSUM, 0, 0, 0, 0, fd, frames, wire, here, bytes(length), length, 0)
    cause = _bit(one)
    return {"crc_wire": wire, "crc_here": here, "cause": cause.what, "why": f": {cause.what}{cause.detail}"}


def _common(view: View, one: Torn, here: Scene) -> str:
    """The start value that explains this and most of the other wrong CRCs nearby; nothing if none does."""
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


def _undefined(view: View, one: Torn) -> str:
    """The name of a type without a definition whose signature gives the CRC of a transfer."""
    others = view.types.undefined(one.code)
    return next((name for sign, name in others.items() if crc_hqx(one.payload, crc_start(sign)) == one.wire), "")
