"""Rows of a capture as plain values: drawn, made into pieces, and taken out of pieces again."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import pyarrow as pa
from hypothesis import strategies as st

from analyzer._native import FrameBatch, Reader, Rows
from analyzer.sinks import Sink, open_sink
from analyzer.sources import Source
from analyzer.sources.native import rows
from analyzer.tables import EVENT_ROWS, EVENTS, wrap
from analyzer.window.cut import RECORDED

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

EXTENDED, REMOTE, FD, BRS, ESI, TX, RX = 1, 2, 8, 16, 32, 64, 128
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


@dataclass(frozen=True)
class Frame:
    """A CAN frame; `code` is the length of a remote frame, or a raw length code above 8."""

    t: int | None = 1_700_000_000_000_180_000
    bus: str = "can0"
    id: int = 0x123
    flags: int = 0
    data: bytes = b""
    code: int = 0


@dataclass(frozen=True)
class Fault:
    """An error frame; `flags` is TX, RX, or 0 where its direction is not known."""

    t: int | None = 1_700_000_000_000_190_000
    bus: str = "can0"
    error: int = 4
    data: bytes = bytes(8)
    flags: int = 0


Record = Frame | Fault


def piece(records: Iterable[Record], made: Rows | None = None) -> FrameBatch:
    """The next piece of `made`: the names of interfaces go on."""
    made = Rows() if made is None else made
    for record in records:
        if isinstance(record, Fault):
            made.error_frame(record.t, record.bus, record.error, record.data, record.flags)
        else:
            made.frame(record.t, record.bus, record.id, record.flags | record.code << 8, record.data)
    return made.take()


def text(log: str | bytes) -> list[FrameBatch]:
    """What candump text says, which may be more than `Record`s can."""
    return [
        part for part in rows(iter([log if isinstance(log, bytes) else log.encode()])) if isinstance(part, FrameBatch)
    ]


def records(pieces: Iterable[FrameBatch]) -> list[Record]:
    """Frames and error frames in the order of their records."""
    found: list[tuple[int, Record]] = []
    for part in pieces:
        frames, events = (wrap(form, cells) for form, cells in zip((RECORDED, EVENT_ROWS), part.columns(), strict=True))
        for row in plain(frames):
            frame = Frame(row["t"], part.buses[row["bus"]], row["id"], row["flags"] & 0xFF, row["data"])
            found.append((row["line"], replace(frame, code=row["flags"] >> 8)))
        found += [
            (row["line"], Fault(row["t"], part.buses[row["bus"]], row["class"], row["data"], row["flags"]))
            for row in plain(events)
            if EVENTS[row["kind"]] == "error frame"
        ]
    return [record for _, record in sorted(found, key=lambda pair: pair[0])]


def events(pieces: Iterable[FrameBatch], kind: str) -> list[tuple[str | None, int, str]]:
    """Bus, number and text of the events of one kind."""
    return [
        (None if row["bus"] is None else part.buses[row["bus"]], row["class"], row["text"])
        for part in pieces
        for row in plain(wrap(EVENT_ROWS, part.columns()[1]))
        if EVENTS[row["kind"]] == kind
    ]


def plain(batch: pa.RecordBatch) -> list[dict]:
    """Rows with times as integers."""
    at = batch.schema.get_field_index("t")
    return batch.set_column(at, "t", batch.column(at).cast(pa.int64())).to_pylist()


def written(form: str, pieces: Iterable[FrameBatch], compression: str = "zstd") -> tuple[bytes, Sink]:
    """The whole file, and the sink with its account."""
    file = io.BytesIO()
    sink = open_sink(form, file, compression=compression)
    for part in pieces:
        sink.write(part)
    sink.close()
    return file.getvalue(), sink


def read(form: str, data: bytes, folder: Path) -> list[FrameBatch]:
    """The pieces of a file, which must be sound."""
    if form != "mcap":
        reader = Reader(form)
        reader.feed(data)
        reader.finish()
        assert reader.damage is None
        return [reader.take()]
    path = folder / "read.mcap"
    path.write_bytes(data)
    source = Source(str(path))
    pieces = [part for part in rows(source.chunks()) if isinstance(part, FrameBatch)]
    assert source.damage is None
    return pieces


TIMES = st.one_of(st.integers(0, 2**63 - 1), st.integers(0, 2**41).map(lambda us: us * 1000))
BUSES = st.sampled_from(["can0", "can1", "can", "vcan-1", "slcan_long_name", "0", "a.b/c", "PCAN:USB'1,x", "any"])
IDS = st.one_of(st.tuples(st.integers(0, 0x7FF), st.just(0)), st.tuples(st.integers(0, 0x1FFF_FFFF), st.just(EXTENDED)))
DIRECTIONS = st.sampled_from([0, TX, RX])
BODIES = st.one_of(
    st.tuples(st.just(0), st.binary(max_size=8), st.just(0)),
    st.tuples(st.just(0), st.binary(min_size=8, max_size=8), st.integers(9, 15)),
    st.tuples(st.just(REMOTE), st.just(b""), st.integers(0, 15)),
    st.tuples(
        st.sampled_from([FD, FD | BRS, FD | ESI, FD | BRS | ESI]),
        st.sampled_from(FD_LENGTHS).flatmap(lambda size: st.binary(min_size=size, max_size=size)),
        st.just(0),
    ),
)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    id_, extended = draw(IDS)
    kind, data, code = draw(BODIES)
    flags = extended | kind | draw(DIRECTIONS)
    return Frame(draw(st.one_of(TIMES, st.none())), draw(BUSES), id_, flags, data, code)


FAULTS = st.builds(
    Fault, st.one_of(TIMES, st.none()), BUSES, st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), DIRECTIONS
)
CAPTURES = st.lists(st.one_of(frames(), FAULTS), max_size=30)
