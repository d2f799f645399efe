"""What an export must hold, worked out cell by cell, and captures made for merging."""

from __future__ import annotations

import csv
import json
import math
import random
import re
from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader

from analyzer._native import Reader
from analyzer.decode.core import LINES, Totals
from analyzer.sources.merge import Merged, Plan, open_captures
from analyzer.sources.native import rows
from analyzer.tables import (
    EVENT_ROWS,
    EVENTS,
    FRAME_ANOMALIES,
    KINDS,
    STATUSES,
    TRANSFER_ANOMALIES,
    VERDICTS,
    raw_times,
    wrap,
)
from analyzer.window.cut import RECORDED
from kit.command import START

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import analyzer

    Row = dict[str, Any]
    Topics = dict[str, list[tuple[int, Any]]]
    from collections.abc import Iterable

    from analyzer._native import FrameBatch

BITS = {"extended": 1, "remote": 2, "fd": 8, "brs": 16, "esi": 32}


def plain(table: pa.Table) -> list[Row]:
    """Rows with times and durations as integer nanoseconds, texts as text."""
    columns = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        timed = pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type)
        columns[field.name] = (column.cast(pa.int64()) if timed else column).to_pylist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def names_of(capture: analyzer.Capture) -> list[str]:
    """All tables of a capture."""
    return ["frames", "transfers", "events", *dict.fromkeys(name for batch in capture for name in batch.messages)]


def expected(capture: analyzer.Capture, name: str) -> list[Row]:
    """Rows as every export has them, keys in order."""
    table = capture.table(name)
    make = {"frames": _frame, "transfers": _transfer, "events": _event}.get(name, _message(table.schema))
    return [
        make(number, row | {"bus": None if row["bus"] is None else capture.buses[row["bus"]]}, capture)
        for number, row in enumerate(plain(table))
    ]


def _words(bits: int, names: tuple[str, ...]) -> str | None:
    return ", ".join(name for k, name in enumerate(names) if bits >> k & 1) or None


def _after(row: Row, key: str, more: Row) -> Row:
    out: Row = {}
    for name, value in row.items():
        out[name] = value
        out |= more if name == key else {}
    return out


def _frame(number: int, row: Row, _: object) -> Row:
    flags = row["flags"]
    way = "tx" if flags & 64 else "rx" if flags & 128 else None
    more = {name: bool(flags & bit) for name, bit in BITS.items()} | {"direction": way}
    texts = {"verdict": VERDICTS[row["verdict"]], "anomaly": _words(row["anomaly"], FRAME_ANOMALIES)}
    return {"frame": number + 1} | _after(row, "flags", more) | texts


def _transfer(number: int, row: Row, capture: analyzer.Capture) -> Row:
    message = capture.registry.message(row["kind"], row["type_id"], row["variant"])
    row = _after(row, "kind", {"type": None if message is None else message.name})
    row |= {"kind": KINDS[row["kind"]], "status": STATUSES[row["status"]]}
    row["anomaly"] = _words(row["anomaly"], TRANSFER_ANOMALIES)
    frames = {"frames": [frame + 1 for frame in row["frame"]]}
    row = {name: value for name, value in _after(row, "frame", frames).items() if name != "frame"}
    return {"transfer": number} | row


def _event(_: int, row: Row, __: object) -> Row:
    return row | {"kind": EVENTS[row["kind"]]}


def _message(schema: pa.Schema) -> Any:
    enums = {}
    for field in schema:
        texts = {int(k): v for k, v in json.loads((field.metadata or {}).get(b"enum", b"{}")).items()}
        if len(set(texts.values())) > 1 and pa.types.is_integer(field.type):
            enums[field.name] = texts

    def make(_: int, row: Row, __: object) -> Row:
        row = {name: _flagged(value, schema.field(name).type) for name, value in row.items()}
        for name, texts in enums.items():
            row = _after(row, name, {f"{name}.text": texts.get(row[name])})
        return row

    return make


def _flagged(value: Any, kind: pa.DataType) -> Any:
    """A structure without members is a flag."""
    if value is None or not pa.types.is_nested(kind):
        return value
    if pa.types.is_list(kind):
        return [_flagged(cell, kind.value_type) for cell in value]
    if kind.num_fields == 0:
        return True
    return {kind.field(k).name: _flagged(value[kind.field(k).name], kind.field(k).type) for k in range(kind.num_fields)}


