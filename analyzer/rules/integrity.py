"""Transfers whose bytes are wrong: a broken sequence, a CRC that does not fit, padding that is none."""

from __future__ import annotations

from binascii import crc_hqx
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.definitions import crc_start
from analyzer.rules.diagnosis import Cause, Expected, Part, break_at, broken_sequence, wrong_crc
from analyzer.rules.starts import StartValues
from analyzer.tables import ERROR, EXTENDED, REMOTE, TRANSFER_ANOMALIES
from dissectors.conformance import Occurrence, Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dissectors.conformance import Found, Kept, Table, Values, View, Words

_TOGGLE, _CRC, _OTHER_TYPE, _CAN_FD = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "other type", "can fd")
)
_LOOK = 64  # frames before and behind a transfer among which its own may have strayed
_WIDEST = 8192  # frames from the first to the last of a transfer that is looked into
_SESSION = 0xFF_FFFF  # bits of an identifier: all but the priority
_PREFERRED = 0xFF_FFFF  # bits of a type's code: all but the variant
NOT_SOUGHT = "further ones, cause not sought"
MOST_SOUGHT = 1000  # transfers of one type and sender whose cause is searched
MOST_SENDERS = 4096  # of which that is counted


class Budget:
    """Counts searches, so that a sender whose every transfer is broken costs no more than a bounded time."""

    def __init__(self) -> None:
        self._spent: dict[tuple[int, int, int], int] = {}

    def take(self, view: View, row: int) -> bool:
        """Whether one more search may be made for the sender and type of a transfer."""
        t = view.transfers
        key = int(t.bus[row]), int(t.src[row]), int(t.code[row])
        spent = self._spent.get(key, MOST_SOUGHT if len(self._spent) >= MOST_SENDERS else 0)
        if spent < MOST_SOUGHT:
            self._spent[key] = spent + 1
        return spent < MOST_SOUGHT


class _Broken(NamedTuple):
    """A transfer whose sequence broke."""

    t: int
    bus: int
    src: int
    code: int
    fd: bool
    frames: Sequence[int]


class Sequences(Watcher):
    """Toggles that do not alternate; the frames that follow may be the missing ones, so the cause waits for them."""

    rules = ("TRF-003",)

    def __init__(self) -> None:
        self._budget = Budget()
        self._waiting: list[_Broken] = []

    def look(self, view: View) -> Iterator[Found | Occurrence]:
        """Those whose surroundings are known by now."""
        t = view.transfers
        bits = t.anomaly & _TOGGLE
        if bits.any():
            further = []
            for row in np.flatnonzero(bits).tolist():
                if self._budget.take(view, row):
                    who = (int(t.t[row]), int(t.bus[row]), int(t.src[row]), int(t.code[row]), bool(t.fd[row]))
                    self._waiting.append(_Broken(*who, t.frames(row)))
                else:
                    further.append(row)
            if further:
                yield view.among_transfers("TRF-003", np.array(further, np.int64), _unsought(view), drops=True)
        end = view.frames.first + len(view.frames)
        ready = [one for one in self._waiting if one.frames[-1] + _LOOK < end]
        self._waiting = [one for one in self._waiting if one.frames[-1] + _LOOK >= end]
        yield from (_explained(view, one) for one in ready)

    def settle(self, view: View) -> Iterator[Occurrence]:
        """Those at the end of the capture."""
        yield from (_explained(view, one) for one in self._waiting)


def _unsought(view: View) -> Callable[[int], Values]:
    def values(row: int) -> Values:
        frames = view.transfers.frames(row)
        parts = [part for part in (_part(number, view.frame(number)) for number in frames) if part]
        at = parts[break_at(parts)].number if parts else frames[0]
        return {"cause": NOT_SOUGHT, "detail": "", "frame": at + 1}

    return values


def _explained(view: View, one: _Broken) -> Occurrence:
    parts = [part for part in (_part(number, view.frame(number)) for number in one.frames) if part]
    first = view.frame(one.frames[0])
    at, cause = one.frames[0], Cause(NOT_SOUGHT)
    around: list[Part] = []
    if first is not None and len(parts) == len(one.frames):
        at = parts[break_at(parts)].number
        if one.frames[-1] - one.frames[0] <= _WIDEST:
            around = _around(view, parts, first)
        starts = [crc_start(signature) for signature in view.types.signatures(one.code)]
        cause = broken_sequence(parts, around, Expected(starts, view.types.fixed_bytes(one.code), one.fd))
    strays = [part.number for part in around if part.transfer_id == parts[0].transfer_id]
    return Occurrence(
        rule="TRF-003", t=one.t, bus=one.bus, node=one.src or None, type=view.type_name(one.code),
        frames=(*one.frames, *strays), drops=True, lines=view.lines(one.frames),
        values={"cause": cause.what, "detail": cause.detail, "frame": at + 1},
    )  # fmt: skip


def _part(number: int, kept: Kept | None) -> Part | None:
    return Part(number, kept.data[-1], kept.data[:-1]) if kept is not None and kept.data else None


def _around(view: View, parts: Sequence[Part], first: Kept) -> list[Part]:
    """Frames of the session near a transfer that may belong to it, though they are of no transfer."""
    low, high, own = parts[0].number, parts[-1].number, {part.number for part in parts}
    same_id = parts[0].transfer_id
    near = [part for part in _of_session(view, low - _LOOK, high + _LOOK + 1, first) if part.number not in own]
    found: list[Part] = []
    for part in reversed([part for part in near if part.number < low]):
        if part.start or part.end or part.transfer_id != same_id:
            break
        found.append(part)
    found += [part for part in near if low < part.number < high and part.transfer_id != same_id and not part.start]
    for part in near if parts[-1].end else ():
        if part.number > high and part.transfer_id == same_id:
            if part.start:
                break
            if part[1:] != parts[-1][1:]:
                found.append(part)
    return sorted(found)


