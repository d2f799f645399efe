"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.checksums import (
    CORRUPTED,
    DOUBTFUL,
    FROM_ZERO,
    NO_SIGNATURE,
    OF,
    Place,
    one_bit,
    starts_of,
    wrong_crc,
)
from analyzer.rules.definitions import crc_start
from analyzer.rules.diagnosis import REPEATED, SWAPPED, UNPROVEN, Cause, break_at, proven
from analyzer.rules.losses import NO_ORDER, missing
from analyzer.rules.surroundings import AHEAD, Scenes, parts_of
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.rules.diagnosis import Part
    from analyzer.rules.surroundings import Scene
    from dissectors.conformance import Found, Severity, Values, View, Words

_TOGGLE, _CRC, _OTHER_TYPE, _ABANDONED, _TIMEOUT = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "other type", "abandoned", "timeout")
)
_SEQUENCE, _CUT, _LATE, _CHECKSUM = "TRF-003", "TRF-006", "TRF-007", "TRF-010"
_DROPS = {_SEQUENCE, _CUT, _LATE}  # what frames that the recorder lost may explain, whatever the cause
_PREFERRED = 0xFF_FFFF  # bits of a type's code: all but the variant
_NEXT = 20 * MILLISECOND  # in which the next frame of a transfer would have come
_SECONDS = 2.0  # where the core closes a transfer
NOT_SOUGHT = "further ones, cause not sought"
BY_SEQUENCE = "broken sequence"
MOST_SOUGHT = 500  # transfers of one type and sender whose cause is searched
MOST_IN_ALL = 4000
MOST_SENDERS = 4096  # of which that is counted


class Budget:
    """Counts searches, so that a sender whose every transfer is broken costs no more than a bounded time."""

    def __init__(self) -> None:
        self._spent: dict[tuple[int, int, int], int] = {}
        self._left = MOST_IN_ALL

    def take(self, key: tuple[int, int, int]) -> bool:
        """Whether one more search may be made for a sender and type: (bus, node, type)."""
        spent = self._spent.get(key, MOST_SOUGHT if len(self._spent) >= MOST_SENDERS else 0)
        if spent >= MOST_SOUGHT or not self._left:
            return False
        self._spent[key] = spent + 1
        self._left -= 1
        return True


class _Broken(NamedTuple):
    """A transfer, and the rule that it breaches."""

    rule: str
    t: int
    bus: int
    src: int
    code: int
    fd: bool
    frames: Sequence[int]
    wire: int
    here: int
    payload: bytes
    received: int
    end: int

    @property
    def sender(self) -> tuple[int, int, int]:
        """Bus, node and type."""
        return self.bus, self.src, self.code


