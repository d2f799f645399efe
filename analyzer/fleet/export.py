"""Message tables of a fleet as Parquet: workers write them, one file a capture and table."""

from __future__ import annotations

import hashlib
from contextlib import closing
from typing import TYPE_CHECKING, Any, Self, cast

import pyarrow as pa
import pyarrow.parquet as pq

import analyzer
from analyzer.fleet.driver import RunCounts
from analyzer.fleet.tables import KILLED, UNAVAILABLE, plain
from analyzer.fleet.worker import tried
from analyzer.sources import UnavailableError
from analyzer.sources.storage import open_stream
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import BinaryIO

    from analyzer.fleet.cluster import Dask, Serial
    from analyzer.fleet.jobs import FleetSettings, Job, Retries

PARTITIONS = ("vehicle", "date")
_UNKNOWN = "unknown"
_URL = "url"


@dataclass(frozen=True, slots=True)
class ExportGoal:
    """Where tables go: below `place`, a folder each, in folders by `partitions` (`vehicle=v17`)."""

    place: str
    tables: tuple[str, ...]
    partitions: tuple[str, ...] = ()

    def folders(self, job: Job) -> str:
        """Return the folders of a capture below those of its tables, empty without partitions."""
        told = {"vehicle": job.vehicle, "date": job.date}
        return "".join(f"{name}={_safe(told[name])}/" for name in self.partitions)

    def path(self, job: Job, table: str, folders: str) -> str:
        """Return the file for a table of a capture: its name is the key, so what is there is done."""
        return f"{self.place.rstrip('/')}/{table}/{folders}{job.key}.parquet"


def _safe(text: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in text).strip(".") or _UNKNOWN


def missing(jobs: Sequence[Job], goal: ExportGoal) -> list[Job]:
    """Return the jobs of which a file is not there yet."""
    from fsspec.core import url_to_fs  # noqa: PLC0415 - of the extra

    files, root = url_to_fs(goal.place)
    there = (
        {path.rpartition("/")[2] for path in files.find(f"{root}/_done")} if files.exists(f"{root}/_done") else set()
    )
    return [job for job in jobs if _mark(job, goal) not in there]


def _mark(job: Job, goal: ExportGoal) -> str:
    """Return the name of the file that says that a capture is exported with these tables, into the folders in it."""
    folders = goal.folders(job)
    where = hashlib.sha256(folders.encode()).hexdigest()[:8] if folders else ""
    return f"{_tables_of(job, goal)}{where}"


def _tables_of(job: Job, goal: ExportGoal) -> str:
    return f"{job.key}-{'+'.join(sorted(goal.tables))}-"


def export(job: Job, settings: FleetSettings, retries: Retries, goal: ExportGoal) -> dict[str, Any]:
    """Write the tables of one capture; return its row: outcome, error, rows. An empty table has no file."""
    attempts, result = tried(job.url, retries, lambda: {"captures": [_exported(job, settings, goal)]})
    return result["captures"][0] | {"attempts": attempts}


def _exported(job: Job, settings: FleetSettings, goal: ExportGoal) -> dict[str, Any]:
    from fsspec.core import url_to_fs  # noqa: PLC0415 - of the extra

    files, _ = url_to_fs(goal.place)
    written = 0
    with _Files(files, job, goal) as out, closing(open_stream(job.url)) as stream:
        capture = analyzer.open_capture(stream, settings.dissectors, tables=goal.tables)
        for batch in capture:
            for name, rows in batch.messages.items():
                out.write(name, rows)
                written += len(rows)
        if isinstance(capture.damage, UnavailableError):
            raise capture.damage
        out.keep()
    _settle(files, job, goal)
    damage = "" if capture.damage is None else str(capture.damage.reason)
    return {"outcome": "damaged" if damage else "judged", "error": "", "damage": damage, "rows": written}


