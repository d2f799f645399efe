"""Rows of a live bus: drawn, made into batches as a hub gives them, recorded; and buses of python-can."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import can
from hypothesis import strategies as st

from analyzer._native import AsRecorded, FrameBatch
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.plan import RecordingPlan
from analyzer.sinks import form_of
from analyzer.sources import Source
from analyzer.sources.native import rows as rows_of
from analyzer.tables import EVENT_ROWS, EVENTS, wrap
from analyzer.window.cut import RECORDED
from kit import ROOT, TESTS
from kit.command import environment
from kit.rows import BODIES, DIRECTIONS, IDS, Fault, Frame, plain

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

START = 1_773_475_330_000_000_000
MS = 1_000_000


@dataclass(frozen=True)
class Lost:
    """Frames that nobody has."""

    t: int | None
    bus: str
    frames: int


@dataclass(frozen=True)
class Note:
    """A comment."""

    t: int | None
    text: str


Row = Frame | Fault | Lost | Note


def made(rows: Sequence[Row], names: Sequence[str] = ()) -> FrameBatch:
    """One piece of these rows; its buses are `names` and whatever occurs beside."""
    buses = list(dict.fromkeys([*names, *(row.bus for row in rows if not isinstance(row, Note))]))
    frames = [(line, row) for line, row in enumerate(rows, 1) if isinstance(row, Frame)]
    events = [(line, row) for line, row in enumerate(rows, 1) if not isinstance(row, Frame)]
    return FrameBatch.of(_frames(frames, buses), _events(events, buses), buses)


def _frames(rows: Sequence[tuple[int, Frame]], buses: list[str]) -> dict[str, bytes]:
    size = len(rows)
    return {
        "t": struct.pack(f"={size}q", *(_ns(row.t) for _, row in rows)),
        "bus": bytes(buses.index(row.bus) for _, row in rows),
        "id": struct.pack(f"={size}I", *(row.id for _, row in rows)),
        "flags": struct.pack(f"={size}H", *(row.flags | row.code << 8 for _, row in rows)),
        "line": struct.pack(f"={size}I", *(line for line, _ in rows)),
        **_texts("data", [row.data for _, row in rows]),
    }


def _events(rows: Sequence[tuple[int, Row]], buses: list[str]) -> dict[str, bytes]:
    size = len(rows)
    events = [row for _, row in rows]
    kinds = {Fault: "error frame", Lost: "drop", Note: "comment"}
    classes = [row.error if isinstance(row, Fault) else row.frames if isinstance(row, Lost) else 0 for row in events]
    named = [row for row in events if not isinstance(row, Note)]
    return {
        "t": struct.pack(f"={size}q", *(_ns(row.t) for row in events)),
        "bus": bytes(buses.index(row.bus) if row in named else 0 for row in events),
        "bus_valid": bytes(row in named for row in events),
        "line": struct.pack(f"={size}I", *(line for line, _ in rows)),
        "kind": bytes(EVENTS.index(kinds[type(row)]) for row in events),
        "class": struct.pack(f"={size}I", *classes),
        "flags": struct.pack(f"={size}H", *(row.flags if isinstance(row, Fault) else 0 for row in events)),
        **{name: bytes(size) for name in ("tx_errors", "rx_errors", "tx_errors_valid")},
        **_texts("data", [row.data if isinstance(row, Fault) else b"" for row in events]),
        **_texts("text", [row.text.encode() if isinstance(row, Note) else b"" for row in events]),
    }


def _ns(t: int | None) -> int:
    return -(1 << 63) if t is None else t


def _texts(name: str, cells: Sequence[bytes]) -> dict[str, bytes]:
    ends = [0]
    for cell in cells:
        ends.append(ends[-1] + len(cell))
    return {name: b"".join(cells), f"{name}_offset": struct.pack(f"={len(ends)}i", *ends)}


def cut(rows: Sequence[Row], places: Iterable[int], names: Sequence[str] = ()) -> list[FrameBatch]:
    """Pieces of these rows, cut in front of these places; their buses have the same numbers in all."""
    names = list(dict.fromkeys([*names, *(row.bus for row in rows if not isinstance(row, Note))]))
    edges = [0, *sorted(min(place, len(rows)) for place in places), len(rows)]
    return [made(rows[a:b], names) for a, b in pairwise(edges)]


def taken(pieces: Iterable[FrameBatch]) -> list[Row]:
    """The rows of pieces in the order of their records."""
    found: list[Row] = []
    for part in pieces:
        tables = (wrap(form, cells) for form, cells in zip((RECORDED, EVENT_ROWS), part.columns(), strict=True))
        frames, events = (plain(table) for table in tables)
        order = sorted([(row["line"], False, row) for row in frames] + [(row["line"], True, row) for row in events],
                       key=lambda entry: entry[:2])  # fmt: skip
        for _, is_event, row in order:
            bus = "" if row["bus"] is None else part.buses[row["bus"]]
            found.append(_event(row, bus) if is_event else _frame(row, bus))
    return found


def _frame(row: dict, bus: str) -> Frame:
    return Frame(row["t"], bus, row["id"], row["flags"] & 0xFF, row["data"], row["flags"] >> 8)


def _event(row: dict, bus: str) -> Row:
    kind = EVENTS[row["kind"]]
    if kind == "error frame":
        return Fault(row["t"], bus, row["class"], row["data"], row["flags"])
    if kind == "drop":
        return Lost(row["t"], bus, row["class"])
    assert kind == "comment"
    return Note(row["t"], row["text"])


def stored(*paths: str | Path, sound: bool = True) -> list[Row]:
    """The rows of files, one behind the other, that can be read whole if they are `sound`."""
    found: list[Row] = []
    for path in paths:
        source = Source(str(path))
        found += taken(part for part in rows_of(source.chunks()) if isinstance(part, FrameBatch))
        assert not sound or source.damage is None, source.damage
    return found


def traffic(count: int, bus: str = "can0", first: int = 0, step: int = MS) -> list[Frame]:
    """Frames that tell their numbers."""
    return [Frame(START + n * step, bus, n & 0x7FF, 0, n.to_bytes(8, "big")) for n in range(first, first + count)]


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Of every kind, without a time and a bus of its own."""
    id_, extended = draw(IDS)
    kind, data, code = draw(BODIES)
    return Frame(0, "", id_, extended | kind | draw(DIRECTIONS), data, code)


