"""Rows of a capture as plain values: drawn, made into pieces, and taken out of pieces or files again."""

from __future__ import annotations

import io
import random
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import pyarrow as pa
from hypothesis import strategies as st

from analyzer._native import FrameBatch, Reader, Rows
from analyzer.decode.core import LINES, Totals
from analyzer.sinks import Sink, open_sink
from analyzer.sources import Source
from analyzer.sources.formats import detect
from analyzer.sources.native import rows
from analyzer.tables import EVENT_ROWS, EVENTS, wrap
from analyzer.window.cut import RECORDED
from kit.encode import DLC_LENGTHS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.sources.errors import CaptureError

EXTENDED, REMOTE, FD, BRS, ESI, TX, RX = 1, 2, 8, 16, 32, 64, 128
NO_TIME = -(1 << 63)


@dataclass(frozen=True)
class Frame:
    """A CAN frame; `code` is the length of a remote frame, or a raw length code above 8."""

    t: int | None = 1_700_000_000_000_180_000
    bus: str = "can0"
    id: int = 0x123
    flags: int = 0
    data: bytes = b""
    code: int = 0

    @property
    def word(self) -> int:
        """The identifier as the kernel has it."""
        return self.id | (self.flags & EXTENDED) << 31 | (self.flags & REMOTE) << 29

    @property
    def line(self) -> str:
        """The frame, which has a time, as candump logs it."""
        assert self.t is not None
        digits = f"{self.id:08X}" if self.flags & EXTENDED else f"{self.id:03X}"
        body = self.data.hex().upper()
        if self.flags & FD:
            body = f"#{self.flags >> 4 & 3:X}{body}"
        if self.flags & REMOTE:
            body = f"R{self.code}"
        direction = " T" if self.flags & TX else " R" if self.flags & RX else ""
        return f"({self.t // 10**9}.{self.t % 10**9:09d}) {self.bus} {digits}#{body}{direction}\n"


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


def batch(log: str | bytes) -> FrameBatch:
    """The one piece that a short candump text is."""
    (only,) = text(log)
    return only


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


@dataclass
class Result:
    """All rows of a file: frames, kinds and texts of events, numbers of records, and what the reader counted."""

    pieces: list[FrameBatch] = field(default_factory=list, compare=False)
    frames: list[Frame] = field(default_factory=list)
    events: list[tuple[str, str]] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    lines: dict[str, int] = field(default_factory=lambda: dict.fromkeys(LINES, 0))
    damage: tuple[int, str] | CaptureError | None = None  # where and why, as the reader tells it

    @property
    def texts(self) -> list[str]:
        return [text for _, text in self.events]

    def take(self, piece: FrameBatch) -> None:
        """Add the rows of the next piece."""
        self.pieces.append(piece)
        for name in self.lines.keys() & piece.lines.keys():
            self.lines[name] += piece.lines[name]
        recorded, told = piece.columns()
        ends = memoryview(recorded["data_offset"]).cast("i")
        cells = [
            memoryview(recorded[name]).cast(code)
            for name, code in (("t", "q"), ("bus", "B"), ("id", "I"), ("flags", "H"))
        ]
        for row, (t, bus, number, flags) in enumerate(zip(*cells, strict=True)):
            data = bytes(recorded["data"][ends[row] : ends[row + 1]])
            known = None if t == NO_TIME else t
            self.frames.append(Frame(known, piece.buses[bus], number, flags & 0xFF, data, flags >> 8))
        ends = memoryview(told["text_offset"]).cast("i")
        for row, kind in enumerate(told["kind"]):
            self.events.append((EVENTS[kind], bytes(told["text"][ends[row] : ends[row + 1]]).decode("ascii")))
        for table in recorded, told:
            self.numbers += memoryview(table["line"]).cast("I")


def read(form: str, data: bytes, size: int = 1 << 20) -> Result:
    """All rows of a file that comes in chunks of this size; each record is accounted for."""
    result, chunks = Result(), (data[at : at + size] for at in range(0, len(data), size))
    if form == "mcap":
        source = Source("read.mcap")
        source.format = detect(b"", source.name)
        for part in source.reader()(source, chunks):
            assert isinstance(part, FrameBatch)
            result.take(part)
        result.damage = source.damage
    else:
        reader = Reader(form)
        for chunk in chunks:
            reader.feed(chunk)
            result.take(reader.take())
        reader.finish()
        result.take(reader.take())
        result.damage = reader.damage
    result.numbers.sort()
    assert Totals(result.lines).balanced
    assert len(set(result.numbers)) == len(result.numbers)
    assert result.lines["frames"] == len(result.frames)
    return result


def sound(form: str, data: bytes) -> list[FrameBatch]:
    """The pieces of a file without damage."""
    result = read(form, data)
    assert result.damage is None
    return result.pieces


def traffic(seed: int, count: int, start: int, step: int, fd_flags: int = BRS | ESI) -> list[Frame]:
    """Frames of every kind a `step` of nanoseconds apart, on two buses, without directions."""
    source, frames = random.Random(seed), []
    for index in range(count):
        flags, code = source.choice((0, EXTENDED)), 0
        data = source.randbytes(source.randint(0, 8))
        kind = source.randrange(4)
        if kind == 0:
            flags, code, data = flags | REMOTE, len(data), b""
        elif kind == 1:
            flags |= FD | source.choice((0, BRS, ESI, BRS | ESI)) & fd_flags
            data = source.randbytes(source.choice(DLC_LENGTHS))
        number = source.getrandbits(29 if flags & EXTENDED else 11)
        frames.append(Frame(start + index * step, source.choice(("can0", "can1")), number, flags, data, code))
    return frames


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
        st.sampled_from(DLC_LENGTHS).flatmap(lambda size: st.binary(min_size=size, max_size=size)),
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
