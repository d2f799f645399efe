"""Rows that no frame of the bus stands behind: comments of the session, and frames that were lost on the way."""

from __future__ import annotations

import struct
from itertools import accumulate
from typing import TYPE_CHECKING

from analyzer._native import FrameBatch
from analyzer.tables import EVENTS

if TYPE_CHECKING:
    from collections.abc import Sequence

_DROP, _COMMENT = EVENTS.index("drop"), EVENTS.index("comment")
_NO_FRAMES = {**dict.fromkeys(("t", "bus", "id", "flags", "line", "data"), b""), "data_offset": bytes(4)}
# A row holds no larger number.
_MOST = (1 << 32) - 1


def make_empty(name: str) -> FrameBatch:
    """Make a batch without rows, but with the name of a bus."""
    return make_events(_COMMENT, [], [name], [])


def make_comment(t: int, text: str, name: str | None = None) -> FrameBatch:
    """Make a comment of a person or this program, at a time (ns since 1970), of the bus `name` if it is about one."""
    return _event(_COMMENT, t, 0, text, name)


def make_drop(t: int, frames: int, name: str) -> FrameBatch:
    """Make a row that says: so many frames of the bus `name` were lost before the time `t` (ns since 1970)."""
    text = f"{frames} frame{'s' * (frames != 1)} lost: they came faster than they were taken"
    return _event(_DROP, t, frames, text, name)


def first_time(batch: FrameBatch) -> int | None:
    """Return the time (ns) of the first frame, or of the first event if there is none; None if it has no time."""
    frames, events = batch.columns()
    table = frames if frames["t"] else events
    if not table["t"] or (table["t_valid"] is not None and not table["t_valid"][0] & 1):
        return None
    return int(struct.unpack_from("=q", table["t"])[0])


def make_events(
    kind: int, found: Sequence[tuple[int, int | None, int]], names: Sequence[str], texts: Sequence[bytes]
) -> FrameBatch:
    """Make rows of one of `EVENTS`: time, place of the bus in `names` (None if it is of none), number of each."""
    size = len(found)
    columns = {
        "t": struct.pack(f"={size}q", *(t for t, _, _ in found)),
        "bus": bytes(bus or 0 for _, bus, _ in found),
        "bus_valid": bytes(bus is not None for _, bus, _ in found),
        "line": struct.pack(f"={size}I", *range(1, size + 1)),
        "kind": bytes([kind]) * size,
        "class": struct.pack(f"={size}I", *(min(number, _MOST) for _, _, number in found)),
        "flags": bytes(2 * size),
        **dict.fromkeys(("tx_errors", "rx_errors", "tx_errors_valid"), bytes(size)),
        "data": b"",
        "data_offset": bytes(4 * size + 4),
        "text": b"".join(texts),
        "text_offset": struct.pack(f"={size + 1}i", *accumulate(map(len, texts), initial=0)),
    }
    return FrameBatch.of(_NO_FRAMES, columns, list(names))


def _event(kind: int, t: int, number: int, text: str, name: str | None) -> FrameBatch:
    bus, names = (None, []) if name is None else (0, [name])
    return make_events(kind, [(t, bus, number)], names, [text.encode(errors="replace")])
