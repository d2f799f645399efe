"""Captures made for merging, and what comes out of it as plain rows."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

from command import START

from analyzer._native import Reader
from analyzer.cut import RECORDED
from analyzer.engine import LINES, Totals
from analyzer.sources.merge import Merged, Plan, open_captures
from analyzer.sources.native import rows
from analyzer.tables import EVENT_ROWS, raw_times, wrap

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from analyzer._native import Piece

# time in nanoseconds (None: comment line), interface, data
Record = tuple[int | None, str, int]


def text(records: Iterable[Record], direction: str = "") -> bytes:
    lines = [
        f"# {data}\n" if t is None else f"({t // 10**9}.{t % 10**9:09d}) {bus} 1F040601#{data:016X}{direction}\n"
        for t, bus, data in records
    ]
    return "".join(lines).encode()


def piece(data: bytes) -> Piece:
    reader = Reader("candump")
    reader.feed(data)
    reader.finish()
    return reader.take()


def seen(pieces: Iterable[Piece | bytes]) -> tuple[list[Record], dict[str, int]]:
    """The records that came out, comments among them, and the sum over all pieces; their numbers must rise."""
    out: list[tuple[int, Record]] = []
    lines = dict.fromkeys(LINES, 0)
    for part in pieces:
        assert not isinstance(part, bytes)
        frames, events = (table_rows(columns) for columns in part.columns())
        names = part.buses
        out += [(r["line"], (r["t"], names[r["bus"]], int.from_bytes(r["data"], "big"))) for r in frames]
        out += [(r["line"], (None, "", int(r["text"].rpartition("# ")[2]))) for r in events]
        for name, count in part.lines.items():
            if name in lines:
                lines[name] += count
    assert Totals(lines).balanced
    out.sort(key=lambda row: row[0])
    numbers = [number for number, _ in out]
    assert len(set(numbers)) == len(numbers)
    assert all(1 <= number <= lines["lines"] for number in numbers)
    return [record for _, record in out], lines


def table_rows(columns: dict[str, Any]) -> list[dict[str, Any]]:
    batch = wrap(RECORDED if "id" in columns else EVENT_ROWS, columns)
    times = raw_times(batch.column("t"))
    rest = batch.select(batch.schema.names[1:]).to_pylist()
    return [{"t": t, **row} for t, row in zip(times, rest, strict=True)]


def by_time(captures: list[list[Record]]) -> list[Record]:
    """What merging means: stable, by the latest time so far of each capture."""
    keyed = []
    for index, records in enumerate(captures):
        latest = -1
        for at, record in enumerate(records):
            latest = max(latest, -1 if record[0] is None else record[0])
            keyed.append((latest, index, at, record if record[0] is not None else (None, "", record[2])))
    return [record for *_, record in sorted(keyed, key=lambda row: row[:3])]


def merge(tmp_path: Path, *contents: bytes, plan: Plan | None = None) -> tuple[list[Record], dict[str, int], Merged]:
    names = []
    for index, content in enumerate(contents):
        path = tmp_path / f"{index}.log"
        path.write_bytes(content)
        names.append(str(path))
    source = open_captures(names, plan)
    assert isinstance(source, Merged)
    return *seen(rows(source.chunks())), source


def flight(seed: int, *, start: int = START, bus: str = "can0", count: int = 400) -> list[Record]:
    """Frames that do not repeat, a millisecond or two apart."""
    chance = random.Random(seed)
    t, out = start, []
    for _ in range(count):
        t += chance.randrange(500_000, 3_000_000)
        out.append((t, bus, chance.getrandbits(56) << 8 | 0xC0 | len(out) % 32))
    return out


def write(path: Path, records: list[Record]) -> Path:
    path.write_bytes(text(records))
    return path
