"""The dataflash log of an ArduPilot autopilot: chosen records, a column a field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer._native import LogRecords
from analyzer.sources import Source
from analyzer.sources.errors import CaptureError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer._native import FrameBatch
    from analyzer.sources import Read
    from analyzer.sources.origin import FileObject, Origin

    Array = np.ndarray[Any, Any]

MOST_BYTES = 256 << 20  # of records that are kept; a log of 10 h has less
DATAFLASH = "ArduPilot dataflash"
_LAST = 1 << 52  # microseconds: 142 years
_HEADER = np.dtype("V3")
# How a field is stored, by its format character, and what its numbers are multiplied with.
_STORED = {
    "a": "V64", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8", "n": "V4",
    "N": "V16", "Z": "V64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "M": "u1", "q": "<i8",
    "Q": "<u8", "g": "<f2",
}  # fmt: skip
_SCALES = {**dict.fromkeys("cCeE", 0.01), "L": 1e-7}
_TIMES = {"TimeUS": 1, "TimeMS": 1000}  # microseconds each


@dataclass(frozen=True, slots=True)
class LogTable:
    """The records of a name, in the order of the log.

    `time` is in microseconds since the autopilot started, `number` counts all records of the log from 0. Of `columns`
    numbers are as they are meant, texts are bytes without the zeros behind them.
    """

    time: Array
    number: Array
    columns: Mapping[str, Array]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.time)


@dataclass(frozen=True, slots=True)
class AutopilotLog:
    """Tables of a log by name, of the names asked for; one that has no records is not among them.

    `records` are its sound records of any name, `unreadable` the places that were passed over, `damage` is why it could
    not be read to its end, `left` how many records were not kept. `given` is how long after the first frame of a
    capture the autopilot started, in nanoseconds, if somebody says so; else that is found out.
    """

    name: str
    tables: Mapping[str, LogTable]
    records: int
    unreadable: int
    left: int
    damage: CaptureError | None
    given: int | None = None

    def table(self, name: str) -> LogTable:
        """Return the records of a name; there may be none."""
        nothing = np.zeros(0, np.int64)
        return self.tables.get(name) or LogTable(nothing, nothing, {})


def read_log(of: Origin | FileObject, names: Sequence[str]) -> AutopilotLog:
    """Read the records of these names. Raises `CaptureError` if it is no dataflash log or cannot be opened."""
    source = _Log(of)
    reader = LogRecords(list(names))
    source.target = reader
    parts: dict[str, list[tuple[dict[str, Array], Array]]] = {}
    kept = left = 0
    for _ in source.chunks():
        for name, form, columns, records, numbers in reader.take():
            if not records:
                continue
            kept += len(records)
            places = np.frombuffer(numbers, np.uint64)
            if kept > MOST_BYTES:
                left += len(places)
                continue
            part = _columns(form.decode("latin-1"), columns.decode("latin-1"), records)
            parts.setdefault(name.decode("latin-1"), []).append((part, places))
    tables = {name: table for name, some in parts.items() if (table := _table(some)) is not None}
    return AutopilotLog(source.name, tables, reader.records, reader.unreadable, left, source.damage)


class _Log(Source):
    """A capture of which an autopilot's records are read."""

    __slots__ = ("target",)
    target: LogRecords

    def reader(self) -> Read:
        """Return what feeds the records. Raises `CaptureError` for another format."""
        if self.format.name != DATAFLASH:
            what = "is empty" if not self.size else f"looks like {self.format.name}, not like a dataflash log"
            raise CaptureError(self.name, "", what)
        return self._feed

    def _feed(self, _: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
        for chunk in chunks:
            self.target.feed(chunk)
            yield b""
        self.target.finish()
        if self.target.damage is not None:
            at, reason = self.target.damage
            self.damaged(f"byte {at}{' of the unpacked data' if self.packing else ''}", reason)
        yield b""


def _columns(form: str, names: str, records: bytes) -> dict[str, Array]:
    """Return the fields of records by the log's own names; of one name the first."""
    fields = [(f"{place}", _STORED[character]) for place, character in enumerate(form)]
    found = np.frombuffer(records, np.dtype([("header", _HEADER), *fields]))
    columns: dict[str, Array] = {}
    for (place, _), name, character in zip(fields, names.split(","), form, strict=False):  # names may be too many
        if name not in columns:
            columns[name] = found[place] * _SCALES[character] if character in _SCALES else found[place]
    return columns


def _table(parts: Sequence[tuple[dict[str, Array], Array]]) -> LogTable | None:
    """Return the records that have a time, with the fields that all of them have."""
    common = [name for name in parts[0][0] if all(name in columns for columns, _ in parts)]
    clock = next((name for name in _TIMES if name in common), None)
    if clock is None:
        return None
    number = np.concatenate([numbers for _, numbers in parts]).astype(np.int64)
    joined = {name: np.concatenate([columns[name] for columns, _ in parts]) for name in common}
    time = joined[clock].astype(np.int64) * _TIMES[clock]
    rows = np.argsort(number, kind="stable")
    rows = rows[(time[rows] >= 0) & (time[rows] < _LAST)]
    columns = {name: values[rows] for name, values in joined.items()}
    texts = {name: _text(values) for name, values in columns.items() if values.dtype.kind == "V"}
    return LogTable(time[rows], number[rows], columns | texts)


def _text(values: Array) -> Array:
    """Return texts of a fixed room as bytes up to the first zero."""
    return np.array([bytes(value).partition(b"\0")[0] for value in values], object)
