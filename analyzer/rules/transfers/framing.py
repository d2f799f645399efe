"""The sequence of the frames of one transfer: toggles, lengths, pauses, ends that never came."""

from __future__ import annotations

from functools import partial
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.sent import cells
from analyzer.facts.identifiers import NOBODY
from analyzer.rules.anomalies import GONE, flagged
from analyzer.rules.diagnosis.causes import late_copy
from analyzer.rules.frames.foreign import session_bits, session_of
from analyzer.rules.joint.gathered import Gathered, Sent
from analyzer.rules.transfers.incomplete import ROOM
from analyzer.rules.transfers.lists import picked, placed
from analyzer.rules.view import MESSAGE, node_of
from analyzer.tables import STATUSES, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE, TRANSFER_ANOMALIES, VERDICTS
from dissectors.frame_text import FrameNumber, FrameText
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrences, rule

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from dissectors.kit import Array, Kept, Severity, Values, View

_ORPHAN = tuple(VERDICTS.index(name) for name in ("wrong transfer id", "orphan"))
_OK = STATUSES.index("ok")
_USED = VERDICTS.index("used")
_BEFORE = 48  # frames of a session among which a copy finds the one that it is of
_SOUND = np.array([name in {"ok", "unchecked"} for name in STATUSES])
_COMPLETE = _SOUND | np.array([name == "bad crc" for name in STATUSES])
_SINGLE_WITH_TOGGLE = TAIL_START | TAIL_END | TAIL_TOGGLE
_MARKED = 100.0  # ms; the core marks longer pauses
_MOST = 4  # frames that are named in a line
NEAR = 4096  # frames that are looked through for the other one of two transfers


class _Bit(NamedTuple):
    """A rule, the bit of the core that shows its breaches, and what is said of one. `only`: a mask of statuses."""

    rule: str
    bit: str
    values: Callable[[View, int], Values]
    severity: Severity | None = None
    drops: bool = False
    only: Array | None = None


@rule("TRF-001", "TRF-007", "TRF-008", "TRF-012", "TRF-013", "TRF-014", "TRF-015", "TRF-026", "TRF-029")
def measured(view: View) -> Iterator[Occurrences]:
    """Find what the core marked as it put transfers together."""
    t = view.transfers
    every = int(np.bitwise_or.reduce(t.anomaly))
    for bit, one in _BITS:
        if not every & bit:
            continue
        rows = flagged(t.anomaly, bit)
        if one.rule == "TRF-012":
            rows = _followed(view, rows)
        if one.only is not None:
            rows = rows[one.only[t.status[rows]]]
        about = partial(one.values, view)
        if one.rule == "TRF-026":
            orphans = _only_orphans(view, rows)
            yield view.among_transfers(one.rule, rows[orphans], about, severity="note")
            rows = rows[~orphans]
        if len(rows):
            yield view.among_transfers(one.rule, rows, about, severity=one.severity, drops=one.drops)


@rule("TRF-027")
def paused(view: View) -> Iterator[Occurrences]:
    """Yield every pause inside a transfer, at the frame before it."""
    t = view.transfers
    longest = view.number("TRF-027", "pause_ms")
    if longest >= _MARKED:
        rows = flagged(t.anomaly, 1 << TRANSFER_ANOMALIES.index("pause"))
    else:
        rows = ((t.t != NO_TIME) & (t.t_end - t.t > longest * MILLISECOND)).nonzero()[0]
    if not len(rows):
        return
    begins, numbers = t.frame_lists
    here = numbers[begins[rows]] >= view.frames.first
    yield _pauses(view, rows[here], longest)
    found = Gathered()
    for row in rows[~here].tolist():
        code = int(t.code[row])
        node = node_of(int(t.src[row]), code)
        for (number, before), (after, frame) in pairwise(_known(view, t.frames(row))):
            pause = (frame.t - before.t) / MILLISECOND
            if pause > longest and NO_TIME not in (before.t, frame.t):
                values = {
                    "milliseconds": pause,
                    "previous_frame": FrameNumber.at(number),
                    "frame": FrameNumber.at(after),
                }
                found.add("TRF-027", Sent(before.t, before.bus, node, code), (number, after), values, drops=False)
    yield from found.occurrences()