def _of_session(view: View, low: int, high: int, like: Kept) -> list[Part]:
    """The frames from `low` to before `high` with the session of another frame."""
    f = view.frames
    behind = max(low, f.first) if len(f) else high
    numbers = list(range(max(low, 0), min(high, behind)))
    if behind < high:
        rows = slice(behind - f.first, high - f.first)
        same = (f.id[rows] & _SESSION == like.id & _SESSION) & (f.bus[rows] == like.bus)
        numbers += (np.flatnonzero(same) + behind).tolist()
    found = []
    for number in numbers:
        kept = view.frame(number)
        if kept is not None and _same_session(kept, like):
            part = _part(number, kept)
            found += [part] if part else []
    return found


def _same_session(kept: Kept, like: Kept) -> bool:
    plain = kept.flags & (EXTENDED | REMOTE | ERROR) == EXTENDED
    return plain and kept.bus == like.bus and kept.id & _SESSION == like.id & _SESSION


class Checksums(Watcher):
    """Transfer CRCs that are not those of the type, and why."""

    rules = ("TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        self._budget = Budget()

    def look(self, view: View) -> Iterator[Found]:
        """Asks the two bits that the CRC leaves in a transfer."""
        t = view.transfers
        odd = t.anomaly & (_CRC | _OTHER_TYPE)
        if not odd.any():
            return
        wrong, code = np.flatnonzero(odd & _CRC), t.code
        sought = [row for row in wrong.tolist() if self._budget.take(view, row)]
        names = {row: view.type_name(int(code[row])) for row in np.flatnonzero(odd & _OTHER_TYPE).tolist()}
        names |= {row: name for row in sought if (name := _undefined(view, row))}
        causes = {row: cause for row in sought if row not in names and (cause := _cause(view, row))}
        yield view.among_transfers("TRF-010", wrong, lambda row: _both_crcs(view, row))
        yield view.among_transfers("CAN-020", _array(names), lambda row: _both_types(view, row, names[row]))
        kinds = np.array([*causes.values()], str)
        yield view.among_transfers("TRF-011", _array(causes), lambda row: {"cause": causes[row]}, key=kinds)


def _array(rows: Iterable[int]) -> Words:
    return np.array([*rows], np.int64)


def _undefined(view: View, row: int) -> str:
    """The name of a type without a definition whose signature gives the CRC of a transfer."""
    t = view.transfers
    others = view.types.undefined(int(t.code[row]))
    fits = (name for code, name in others.items() if crc_hqx(t.payload(row), crc_start(code)) == t.crc_wire[row])
    return next(fits, "")


def _cause(view: View, row: int) -> str:
    t = view.transfers
    code = int(t.code[row])
    signatures, mistaken = view.types.signatures(code), view.types.mistaken(code)
    return wrong_crc(int(t.crc_wire[row]), t.payload(row), signatures, mistaken)


def _both_crcs(view: View, row: int) -> Values:
    return {"crc_wire": int(view.transfers.crc_wire[row]), "crc_here": int(view.transfers.crc_here[row])}


def _both_types(view: View, row: int, name: str) -> Values:
    expected = view.type_name(int(view.transfers.code[row]) & _PREFERRED)
    return {"type_id": int(view.transfers.type_id[row]), "name": name, "expected": expected}


# Bytes before the tail that a CAN FD frame has room for when so many are needed.
_FD_ROOM = np.array([next(n - 1 for n in (*range(1, 9), 12, 16, 20, 24, 32, 48, 64) if n > need) for need in range(64)])


@watches("TRF-030")
def padding(view: View) -> Iterable[Found]:
    """CAN FD transfers whose bytes behind the type are not zero, or more than the frame length needs."""
    fd = view.transfers.anomaly & _CAN_FD
    if fd.any():
        tables = (view.table(name) for name in view.tables())
        yield from (_padded(view, table, fd) for table in tables if table is not None and "bits_left" in table)


def _padded(view: View, table: Table, fd: Words) -> Found:
    t = view.transfers
    here = np.flatnonzero((fd[table.row] != 0) & table.trusted & ~table["bad_tag"] & (table["bits_left"] >= 0))
    rows = table.row[here]
    spare = table["bits_left"][here].astype(np.int64) // 8
    size = t.length[rows] - spare + 2 * t.has("crc_wire")[rows]
    needed = _FD_ROOM[size - np.maximum(size - 1, 0) // 63 * 63] - (size - np.maximum(size - 1, 0) // 63 * 63)
    dirty = table["pad_nonzero"][here] & (spare > 0)
    for k in np.flatnonzero(dirty).tolist():
        dirty[k] = any(t.payload(int(rows[k]))[-int(spare[k]) :])
    bad = np.flatnonzero(dirty | (spare > needed))
    about = {int(rows[k]): (int(spare[k]), int(needed[k])) for k in bad}

    def values(row: int) -> Values:
        length, due = about[row]
        filling = t.payload(row)[-length:].lstrip(b"\0")
        return {"padding": length, "needed": due, "value": filling[0] if filling else 0}

    return view.among_transfers("TRF-030", rows[bad], values)


WATCHERS: tuple[type[Watcher], ...] = (Sequences, Checksums, padding, StartValues)
