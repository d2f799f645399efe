"""Plots for tests: every point of every entity; and what only looks like a viewer."""

from __future__ import annotations

import socket
import subprocess
import threading
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rerun.chunk import RrdReader

from analyzer.decode.engine import Engine
from analyzer.plot import viewer_program as plot_viewer
from analyzer.plot.address import Address
from analyzer.plot.parts import whole
from analyzer.plot.picture import Picture
from kit.judged import registry

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    import pyarrow as pa
    from rerun.chunk import Chunk

    from dissectors import Registry

TIMELINES = ("time", "since_start", "frame")


@dataclass
class Drawn:
    """Rows by entity path: what is not of all times by component, and points as (timelines, components)."""

    static: dict[str, dict[str, list[Any]]] = field(default_factory=dict)
    rows: dict[str, list[tuple[dict[str, int], dict[str, Any]]]] = field(default_factory=dict)

    def take(self, chunk: Chunk) -> None:
        batch = chunk.to_record_batch()
        columns = {name: cells(batch.column(name)) for name in batch.schema.names if not name.startswith("rerun.")}
        if chunk.is_static:
            self.static.setdefault(chunk.entity_path, {}).update({name: one[-1] for name, one in columns.items()})
            return
        here = self.rows.setdefault(chunk.entity_path, [])
        for k in range(batch.num_rows):
            times = {name: columns[name][k] for name in TIMELINES if name in columns}
            here.append((times, {name: column[k] for name, column in columns.items() if name not in TIMELINES}))

    def points(self, entity: str) -> list[tuple[dict[str, int], Any]]:
        """Times and the only value of each row."""
        out = []
        for times, parts in self.rows.get(entity, []):
            ((value,),) = parts.values()
            out.append((times, value))
        return out

    def values(self, entity: str) -> list[Any]:
        return [value for _, value in self.points(entity)]

    def frames(self, entity: str) -> list[int]:
        return [times["frame"] for times, _ in self.points(entity)]

    def under(self, start: str) -> list[str]:
        return sorted(path for path in self.rows if path.startswith(start))


def cells(column: pa.Array) -> list[Any]:
    import pyarrow as pa  # noqa: PLC0415

    if pa.types.is_temporal(column.type):
        return list(column.cast(pa.int64()).to_pylist())
    return list(column.to_pylist())


def batches(
    data: bytes, size: int, known: Registry, forced: Mapping[int, Collection[str]] | None = None
) -> Iterable[Any]:
    engine = Engine(known, forced)
    for start in range(0, len(data), size):
        yield from engine.feed(data[start : start + size])
        yield engine.flush()
    yield engine.finish()


def draw(
    data: bytes | str,
    *,
    size: int = 1 << 22,
    most: int | None = None,
    forced: Mapping[int, Collection[str]] | None = None,
    known: Registry | None = None,
) -> tuple[Drawn, Picture]:
    """The picture of candump text, in batches of `size` bytes; findings and summary are left out."""
    known = known or registry()
    drawn = Drawn()

    def send(chunks: Iterable[Chunk]) -> None:
        for chunk in chunks:
            drawn.take(chunk)

    picture = Picture(send, known, most=most)
    for batch in batches(data.encode() if isinstance(data, str) else data, size, known, forced):
        picture.note_start(batch)
        picture.feed(whole(batch))
    picture.close({"at rest": 4000.0})
    return drawn, picture


def read_back(path: Path) -> Drawn:
    drawn = Drawn()
    for chunk in RrdReader(path).stream():
        drawn.take(chunk)
    return drawn


def tables(data: bytes | str, known: Registry | None = None) -> tuple[dict[str, list[dict[str, Any]]], list[int]]:
    """Rows of every message table in whole transfers, `t` in ns, and the first frame of every transfer, from 1."""
    out: dict[str, list[dict[str, Any]]] = {}
    first: list[int] = []
    for batch in batches(data.encode() if isinstance(data, str) else data, 1 << 26, known or registry()):
        first += [frames[0] + 1 for frames in batch.transfers.column("frame").to_pylist()]
        for name, table in batch.messages.items():
            columns = {c: cells(table.column(c)) for c in table.schema.names}
            rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
            out.setdefault(name, []).extend(row for row in rows if row["trusted"] and row.get("packet_ok", True))
    return out, first


class Deaf:
    """Listens; reads nothing of what it is sent, or closes every connection at once."""

    def __init__(self, *, closes: bool = False) -> None:
        self._closes = closes
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = Address("rerun+http", "127.0.0.1", self._listening.getsockname()[1])
        self._open: list[socket.socket] = []
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        while True:
            try:
                found, _ = self._listening.accept()
            except OSError:
                return
            if self._closes:
                found.close()
            else:
                self._open.append(found)

    def close(self) -> None:
        """Also what a connection still waits for has an end then."""
        self._listening.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listening.close()
        for one in self._open:
            one.close()


@contextmanager
def deaf(*, closes: bool = False) -> Iterator[Address]:
    one = Deaf(closes=closes)
    try:
        yield one.address
    finally:
        one.close()


@contextmanager
def keeper(folder: Path) -> Iterator[tuple[Address, Path]]:
    """Rerun without a window, which writes what it is sent into a file."""
    program = plot_viewer.binary()
    assert program is not None
    port = plot_viewer.free_port("127.0.0.1")
    kept = folder / "kept.rrd"
    command = [program, "--bind", "127.0.0.1", "--port", str(port), "--save", str(kept)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        plot_viewer.wait_for(process, port)
        yield Address("rerun+http", "127.0.0.1", port), kept
    finally:
        process.kill()
        process.wait()


def taken(kept: Path) -> Drawn:
    """What a viewer that still runs has written so far."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the end of the file is not there yet
        try:
            return read_back(kept)
        except (RuntimeError, OSError, ValueError):
            return Drawn()
