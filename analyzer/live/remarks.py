"""Rows that no frame of the bus stands behind: comments of the session, and frames that were lost on the way."""

from __future__ import annotations

import struct

from analyzer._native import Piece
from analyzer.tables import EVENTS

_DROP, _COMMENT = EVENTS.index("drop"), EVENTS.index("comment")
_NO_FRAMES = {**dict.fromkeys(("t", "bus", "id", "flags", "line", "data"), b""), "data_offset": bytes(4)}
_NO_DATA = {name: bytes(1) for name in ("tx_errors", "rx_errors", "tx_errors_valid")} | {
    "flags": bytes(2), "data_offset": bytes(8), "data": b""
}  # fmt: skip
_NO_EVENTS = {
    **dict.fromkeys(("t", "bus", "bus_valid", "line", "kind", "class", *_NO_DATA, "text"), b""),
    "data_offset": bytes(4), "text_offset": bytes(4),
}  # fmt: skip
# A row holds no larger number.
_MOST = (1 << 32) - 1


def nothing(name: str) -> Piece:
    """No rows, but the name of a bus."""
    return Piece.of(_NO_FRAMES, _NO_EVENTS, [name])


def comment(t: int, text: str, name: str | None = None) -> Piece:
    """What a person or this program has to say, at a time (ns since 1970), of the bus `name` if it is about one."""
    return _event(_COMMENT, t, 0, text, name)


def drop(t: int, frames: int, name: str) -> Piece:
    """So many frames of the bus `name` were lost before the time `t` (ns since 1970)."""
    text = f"{frames} frame{'s' * (frames != 1)} lost: they came faster than they were taken"
    return _event(_DROP, t, min(frames, _MOST), text, name)


def first_time(piece: Piece) -> int | None:
    """The time of the first frame, or of the first event if there is none; None if it has no time."""
    frames, events = piece.columns()
    table = frames if frames["t"] else events
    if not table["t"] or (table["t_valid"] is not None and not table["t_valid"][0] & 1):
        return None
    return int(struct.unpack_from("=q", table["t"])[0])


def _event(kind: int, t: int, number: int, text: str, name: str | None) -> Piece:
    encoded = text.encode(errors="replace")
    columns = {
        "t": struct.pack("=q", t), "bus": bytes(1), "bus_valid": bytes([name is not None]),
        "line": struct.pack("=I", 1), "kind": bytes([kind]), "class": struct.pack("=I", number),
        "text": encoded, "text_offset": struct.pack("=ii", 0, len(encoded)), **_NO_DATA,
    }  # fmt: skip
    return Piece.of(_NO_FRAMES, columns, [] if name is None else [name])
