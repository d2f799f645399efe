"""Frames as python-can's messages, captures as its writers write them, and what this project reads of them."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import can
from can.util import dlc2len

from analyzer._native import FrameBatch
from analyzer.decode.engine import Totals
from analyzer.sources import Source
from analyzer.sources.formats import FORMATS
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, TX, Fault, Record, records

if TYPE_CHECKING:
    from collections.abc import Iterable

WRITERS: dict[str, Any] = {
    ".asc": can.ASCWriter,
    ".trc": can.TRCWriter,
    ".csv": can.CSVWriter,
    ".blf": can.BLFWriter,
    ".mf4": can.MF4Writer,
}
NAMES = {
    ".asc": "Vector ASC",
    ".trc": "PEAK TRC",
    ".csv": "python-can CSV",
    ".blf": "Vector BLF",
    ".mf4": "MDF 4",
}
TEXT = (".asc", ".trc", ".csv")


def message(record: Record) -> can.Message:
    """As a python-can bus delivers it; bus can0 is channel 0."""
    common = {"timestamp": (record.t or 0) / 10**9, "channel": int(record.bus.removeprefix("can"))}
    if isinstance(record, Fault):
        return can.Message(
            arbitration_id=record.error,
            is_extended_id=False,
            is_error_frame=True,
            is_rx=not record.flags & TX,
            data=record.data,
            **common,
        )
    fd = bool(record.flags & FD)
    return can.Message(
        arbitration_id=record.id,
        is_extended_id=bool(record.flags & EXTENDED),
        is_remote_frame=bool(record.flags & REMOTE),
        is_fd=fd,
        bitrate_switch=bool(record.flags & BRS),
        error_state_indicator=bool(record.flags & ESI),
        is_rx=not record.flags & TX,
        dlc=record.code if record.flags & REMOTE else len(record.data),
        data=record.data,
        **common,
    )


class _Kept(io.BytesIO):
    """Keeps its bytes when a writer closes it."""

    name = "capture"
    kept = b""

    def close(self) -> None:
        self.kept = self.getvalue()
        super().close()


def written(suffix: str, found: Iterable[Record], **how: Any) -> bytes:
    """The bytes that python-can's writer makes of the frames."""
    file = _Kept()
    stream = io.TextIOWrapper(file, write_through=True) if suffix in TEXT else file
    with WRITERS[suffix](stream, **how) as writer:
        for record in found:
            writer(message(record))
    return file.kept


def read(suffix: str, data: bytes, size: int = 1 << 20) -> tuple[list[FrameBatch], Source]:
    """The pieces of a capture that comes in chunks of this size; each record is accounted for."""
    source = Source(f"capture{suffix}")
    source.format = next(form for form in FORMATS if form.name == NAMES[suffix])
    chunks = (data[at : at + size] for at in range(0, len(data), size))
    pieces = [piece for piece in source.reader()(source, chunks) if isinstance(piece, FrameBatch)]
    for piece in pieces:
        assert Totals(piece.lines).balanced
    return pieces, source


def frames(suffix: str, data: bytes, size: int = 1 << 20) -> list[Record]:
    return records(read(suffix, data, size)[0])


def total(pieces: Iterable[FrameBatch], name: str) -> int:
    return sum(piece.lines[name] for piece in pieces)


FD_LENGTHS = sorted({dlc2len(code) for code in range(16)})