def _pauses(view: View, rows: Array, longest: float) -> Occurrences:
    """Return the pauses inside transfers of which all frames are of this batch."""
    t, f = view.transfers, view.frames
    begins, numbers = t.frame_lists
    ends, places = picked(begins, rows)
    of, number = np.repeat(rows, np.diff(ends)), numbers[places].astype(np.int64)
    at = f.t[number - f.first]
    pause = np.diff(at) / MILLISECOND
    timed = (at[:-1] != NO_TIME) & (at[1:] != NO_TIME)
    before = ((of[1:] == of[:-1]) & timed & (pause > longest)).nonzero()[0]
    row = of[before]
    src, code = t.src[row].astype(np.int64), t.code[row]

    def values(k: int) -> Values:
        place = before.item(k)
        frames = {"previous_frame": FrameNumber.at(number.item(place)), "frame": FrameNumber.at(number.item(place + 1))}
        return {"milliseconds": pause.item(place), **frames}

    return Occurrences(
        rule="TRF-027", t=at[before], bus=f.bus[number[before] - f.first],
        node=np.where((src == 0) & (code >> 16 != MESSAGE), NOBODY, src), type=code, frame=number[before],
        values=values, frames=lambda k: tuple(number[before.item(k) : before.item(k) + 2].tolist()), each_named=True,
    )  # fmt: skip


def _known(view: View, numbers: Iterable[int]) -> Iterator[tuple[int, Kept]]:
    """Yield frames of the recent past."""
    kept = ((number, view.frame(number)) for number in numbers)
    return ((number, frame) for number, frame in kept if frame is not None)


def _tail(view: View, row: int) -> Values:
    return {"tail": _SINGLE_WITH_TOGGLE | int(view.transfers.transfer_id[row])}


def _received(view: View, row: int) -> Values:
    """Return what came; two more bytes than payload once there is a CRC."""
    t = view.transfers
    crc = 2 if t.has("crc_wire")[row] else 0
    return {"frames": len(t.frames(row)), "bytes": int(t.length[row]) + crc}


def _length(view: View, row: int) -> Values:
    return {"length": int(view.transfers.length[row]), "frames": len(view.transfers.frames(row))}


def _took(view: View, row: int) -> Values:
    return {"seconds": int(view.transfers.t_end[row] - view.transfers.t[row]) / SECOND, "why": ""}


def _part_full(view: View, row: int) -> Values:
    frames = _known(view, view.transfers.frames(row)[:-1])
    for number, kept in frames:
        if len(kept.data) <= ROOM[0 if view.transfers.fd[row] else 1]:
            return {"length": len(kept.data), "frame": FrameNumber.at(number)}
    return {"length": GONE, "frame": GONE}


def _followed(view: View, rows: Array) -> Array:
    """Return transfers with such a frame before their last one.

    If it is the last, the end is missing and not a byte.
    """
    t, f = view.transfers, view.frames
    offsets, numbers = t.frame_lists
    found = _COMPLETE[t.status[rows]]
    left = (~found & (offsets[rows + 1] - offsets[rows] > 1)).nonzero()[0]
    here = t.lead[rows[left]] >= f.first
    for k in left[~here].tolist():
        found[k] = _part_full(view, rows.item(k))["frame"] != GONE
    left = left[here]
    begin, end = offsets[rows[left]], offsets[rows[left] + 1] - 1
    ends, places = placed(begin, end - begin)
    room = np.where(t.fd[rows[left]], *ROOM).repeat(end - begin)
    short = np.zeros(len(places) + 1, np.int64)
    (f.length[numbers[places].astype(np.int64) - f.first] <= room).cumsum(out=short[1:])
    found[left] = short[ends[1:]] > short[ends[:-1]]
    followed: Array = rows[found]
    return followed


def _last(view: View, row: int) -> Values:
    return {"frame": FrameNumber.at(view.transfers.frames(row)[-1])}


def _first(view: View, row: int) -> Values:
    kept = view.frame(int(view.transfers.lead[row]))
    return {"length": GONE if kept is None else len(kept.data)}


def _others(view: View, row: int) -> list[tuple[int, int]]:
    """Return frames of the session with another transfer ID, between the first and the last of a transfer: their tails.

    Each comes behind its number.
    """
    numbers = view.transfers.frames(row)
    mine, first = view.transfers.transfer_id.item(row), view.frame(numbers[0])
    if first is None:
        return []
    low, high, session = numbers[0] + 1, min(numbers[-1], numbers[0] + NEAR), session_of(first.id, first.verdict)
    whose = first.bus, session, mine, NEAR
    return [one for index in view.indexes(low, high) for one in index.others(low, high, *whose)]