class Broken(Watcher):
    """Toggles that do not alternate, ends that never came, CRCs that do not fit."""

    rules = ("TRF-003", "TRF-006", "TRF-007", "TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        self._budgets = {rule: Budget() for rule in (_SEQUENCE, _CUT, _LATE, _CHECKSUM)}
        self._scenes = Scenes()
        self._waiting: list[_Broken] = []
        self._starts: dict[tuple[int, int, int], tuple[int, str]] = {}

    def look(self, view: View) -> Iterator[Found | Occurrence]:
        """Those whose surroundings are known by now."""
        t = view.transfers
        bits = t.anomaly & (_TOGGLE | _CRC | _OTHER_TYPE | _ABANDONED | _TIMEOUT)
        further: dict[str, Words] = {}
        if bits.any():
            yield from _plain(view, bits)
            further = self._add(view, bits)
        if not self._waiting and not further:
            return
        end = view.frames.first + len(view.frames)
        ready = [one for one in self._waiting if one.frames[-1] + AHEAD < end]
        self._waiting = [one for one in self._waiting if one.frames[-1] + AHEAD >= end]
        for one in ready:
            yield from self._explained(view, one)
        for rule, rows in further.items():
            yield from self._further(view, rule, rows)

    def settle(self, view: View) -> Iterator[Occurrence]:
        """Those at the end of the capture."""
        for one in self._waiting:
            yield from self._explained(view, one)

    def _add(self, view: View, bits: Words) -> dict[str, Words]:
        """Takes in what this batch shows; gives the rows by rule whose cause is not searched any more."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        kinds = {_SEQUENCE: ~whole, _CUT: whole & cut, _LATE: whole & late, _CHECKSUM: bits & _CRC != 0}
        t, further = view.transfers, {}
        for rule, mask in kinds.items():
            rows = np.flatnonzero(mask)
            who = zip(t.bus[rows].tolist(), t.src[rows].tolist(), t.code[rows].tolist(), strict=True)
            sought = np.fromiter((self._budgets[rule].take(sender) for sender in who), bool, len(rows))
            self._waiting += [_broken(view, rule, row) for row in rows[sought].tolist()]
            if not sought.all():
                further[rule] = rows[~sought]
        return further

    def _further(self, view: View, rule: str, rows: Words) -> Iterator[Found]:
        """Those that nothing is searched for: a mistake that their sender has made before is known all the same."""
        t, causes = view.transfers, dict.fromkeys(rows.tolist(), NOT_SOUGHT)
        if rule == _CHECKSUM and self._starts:
            starts = starts_of(t.crc_wire[rows], [t.payload(row) for row in causes])
            for row, start in zip(causes, starts.tolist(), strict=True):
                seed, mistake = self._starts.get((int(t.bus[row]), int(t.src[row]), int(t.code[row])), (None, ""))
                causes[row] = mistake if seed == start else NOT_SOUGHT

        def values(row: int, of: str = rule) -> Values:
            return _values(view, _broken(view, of, row), Cause(causes[row]))

        key = np.array([*causes.values()], str)
        lost = rule in _DROPS or not self._starts
        yield view.among_transfers(rule, rows, values, key=key, drops=lost)
        known = _array(row for row, cause in causes.items() if cause != NOT_SOUGHT)
        if len(known):
            key = np.array([causes[row] for row in known.tolist()], str)
            yield view.among_transfers("TRF-011", known, lambda row: {"cause": causes[row]}, key=key)

    def _known(self, one: _Broken) -> str:
        """The mistake that was found before and explains this one too; nothing if none does."""
        start, mistake = self._starts.get(one.sender, (None, ""))
        return mistake if start is not None and _start_of(one) == start else ""

    def _explained(self, view: View, one: _Broken) -> Iterator[Occurrence]:
        if one.rule == _CHECKSUM:
            yield from self._checksum(view, one)
            return
        here = self._scenes.of(view, one.frames, one.code, fd=one.fd)
        if here is None:
            yield _occurrence(view, one, Cause(NOT_SOUGHT))
            return
        excused: Severity | None = "note" if _in_gap(view, one, here.near) else None
        around = here.around()
        proof = proven(here.parts, around, here.expected)
        strays = [part for part in around if part.transfer_id == here.parts[0].transfer_id]
        if proof is not None:
            if one.rule == _CUT and _told_by_another(proof.cause, proof.order, here.parts, around):
                return
            cause = proof.cause
        else:
            cause = missing(here.parts, here.expected) or Cause(NO_ORDER)
            if not here.expected.starts and strays:
                cause = Cause(UNPROVEN)
        evidence = [part.number for part in strays if proof is not None or one.rule == _SEQUENCE]
        yield replace(_occurrence(view, one, cause, evidence), severity=excused)

    def _checksum(self, view: View, one: _Broken) -> Iterator[Occurrence]:
        name = _undefined(view, one)
        if name:
            yield _occurrence(view, one, Cause(f"the CRC of {name}"))
            yield _occurrence(view, one._replace(rule="CAN-020"), Cause(name))
            return
        signatures, mistaken = view.types.signatures(one.code), view.types.mistaken(one.code)
        mistake = wrong_crc(one.wire, one.payload, signatures, mistaken)
        here = None
        if not mistake:
            mistake = self._known(one)
        elif mistake == NO_SIGNATURE or mistake.startswith(OF):
            self._remember(one, mistake)
        if not mistake:
            here = self._scenes.of(view, one.frames, one.code, fd=one.fd)
        if here is not None:
            around = here.around()
            proof = proven(here.parts, around, here.expected)
            if proof is not None:
                taken = {part.number for part in proof.order}
                yield _occurrence(view, one, proof.cause, [p.number for p in around if p.number in taken])
                return
            bit = _bit(one)
            mistake = "" if bit.detail else _common(view, one, here)
            if not mistake:
                other = bit if here.expected.lengths else Cause(DOUBTFUL)
                cause = bit if bit.detail else missing(here.parts, here.expected) or other
                yield replace(_occurrence(view, one, cause), drops=not bit.detail)
                return
            self._remember(one, mistake)
        yield _occurrence(view, one, Cause(mistake or NOT_SOUGHT))
        if mistake:
            yield _occurrence(view, one._replace(rule="TRF-011"), Cause(mistake))

    def _remember(self, one: _Broken, mistake: str) -> None:
        """What the CRCs of a sender start from."""
        if len(self._starts) < MOST_SENDERS:
            self._starts.setdefault(one.sender, (_start_of(one), mistake))


def _plain(view: View, bits: Words) -> Iterator[Found]:
    """What needs no search: types that a CRC names, and ends that a broken sequence takes with it."""
    t = view.transfers
    names = {row: view.type_name(int(t.code[row])) for row in np.flatnonzero(bits & _OTHER_TYPE).tolist()}
    if names:
        yield view.among_transfers("CAN-020", _array(names), lambda row: _types(view, int(t.code[row]), names[row]))
    toggled = bits & _TOGGLE != 0
    cut, late = (np.flatnonzero(toggled & (bits & bit != 0)) for bit in (_ABANDONED, _TIMEOUT))
    if len(cut):
        yield view.among_transfers(_CUT, cut, lambda row: _follows(view, row), drops=True)
    if len(late):
        yield view.among_transfers(_LATE, late, lambda _row: {"seconds": _SECONDS, "why": ""}, drops=True)


def _in_gap(view: View, one: _Broken, near: Sequence[Part]) -> bool:
    """Whether what a transfer lacks may have come in a gap of the capture (CAP-002)."""
    if one.t == NO_TIME:
        return False
    if one.rule == _LATE:
        return view.paused(one.t, one.t + round(_SECONDS * SECOND))
    if one.rule == _CUT and view.paused(one.end, one.end + _NEXT):
        behind = (view.frame(part.number) for part in near if part.number > one.frames[-1])
        return not any(kept is not None and kept.t - one.end <= _NEXT for kept in behind)
    return view.paused(one.t, one.end)


def _broken(view: View, rule: str, row: int) -> _Broken:
    t = view.transfers
    who = int(t.t[row]), int(t.bus[row]), int(t.src[row]), int(t.code[row]), bool(t.fd[row])
    crc, end = bool(t.has("crc_wire")[row]), int(t.t_end[row])
    wire, here = (int(t.crc_wire[row]), int(t.crc_here[row])) if crc and rule == _CHECKSUM else (0, 0)
    return _Broken(rule, *who, t.frames(row), wire, here, t.payload(row), int(t.length[row]) + 2 * crc, end)


def _told_by_another(cause: Cause, order: Sequence[Part], parts: Sequence[Part], around: Sequence[Part]) -> bool:
    """Whether the last frame belongs to a later attempt with the same ID, of which the same is said."""
    later = any(part.start and not part.toggle and part.number > parts[-1].number for part in around)
    return later and cause.what in {REPEATED, SWAPPED} and order[-1] not in parts


def _start_of(one: _Broken) -> int:
    return int(starts_of(np.array([one.wire]), [one.payload])[0])


def _bit(one: _Broken) -> Cause:
    """Corrupted; where, if one turned bit explains it."""
    at = one_bit(one.wire ^ one.here, len(one.payload))
    place = None if at is None else Place.of(at, 63 if one.fd else 7)
    if place is None or place.frame >= len(one.frames):
        return Cause(CORRUPTED)
    return Cause(CORRUPTED, f" (one bit turned in byte {place.byte} of frame {one.frames[place.frame] + 1})")


def corrupted(wire: int, here: int, length: int, frames: Sequence[int], *, fd: bool) -> Values:
    """What is said of a transfer whose CRC is `wire` and should be `here`, if nothing but its bytes is known."""
    one = _Broken(_CHECKSUM, 0, 0, 0, 0, fd, frames, wire, here, bytes(length), length, 0)
    cause = _bit(one)
    return {"crc_wire": wire, "crc_here": here, "cause": cause.what, "why": f": {cause.what}{cause.detail}"}


def _common(view: View, one: _Broken, here: Scene) -> str:
    """The start value that explains this and most of the other wrong CRCs nearby; nothing if none does."""
    runs = [run for run in here.whole if not here.expected.fits(run)]
    wrong = [(b"".join(part.body for part in run), run[0].transfer_id) for run in runs]
    mine = one.wire.to_bytes(2, "little") + one.payload, here.parts[0].transfer_id
    others = [joined for joined, number in wrong if (joined, number) != mine and len(joined) > 2]
    wires = np.array([int.from_bytes(joined[:2], "little") for joined in others], np.int64)
    start = _start_of(one)
    same = int((starts_of(wires, [joined[2:] for joined in others]) == start).sum()) if others else 0
    if not same or 2 * same < len(others):
        return ""
    names = view.types.starting_from(start)
    if names:
        return f"{OF}{' or '.join(names)}"
    return FROM_ZERO if not start else f"wrong signature, a CRC that starts from {start:04X}"


def _undefined(view: View, one: _Broken) -> str:
    """The name of a type without a definition whose signature gives the CRC of a transfer."""
    others = view.types.undefined(one.code)
    return next((name for sign, name in others.items() if crc_hqx(one.payload, crc_start(sign)) == one.wire), "")


def _occurrence(view: View, one: _Broken, cause: Cause, further: Iterable[int] = ()) -> Occurrence:
    frames = (*one.frames, *further)
    return Occurrence(
        rule=one.rule, t=one.t, bus=one.bus, node=one.src or None, type=view.type_name(one.code),
        frames=frames, drops=one.rule in _DROPS, lines=view.lines(frames), values=_values(view, one, cause),
    )  # fmt: skip


def _values(view: View, one: _Broken, cause: Cause) -> Values:
    why = {"cause": cause.what, "why": f": {cause.what}{cause.detail}"}
    if one.rule == _SEQUENCE:
        parts = parts_of(view, one.frames)
        at = parts[break_at(parts)].number if parts else one.frames[0]
        return {"cause": cause.what, "detail": cause.detail, "frame": at + 1}
    if one.rule == _CUT:
        return why | {"frames": len(one.frames), "bytes": one.received}
    if one.rule == _LATE:
        return why | {"seconds": _SECONDS}
    if one.rule == _CHECKSUM:
        return why | {"crc_wire": one.wire, "crc_here": one.here}
    if one.rule == "TRF-011":
        return {"cause": cause.what}
    return _types(view, one.code, cause.what)


def _types(view: View, code: int, name: str) -> Values:
    return {"type_id": code & 0xFFFF, "name": name, "expected": view.type_name(code & _PREFERRED)}


def _follows(view: View, row: int) -> Values:
    """Of a transfer without its end, of which another rule says why."""
    why = {"cause": BY_SEQUENCE, "why": f": {BY_SEQUENCE} ({_SEQUENCE})"}
    t = view.transfers
    return why | {"frames": len(t.frames(row)), "bytes": int(t.length[row]) + 2 * int(t.has("crc_wire")[row])}


def _array(rows: Iterable[int]) -> Words:
    return np.array([*rows], np.int64)
