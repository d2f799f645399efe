"""One batch in a file of its own: every table as an Arrow stream, opened where it is looked at."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.browser.store.order import ordered
from analyzer.decode.engine import Batch
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.decode.readings import Statement
    from dissectors.kit import Array

_ALIGNED = 64  # bytes, for Arrow's buffers
_INDEX = 4  # bytes at the end: how long the index in front of them is, offsets and lengths of tables by name
_TABLES = ("frames", "transfers", "events", "settled")
_STEP = 1024  # frames between two times that are kept for the whole capture


@dataclass(frozen=True, slots=True)
class Segment:
    """A batch in a file of its own.

    A bus that is watched for a day makes a million of these: they hold what is asked of all batches at once, and share
    what hardly ever changes.

    `zero` is the time in nanoseconds that relative ones count from if this is a part of a capture. `rows` are those of
    a list. `low` and `high` are the least and the greatest time of its frames in nanoseconds, None without any; `ticks`
    the times of every 1024th frame.
    """

    path: str
    first_frame: int
    frames: int
    first_transfer: int
    transfers: int
    rows: int
    buses: tuple[str, ...]
    readings: tuple[Statement, ...]
    low: int | None
    high: int | None
    ticks: Array
    zero: int | None = None


def write(path: Path, batch: Batch, before: Array, last: Segment | None = None) -> Segment:
    """Write a batch and the transfers `before` its own of the same senders, behind the `last` one. Raises `OSError`."""
    rows = ordered(batch)
    more = {"rows": rows, "before": pa.RecordBatch.from_arrays([pa.array(before)], ["before"])}
    if batch.bit_times is not None:
        more["bits"] = pa.RecordBatch.from_arrays([pa.array(batch.bit_times)], ["bits"])
    tables = {name: getattr(batch, name) for name in _TABLES} | more
    tables |= {f"/{name}": table for name, table in batch.messages.items() if len(table)}
    places = {}
    with pa.OSFile(str(path), "wb") as out:
        for name, table in tables.items():
            out.write(b"\0" * (-out.tell() % _ALIGNED))
            start = out.tell()
            with pa.ipc.new_stream(out, table.schema) as stream:
                stream.write_batch(table)
            places[name] = start, out.tell() - start
        index = json.dumps(places).encode()
        out.write(index + len(index).to_bytes(_INDEX, "little"))
    times = batch.frames.column("t")
    known = numbers(times)[valid(times)] if len(times) else np.zeros(0, np.int64)
    low, high = (int(known.min()), int(known.max())) if len(known) else (None, None)
    ticks = np.array(numbers(times)[::_STEP]) if len(known) == len(times) else np.array(known[::_STEP])
    buses, readings = batch.buses, batch.readings
    if last is not None:
        buses = last.buses if last.buses == buses else buses
        readings = last.readings if last.readings == readings else readings
    return Segment(
        str(path), batch.first_frame, len(batch.frames), batch.first_transfer, len(batch.transfers), len(rows),
        buses, readings, low, high, ticks, batch.zero,
    )  # fmt: skip


class OpenSegment:
    """The tables of a segment, mapped; each is opened once."""

    def __init__(self, segment: Segment) -> None:
        self.segment = segment
        source = pa.memory_map(segment.path)
        self._bytes = source.read_buffer(source.size())
        end = len(self._bytes) - _INDEX
        size = int.from_bytes(self._bytes.slice(end), "little")
        self.places: Mapping[str, tuple[int, int]] = json.loads(self._bytes.slice(end - size, size).to_pybytes())
        self._tables: dict[str, pa.RecordBatch] = {}

    def table(self, name: str) -> pa.RecordBatch:
        """Return a table."""
        if name not in self._tables:
            start, size = self.places[name]
            self._tables[name] = pa.ipc.open_stream(self._bytes.slice(start, size)).read_next_batch()
        return self._tables[name]

    def column(self, table: str, column: str) -> Array:
        """Return a column of numbers without a copy."""
        one = self.table(table)
        return numbers(one.column(column)) if len(one) else np.zeros(0, np.int64)

    @property
    def batch(self) -> Batch:
        """The batch as it was decoded."""
        segment = self.segment
        bits = self.column("bits", "bits") if "bits" in self.places else None
        return Batch(
            **{name: self.table(name) for name in _TABLES}, messages=StoredMessages(self),
            first_frame=segment.first_frame, first_transfer=segment.first_transfer, buses=segment.buses,
            readings=segment.readings, bit_times=bits, zero=segment.zero,
        )  # fmt: skip


class StoredMessages(Mapping[str, pa.RecordBatch]):
    """The tables of messages and packets of a segment, by name, opened when they are asked for."""

    def __init__(self, opened: OpenSegment) -> None:
        self._opened = opened

    def __getitem__(self, name: str) -> pa.RecordBatch:
        """Return a table. Raises `KeyError`."""
        return self._opened.table(f"/{name}")

    def __iter__(self) -> Iterator[str]:
        """Yield their names."""
        return (name[1:] for name in self._opened.places if name[0] == "/")

    def __len__(self) -> int:
        """Count them."""
        return sum(name[0] == "/" for name in self._opened.places)

    def __contains__(self, name: object) -> bool:
        """Return whether the batch has one."""
        return f"/{name}" in self._opened.places
