"""Cutting batches by rows, in the order of their records, and rows for frames that were lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.live import remarks
from analyzer.tables import EVENTS
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from analyzer._native import FrameBatch
    from dissectors.kit import Array


# Of a row whose time is no bus's.
NO_CLOCK = -1
CLOCKS = len(EVENTS) + 1
_ERROR, _DROP, _COMMENT = (EVENTS.index(kind) for kind in ("error frame", "drop", "comment"))


class OrderedRows:
    """The rows of a batch in the order of their records.

    `t` is the time of each (ns, i64, `NO_TIME` where there is none), `frame` whether it is a frame; `size` are the
    bytes of their data and texts.
    """

    def __init__(self, batch: FrameBatch) -> None:
        self.batch = batch
        frames, events = batch.columns()
        lines = np.concatenate([_of(frames, "line", "u4"), _of(events, "line", "u4")])
        self.size = len(frames["data"]) + len(events["data"]) + len(events["text"])
        first = len(frames["t"]) // 8
        # A record is one row; where numbers have come to their end, frames go first, as the writers have it.
        self._order = np.lexsort((np.arange(len(lines)) >= first, lines))
        self._first = first
        t = np.concatenate([_times(frames), _times(events)])
        self.t: Array = t[self._order]
        self.frame: npt.NDArray[np.bool_] = self._order < first

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._order)

    def clocks(self) -> Array:
        """Return the clock that the time of each row is of: a number for each bus and kind of row, or `NO_CLOCK`.

        Comments are of no bus. `CLOCKS` numbers belong to one bus, frames come first.
        """
        frames, events = self.batch.columns()
        kinds = _of(events, "kind", "u1").astype(np.int32)
        first, other = (_of(table, "bus", "u1").astype(np.int32) * CLOCKS for table in (frames, events))
        clocks = np.concatenate([first, np.where(kinds == _COMMENT, NO_CLOCK, other + kinds + 1)])
        return np.where(self.t == NO_TIME, NO_CLOCK, clocks[self._order])

    def take(self, rows: slice | Array) -> FrameBatch:
        """Return some of them, by their places in the order."""
        chosen = np.sort(self._order[rows])
        at = int(np.searchsorted(chosen, self._first))
        picked = chosen[:at].astype("=u4"), (chosen[at:] - self._first).astype("=u4")
        return self.batch.pick(picked[0].tobytes(), picked[1].tobytes())

    def behind_frame(self, count: int) -> int:
        """Return the place behind so many frames; behind everything if there are fewer."""
        places = np.flatnonzero(self.frame)
        return int(places[count - 1]) + 1 if 0 < count <= len(places) else len(self) if count else 0


def count_rows(batch: FrameBatch) -> int:
    """Count the rows of all kinds."""
    lines = batch.lines
    return int(sum(lines[kind] for kind in ("frames", "error_frames", "drops", "comments", "unreadable")))


def count_frames(batch: FrameBatch) -> int:
    """Count frames and error frames: what its interface received."""
    return batch.frames + batch.lines["error_frames"]


def pick_comments(batch: FrameBatch) -> FrameBatch | None:
    """Return its comments alone; None if there are none."""
    if not batch.lines["comments"]:
        return None
    kinds = _of(batch.columns()[1], "kind", "u1")
    return batch.pick(b"", np.flatnonzero(kinds == _COMMENT).astype("=u4").tobytes())


class FrameLosses:
    """Frames that nobody will see, by bus: how many, and the times of the first and the last.

    Error frames count as frames, and frames that a batch itself says were lost, as what it says will not be seen.
    """

    def __init__(self) -> None:
        self._total = 0
        self._of: dict[int, tuple[int, int, int]] = {}
        self._names: Sequence[str] = ()

    def feed(self, batch: FrameBatch) -> None:
        """Take all frames of a batch."""
        frames, events = batch.columns()
        kind, number = _of(events, "kind", "u1"), _of(events, "class", "u4")
        frame_t, event_t = _times(frames), _times(events)
        t = np.concatenate([frame_t, event_t])
        bus = np.concatenate([_of(frames, "bus", "u1"), _of(events, "bus", "u1")])
        lost = np.where(kind == _DROP, number, (kind == _ERROR).astype(np.int64))
        lost = np.concatenate([np.ones(len(frame_t), np.int64), lost])
        self._names = batch.buses
        for one in np.unique(bus[lost > 0]).tolist():
            mine = (bus == one) & (lost > 0)
            known = t[mine & (t != NO_TIME)]
            first, last = (int(known.min()), int(known.max())) if len(known) else (NO_TIME, NO_TIME)
            count, earliest, _ = self._of.get(one, (0, first, 0))
            self._of[one] = count + int(lost[mine].sum()), earliest, last

    def take(self) -> FrameBatch | None:
        """Return rows that say so, at the first loss and at the last one; None if there were none since the last."""
        found = []
        for bus, (count, first, last) in self._of.items():
            found += [(first, bus, count - 1)] if count > 1 else []
            found.append((last, bus, 1))
        self._of.clear()
        return self._drops(sorted(found)) if found else None

    def _drops(self, found: Sequence[tuple[int, int, int]]) -> FrameBatch:
        """Make drop counts: time, bus, number of each. Their text is the line of candump, whatever file it goes to."""
        texts = []
        for t, bus, count in found:
            self._total += count
            stamp = "" if t < 0 else f" ({t // SECOND:010}.{t % SECOND:09})"
            texts.append(
                f"DROPCOUNT: dropped {count} CAN frame{'s' * (count != 1)} on '{self._names[bus]}' socket"
                f" (total drops {self._total}){stamp}".encode()
            )
        return remarks.make_events(_DROP, found, self._names, texts)


def _of(table: dict[str, Any], name: str, kind: str) -> Array:
    return np.frombuffer(table[name], "=" + kind)


def _times(table: dict[str, Any]) -> Array:
    t = _of(table, "t", "i8")
    valid = table["t_valid"]
    if valid is None:
        return t
    known = np.unpackbits(np.frombuffer(valid, np.uint8), count=len(t), bitorder="little").view(bool)
    return np.where(known, t, NO_TIME)