TEXTS = st.one_of(st.text(max_size=20), st.text("abc #;()\t", max_size=10), st.just("x" * 300))
NAMES = st.one_of(
    st.sampled_from(["can0", "can1", "virtual:demo", "a b", "any", "PCAN:USB'1,x", ""]), st.text(max_size=70)
)


@st.composite
def sessions(draw: st.DrawFn, most: int = 25) -> list[Row]:
    """What happens on up to three buses, in time; comments and losses among it."""
    names = draw(st.lists(NAMES, min_size=1, max_size=3, unique=True))
    kinds = st.one_of(
        frames(),
        frames(),
        st.builds(Fault, st.just(0), st.just(""), st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), DIRECTIONS),
        st.builds(Lost, st.just(0), st.just(""), st.integers(1, 2**32 - 1)),
        st.builds(Note, st.just(0), TEXTS),
    )
    t = draw(st.sampled_from([0, START, START + 1]))
    rows: list[Row] = []
    for row in draw(st.lists(kinds, max_size=most)):
        t += draw(st.sampled_from([0, 1, 999, 1000, MS, 3_000 * MS]))
        named = row if isinstance(row, Note) else replace(row, bus=draw(st.sampled_from(names)))
        rows.append(replace(named, t=t))
    return rows


def plan(path: Path, **more: Any) -> RecordingPlan:
    form, packing = form_of(path.name)
    return RecordingPlan(str(path), form, packing, **more)


def record(path: Path, pieces: Iterable[FrameBatch], **more: Any) -> FileRecorder:
    """A recording of these pieces, finished."""
    with FileRecorder(plan(path, force=True), **more) as recorder:
        for piece in pieces:
            recorder.put(piece)
    return recorder


def as_recorded(pieces: Iterable[FrameBatch]) -> list[FrameBatch]:
    canonical = AsRecorded()
    return [canonical.apply(piece) for piece in pieces]


def child(path: Path, code: str, **more: Any) -> subprocess.Popen[bytes]:
    folders = os.pathsep.join([str(TESTS), str(ROOT)])
    command = [sys.executable, "-c", code, str(path), folders]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment(), **more)


def frames_in(path: Path) -> list[Row]:
    """As far as a file can be read that may not have come to its end."""
    try:
        return stored(path, sound=False) if path.exists() else []
    except Exception:  # noqa: BLE001 - a reader may see half a file
        return []


Arrival = tuple[int, bool, bool, bytes]


def got(bus: can.BusABC) -> list[Arrival]:
    """Identifier, whether it has 29 bits, whether it asks for data, data; of all that has come by now."""
    messages = iter(lambda: bus.recv(0), None)
    return [(m.arbitration_id, m.is_extended_id, m.is_remote_frame, bytes(m.data)) for m in messages if m is not None]


class Failing(can.BusABC):
    """Sends so many frames, and then says why not."""

    protocol = can.CanProtocol.CAN_20

    def __init__(self, most: int, error: Exception) -> None:
        super().__init__("x")
        self.most, self.error, self.sent = most, error, 0

    def send(self, *_: object) -> None:
        if self.sent == self.most:
            raise self.error
        self.sent += 1

    def shutdown(self) -> None:
        super().shutdown()
        raise RuntimeError
