"""A hash of every table that the engine makes of captures, to compare two states of the program.

    python tests/bench/table_hashes.py captures/*.log [--live] [--chunk 4096] [--rows 500] [--forced 3=tm] > before

The state is the one on PYTHONPATH. A line has the capture, the table, its rows and a hash of its schema with metadata,
of what is valid, and of the values; a null hides what lies in its cell. `order` is a hash of the names and rows of all
batches, and of what they say of their nodes.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

import dissectors
from analyzer.decode import core as pipeline
from analyzer.decode.engine import Engine
from analyzer.sources.merge import Plan, open_captures
from analyzer.sources.origin import given

if TYPE_CHECKING:
    from collections.abc import Iterator

BASIC = ("frames", "transfers", "events", "settled")


class TableHash:
    """The hash of one table, batch by batch."""

    def __init__(self) -> None:
        self.rows = 0
        self._schemas: dict[bytes, None] = {}
        self._columns: dict[str, Any] = {}

    def feed(self, table: pa.RecordBatch) -> None:
        """Add rows."""
        table.validate(full=True)
        self.rows += len(table)
        self._schemas[table.schema.serialize().to_pybytes()] = None
        for name, column in zip(table.schema.names, table.columns, strict=True):
            self._add(name, column)

    def _add(self, path: str, column: pa.Array) -> None:
        kind = column.type
        self._put(f"{path} valid", np.asarray(column.is_valid()))
        if pa.types.is_struct(kind):
            for k, child in enumerate(column.flatten()):  # a null hides what is below it
                self._add(f"{path}.{kind.field(k).name}", child)
        elif pa.types.is_list(kind):
            self._put(f"{path} lengths", np.asarray(column.value_lengths().fill_null(0)))
            self._add(f"{path}[]", column.flatten())
        elif pa.types.is_binary(kind) or pa.types.is_string(kind):
            whole = column.cast(pa.binary())
            self._put(f"{path} lengths", np.asarray(whole.fill_null(b"").to_numpy(zero_copy_only=False), object), len)
            self._columns[path] = self._hasher(path)
            self._columns[path].update(b"".join(whole.drop_null().to_pylist()))
        elif not pa.types.is_null(kind):
            plain = column.cast(pa.int64()) if pa.types.is_temporal(kind) else column
            values = np.asarray(plain.drop_null().to_numpy(zero_copy_only=False))
            self._put(path, values)

    def _hasher(self, path: str) -> Any:
        return self._columns.setdefault(path, hashlib.blake2b(digest_size=12))

    def _put(self, path: str, values: Any, of: Any = None) -> None:
        cells = np.fromiter(map(of, values), np.int32, len(values)) if of else np.ascontiguousarray(values)
        self._hasher(path).update(cells.tobytes())

    def __str__(self) -> str:
        """The hash in digits."""
        whole = hashlib.blake2b(b"".join(sorted(self._schemas)), digest_size=10)
        for path, part in self._columns.items():
            whole.update(path.encode() + part.digest())
        return whole.hexdigest()


def batches(path: str, engine: Engine, chunk: int) -> Iterator[Any]:
    """Yield the batches of a capture; with `chunk` it is candump text, fed in pieces of so many bytes."""
    if chunk:
        data = Path(path).read_bytes()
        yield from engine.run(data[at : at + chunk] for at in range(0, len(data), chunk))
        return
    for piece in open_captures([given(path)], Plan()).chunks():
        yield from engine.feed(piece) if piece != b"" else engine.flushed()
    yield from engine.end()


def hashes(path: str, engine: Engine, chunk: int) -> Iterator[tuple[str, int, str]]:
    """Yield name, rows and hash of each table of a capture."""
    tables: dict[str, TableHash] = {}
    order = hashlib.blake2b(digest_size=10)
    for batch in batches(path, engine, chunk):
        found = {name: getattr(batch, name) for name in BASIC} | dict(batch.messages)
        for name, table in found.items():
            tables.setdefault(name, TableHash()).feed(table)
        order.update(repr([(name, len(table)) for name, table in found.items()]).encode())
        order.update(repr((batch.first_frame, batch.first_transfer, batch.buses, batch.readings)).encode())
    order.update(repr(engine.totals).encode())
    yield from ((name, table.rows, str(table)) for name, table in sorted(tables.items()))
    yield "order", len(tables), order.hexdigest()


def main() -> None:
    """Print a line a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--live", action="store_true", help="batches do not wait for what decides how nodes are read")
    parser.add_argument("--chunk", type=int, default=0, metavar="BYTES")
    parser.add_argument("--rows", type=int, default=pipeline.BATCH_ROWS, help="of a batch")
    parser.add_argument("--forced", action="append", default=[], metavar="NODE=READING")
    parser.add_argument("--dissector", action="append", default=[], type=Path, metavar="DIR")
    args = parser.parse_args()
    pipeline.BATCH_ROWS = args.rows
    forced: dict[int, list[str]] = {}
    for one in args.forced:
        node, _, choice = one.partition("=")
        forced.setdefault(int(node), []).append(choice)
    registry = dissectors.load(args.dissector)
    for path in args.captures:
        engine = Engine(registry, forced, ahead=not args.live)
        for name, rows, digest in hashes(path, engine, args.chunk):
            sys.stdout.write(f"{Path(path).name}\t{name}\t{rows}\t{digest}\n")


if __name__ == "__main__":
    with suppress(BrokenPipeError):
        main()