def _settle(files: Any, job: Job, goal: ExportGoal) -> None:
    """Note that a capture is exported; what is left of it in folders of another vehicle or partition goes."""
    done = f"{goal.place.rstrip('/')}/_done"
    files.makedirs(done, exist_ok=True)
    files.pipe_file(f"{done}/{_mark(job, goal)}", goal.folders(job).encode())
    for mark in files.glob(f"{done}/{_tables_of(job, goal)}*"):
        if mark.rpartition("/")[2] != _mark(job, goal):
            folders = files.cat_file(mark).decode()
            left = (goal.path(job, table, folders) for table in goal.tables)
            for path in [mark, *(path for path in left if files.exists(path))]:
                files.rm(path)


class _Files:
    """The files of one capture, there under their names once all of them are whole."""

    def __init__(self, files: Any, job: Job, goal: ExportGoal) -> None:
        self._files, self._job, self._goal = files, job, goal
        self._open: dict[str, tuple[str, BinaryIO, pq.ParquetWriter]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for part, file, writer in self._open.values():
            writer.close()
            file.close()
            self._files.rm(part)

    def write(self, table: str, rows: pa.RecordBatch) -> None:
        """Add rows to a table."""
        if table not in self._open:
            path = f"{self._goal.path(self._job, table, self._goal.folders(self._job))}.part"
            self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
            file = cast("BinaryIO", self._files.open(path, "wb"))
            self._open[table] = path, file, pq.ParquetWriter(file, rows.schema, compression="zstd")
        self._open[table][2].write_batch(rows)

    def keep(self) -> None:
        """Give the files their names."""
        for part, file, writer in self._open.values():
            writer.close()
            file.close()
            self._files.mv(part, part.removesuffix(".part"))
        self._open.clear()


def scan(urls: Sequence[str], table: str, columns: Sequence[str] | None = None) -> pa.RecordBatchReader:
    """Return a table of captures, one after the other, as a stream of Arrow: what Polars, DuckDB and pandas take.

    Each row has the `url` of its capture first; of a capture that is damaged come the rows before the damage. Raises
    `LookupError` for a table or column that there is not, and while it is read `CaptureError`.
    """
    schema = analyzer.schema(table)
    wanted = schema if columns is None else schema.empty_table().select(list(columns)).schema
    whole = pa.schema([pa.field(_URL, pa.string()), *wanted])
    return pa.RecordBatchReader.from_batches(whole, _scanned(list(urls), table, whole))


def _scanned(urls: Sequence[str], table: str, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    columns = schema.names[1:]
    for url in urls:
        with closing(open_stream(url)) as stream:
            capture = analyzer.open_capture(stream, tables=[table], columns=columns)
            for batch in capture:
                for rows in batch.messages.values():
                    name = pa.array([plain(url)], pa.string()).take(pa.array([0] * len(rows), pa.int8()))
                    yield pa.RecordBatch.from_arrays([name, *rows.select(columns).columns], schema=schema)
            if isinstance(capture.damage, UnavailableError):
                raise capture.damage


class ExportRun:
    """Has the tables written that are not there yet.

    Args:
        settings: which types.
        retries: for captures that cannot be read now.
        goal: what goes where.
        told: is called with the counts after each result.
    """

    def __init__(
        self, settings: FleetSettings, retries: Retries, goal: ExportGoal, told: Callable[[RunCounts], None]
    ) -> None:
        self._settings, self._retries, self._goal, self._told = settings, retries, goal, told
        self.counts = RunCounts()
        self.errors: list[tuple[str, str]] = []

    def over(self, jobs: list[Job], workers: Serial | Dask) -> None:
        """Do them. Raises `ClusterError`, and `OSError` where nothing can be written."""
        todo = missing(jobs, self._goal)
        counts = self.counts
        counts.listed, counts.skipped, counts.workers = len(jobs), len(jobs) - len(todo), workers.workers
        settings, retries, goal = self._settings, self._retries, self._goal

        def work(some: Sequence[Job]) -> list[dict[str, Any]]:
            return [export(job, settings, retries, goal) for job in some]

        for some, rows, error in workers.results(todo, work):
            for job, row in zip(
                some, rows if error is None else [{"outcome": KILLED, "error": str(error)}], strict=True
            ):
                if row["outcome"] == UNAVAILABLE:
                    counts.unavailable += 1
                else:
                    counts.done += 1
                    counts.failed += bool(row["error"])
                if row["error"]:
                    self.errors.append((job.url, row["error"]))
            self._told(counts)