def same(left: Any, right: Any) -> bool:
    """Equal, NaN included."""
    if isinstance(left, float) and isinstance(right, float):
        return left == right or (math.isnan(left) and math.isnan(right))
    if isinstance(left, list) and isinstance(right, list):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, dict) and isinstance(right, dict):
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    return type(left) is type(right) and left == right


def read_table(path: Path) -> pa.Table:
    """A Parquet or Arrow file."""
    if path.suffix == ".parquet":
        return pq.read_table(path)
    with pa.ipc.open_file(path) as reader:
        return reader.read_all()


def read_mcap(path: Path) -> Topics:
    """Log time and message by topic; all descriptors go into one pool, as in a viewer."""
    pool, types, topics = descriptor_pool.DescriptorPool(), dict[str, Any](), defaultdict(list)
    with path.open("rb") as file:
        for of, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert message.log_time == message.publish_time
            if channel.message_encoding != "protobuf":
                topics[channel.topic].append((message.log_time, message.data))
                continue
            if of.name not in types:
                for descriptor in FileDescriptorSet.FromString(of.data).file:
                    pool.Add(descriptor)
                types[of.name] = message_factory.GetMessageClass(pool.FindMessageTypeByName(of.name))
            topics[channel.topic].append((message.log_time, types[of.name].FromString(message.data)))
    return dict(topics)


def read_csv(path: Path) -> Iterator[dict[str, str]]:
    with path.open(newline="") as file:
        yield from csv.DictReader(file)


def as_csv(row: Row, schema: pa.Schema) -> Row:
    """How a row reads in CSV: texts; of numbers that are not whole, the nearest value of their type."""
    out: Row = {}
    for name, value in row.items():
        kind = schema.field(name).type if name in schema.names else None
        if kind is not None and pa.types.is_timestamp(kind):
            out[f"{name}_ns"] = "" if value is None else str(value)
            out[name] = "" if value is None else _iso(value)
        elif kind is not None and pa.types.is_duration(kind):
            out[f"{name}_ns"] = "" if value is None else str(value)
        elif value is None:
            out[name] = ""
        elif isinstance(value, bool):
            out[name] = str(value).lower()
        elif isinstance(value, bytes):
            out[name] = value.hex().upper()
        elif isinstance(value, str):
            out[name] = re.sub(r"^(?=[=+\-@\t\r\n])", "'", value)
        else:
            out[name] = value
    return out


def csv_cell(text: str, like: Any) -> Any:
    """A CSV cell as the kind of value that stands beside it."""
    if isinstance(like, list | dict):
        return _as(json.loads(text), like)
    if isinstance(like, float):
        return _as(text, like)
    return int(text) if isinstance(like, int) else text


def _as(value: Any, like: Any) -> Any:
    if isinstance(like, float):
        number = float(value)  # of single precision the shortest text is written
        return like if np.float32(number) == np.float32(like) and np.float32(like) == like else number
    if isinstance(like, list) and len(like) == len(value):
        return [_as(*pair) for pair in zip(value, like, strict=True)]
    if isinstance(like, dict) and list(like) == list(value):
        return {key: _as(cell, like[key]) for key, cell in value.items()}
    return value


def _iso(ns: int) -> str:
    return str(np.datetime64(ns, "ns")).replace("T", " ")


# time in nanoseconds (None: comment line), interface, data
Record = tuple[int | None, str, int]


def text(records: Iterable[Record], direction: str = "") -> bytes:
    lines = [
        f"# {data}\n" if t is None else f"({t // 10**9}.{t % 10**9:09d}) {bus} 1F040601#{data:016X}{direction}\n"
        for t, bus, data in records
    ]
    return "".join(lines).encode()


def piece(data: bytes) -> FrameBatch:
    reader = Reader("candump")
    reader.feed(data)
    reader.finish()
    return reader.take()


def seen(pieces: Iterable[FrameBatch | bytes]) -> tuple[list[Record], dict[str, int]]:
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