def _only_orphans(view: View, rows: Array) -> Array:
    """Return a mask of transfers with nothing inside but frames without a transfer: these have a rule (TRF-009)."""
    t, f = view.transfers, view.frames
    ends, numbers = t.frame_lists
    first = t.lead[rows]
    here = first >= f.first
    found = here.copy()
    found[~here] = [_has_only_orphans(view, row) for row in rows[~here].tolist()]
    for most in (1, NEAR):  # mostly the first one says it
        left = (here & found).nonzero()[0]
        row, at = rows[left], first[left] - f.first
        high = np.minimum(numbers[ends[row + 1] - 1].astype(np.int64), first[left] + NEAR)
        columns = first[left] + 1, high, f.bus[at], session_bits(f.id[at], f.verdict[at]), t.transfer_id[row]
        if not len(left):
            break
        wanted = tuple(column.astype(np.int64) for column in columns)
        (index,) = view.indexes(f.first, f.first + len(f))
        begins, inside = (cells(column, np.int64) for column in index.all_others(wanted, most))
        verdict = f.verdict[inside - f.first]
        used = np.concatenate(((0,), np.cumsum((verdict != _ORPHAN[0]) & (verdict != _ORPHAN[1]))))
        found[left] = (begins[1:] > begins[:-1]) & (used[begins[1:]] == used[begins[:-1]])
    return found


def _has_only_orphans(view: View, row: int) -> bool:
    """Return the same of a transfer that began before this batch."""
    others = _others(view, row)
    return bool(others) and all(kept.verdict in _ORPHAN for _, kept in _known(view, (number for number, _ in others)))


def _original(view: View, number: int) -> int | None:
    """Return the number of an earlier frame of the session with the same bytes, of a transfer."""
    kept, low, left = view.frame(number), max(number - NEAR, 0), _BEFORE
    if kept is None:
        return None
    session = session_of(kept.id, kept.verdict)
    for index in reversed(view.indexes(low, number)):
        count, alike = index.alike(low, number, kept.bus, session, kept.data, left)
        left -= count
        for earlier, one in _known(view, alike):
            if one.verdict == _USED:
                return earlier
    return None


def _in_turn(view: View, row: int) -> Values:
    """Name the other transfer ID, which stands in a frame of the session between the first and the last one."""
    mine, others = view.transfers.transfer_id.item(row), _others(view, row)
    values: Values = {"first_id": mine, "transfer_id": others[0][1] & TAIL_ID if others else GONE, "why": ""}
    originals = (_original(view, number) for number, _ in others[:_MOST])
    known = [*takewhile(lambda number: number is not None, originals)]
    if known and len(known) == len(others[:_MOST]):
        copy = late_copy([number for number in known if number is not None])
        right = ", the CRC is right without" if view.transfers.status[row] == _OK else ""
        return {**values, "why": FrameText(f": {copy.what}", copy.detail, f" inside{right}")}
    # No other transfer of several frames begins in between, and without these frames the CRC is right.
    if (
        others
        and view.transfers.status[row] == _OK
        and all(tail & (TAIL_START | TAIL_END) != TAIL_START for _, tail in others)
    ):
        what = "frame" if len(others) == 1 else "frames"
        shown = " ".join(str(number + 1) for number, _ in others[:_MOST])
        values = {**values, "why": f": foreign {what} {shown} inside, the CRC is right without"}
    return values


_BITS = tuple(
    (1 << TRANSFER_ANOMALIES.index(one.bit), one)
    for one in (
        _Bit("TRF-001", "single toggle", _tail),
        _Bit("TRF-007", "slow", _took, severity="note", only=_COMPLETE),
        _Bit("TRF-008", "cut by end", _received),
        _Bit("TRF-012", "frame not full", _part_full),
        _Bit("TRF-013", "last frame empty", _last),
        _Bit("TRF-014", "first frame too short", _first),
        _Bit("TRF-015", "needless multi", _length, only=_SOUND),
        _Bit("TRF-026", "interleaved", _in_turn, drops=True),
        _Bit("TRF-029", "long", _length),
    )
)
