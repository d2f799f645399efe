"""How the frames of one transfer follow each other: toggles, lengths, pauses, ends that never came."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.foreign import session_bits
from analyzer.rules.frames import GONE, flagged
from analyzer.tables import STATUSES, TRANSFER_ANOMALIES, VERDICTS
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Occurrence, Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from dissectors.conformance import Found, Kept, Severity, Values, View, Words

_STRAY = tuple(VERDICTS.index(name) for name in ("wrong transfer id", "orphan"))
_OK = STATUSES.index("ok")
_COMPLETE = tuple(STATUSES.index(name) for name in ("ok", "unchecked", "bad crc"))
_SINGLE_WITH_TOGGLE = 0xE0  # start, end and toggle of a tail byte
_START, _BEGINS, _TRANSFER_ID = 0x80, 0xC0, 31
_MARKED = 100.0  # ms; the core marks longer pauses
_MOST = 4  # frames that are named in a line
NEAR = 4096  # frames that are looked through for the other one of two transfers


class _Bit(NamedTuple):
    """A rule, the bit of the core that shows its breaches, and what is said of one."""

    rule: str
    bit: str
    values: Callable[[View, int], Values]
    severity: Severity | None = None
    drops: bool = False
    complete: bool = False


@watches("TRF-001", "TRF-007", "TRF-008", "TRF-012", "TRF-013", "TRF-014", "TRF-015", "TRF-026", "TRF-029")
def measured(view: View) -> Iterator[Found]:
    """What the core found as it put transfers together."""
    t = view.transfers
    every = int(np.bitwise_or.reduce(t.anomaly))
    for one in _BITS:
        bit = 1 << TRANSFER_ANOMALIES.index(one.bit)
        if not every & bit:
            continue
        rows = flagged(t.anomaly, bit)
        if one.rule == "TRF-012":
            rows = _followed(view, rows)
        if one.complete:
            rows = rows[np.isin(t.status[rows], _COMPLETE)]
        about = partial(one.values, view)
        if one.rule == "TRF-026":
            strays = np.array([_only_strays(view, row) for row in rows.tolist()], bool)
            yield view.among_transfers(one.rule, rows[strays], about, severity="note")
            rows = rows[~strays]
        yield view.among_transfers(one.rule, rows, about, severity=one.severity, drops=one.drops)


@watches("TRF-027")
def paused(view: View) -> Iterator[Occurrence]:
    """Every pause inside a transfer, at the frame before it."""
    t = view.transfers
    longest = view.number("TRF-027", "pause_ms")
    if longest >= _MARKED:
        rows = flagged(t.anomaly, 1 << TRANSFER_ANOMALIES.index("pause"))
    else:
        rows = np.flatnonzero((t.t != NO_TIME) & (t.t_end - t.t > longest * MILLISECOND))
    for row in rows.tolist():
        node, type_ = int(t.src[row]), view.type_name(int(t.code[row]))
        for (number, before), (after, frame) in pairwise(_known(view, t.frames(row))):
            pause = (frame.t - before.t) / MILLISECOND
            if pause > longest and NO_TIME not in (before.t, frame.t):
                values = {"milliseconds": pause, "previous_frame": number + 1, "frame": after + 1}
                yield Occurrence("TRF-027", before.t, before.bus, node or None, type_, (number, after), values)


def _known(view: View, numbers: Iterable[int]) -> list[tuple[int, Kept]]:
    """Frames of the recent past."""
    kept = ((number, view.frame(number)) for number in numbers)
    return [(number, frame) for number, frame in kept if frame is not None]


def _tail(view: View, row: int) -> Values:
    return {"tail": _SINGLE_WITH_TOGGLE | int(view.transfers.transfer_id[row])}


def _received(view: View, row: int) -> Values:
    """What came; two more bytes than payload once there is a CRC."""
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
        if len(kept.data) < (64 if view.transfers.fd[row] else 8):
            return {"length": len(kept.data), "frame": number + 1}
    return {"length": GONE, "frame": GONE}


def _followed(view: View, rows: Words) -> Words:
    """Transfers with such a frame before their last one; if it is the last, the end is missing and not a byte."""
    status = view.transfers.status
    open_ends = {row for row in rows.tolist() if status[row] not in _COMPLETE}
    spared = {row for row in open_ends if _part_full(view, row)["frame"] == GONE}
    return np.array([row for row in rows.tolist() if row not in spared], np.int64)


def _last(view: View, row: int) -> Values:
    return {"frame": view.transfers.frames(row)[-1] + 1}


def _first(view: View, row: int) -> Values:
    kept = view.frame(int(view.transfers.lead[row]))
    return {"length": GONE if kept is None else len(kept.data)}


def _others(view: View, row: int) -> list[tuple[int, Kept]]:
    """Frames of the session with another transfer ID, between the first and the last of a transfer."""
    numbers = view.transfers.frames(row)
    mine, first = int(view.transfers.transfer_id[row]), view.frame(numbers[0])
    between = range(numbers[0] + 1, min(numbers[-1], numbers[0] + NEAR))
    if first is None:
        return []
    wanted = session_bits(np.array([first.id]))[0]
    same = ((n, kept) for n, kept in _known(view, between) if kept.bus == first.bus and kept.id & 0xFF_FFFF == wanted)
    return [(number, kept) for number, kept in same if kept.data and kept.data[-1] & _TRANSFER_ID != mine]


def _only_strays(view: View, row: int) -> bool:
    """Whether nothing but frames without a transfer stand inside, which have a rule of their own (TRF-009)."""
    others = _others(view, row)
    return bool(others) and all(kept.verdict in _STRAY for _, kept in others)


def _in_turn(view: View, row: int) -> Values:
    """The other transfer ID stands in a frame of the session between the first and the last one."""
    mine = int(view.transfers.transfer_id[row])
    others = [(number, kept.data[-1]) for number, kept in _others(view, row)]
    values: Values = {"first_id": mine, "transfer_id": others[0][1] & _TRANSFER_ID if others else GONE, "why": ""}
    # No other transfer of several frames begins in between, and without these frames the CRC is right.
    if others and view.transfers.status[row] == _OK and all(tail & _BEGINS != _START for _, tail in others):
        what = "frame" if len(others) == 1 else "frames"
        shown = " ".join(str(number + 1) for number, _ in others[:_MOST])
        values = {**values, "why": f": foreign {what} {shown} inside, the CRC is right without"}
    return values


_BITS = (
    _Bit("TRF-001", "single toggle", _tail),
    _Bit("TRF-007", "slow", _took, severity="note", complete=True),
    _Bit("TRF-008", "cut by end", _received),
    _Bit("TRF-012", "frame not full", _part_full),
    _Bit("TRF-013", "last frame empty", _last),
    _Bit("TRF-014", "first frame too short", _first),
    _Bit("TRF-015", "needless multi", _length),
    _Bit("TRF-026", "interleaved", _in_turn),
    _Bit("TRF-029", "long", _length),
)

WATCHERS: tuple[type[Watcher], ...] = (measured, paused)
