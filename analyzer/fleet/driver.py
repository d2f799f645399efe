"""The driver of a fleet run: lists captures, has them judged, and is the only one that writes the results."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING
from uuid import uuid4

from analyzer.app.version import version
from analyzer.fleet.jobs import Job
from analyzer.fleet.renewing import renewed
from analyzer.fleet.tables import UNAVAILABLE, from_stream, rows_table
from analyzer.fleet.worker import judge_all, killed
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import pyarrow as pa

    from analyzer.fleet.cluster import Dask, Serial
    from analyzer.fleet.jobs import FleetSettings, Retries
    from analyzer.fleet.listing import ListedCapture, Provenance
    from analyzer.fleet.store import ResultStore

COMMIT_CAPTURES = 500  # a commit costs some 50 ms a table: one for each capture would cost more than the work
COMMIT_SECONDS = 60.0  # as much as a driver that dies loses at most


@dataclass(slots=True)
class RunCounts:
    """How a run goes: `done` have a result, `unavailable` none, `failed` of those done have no verdict.

    `renamed` are of another vehicle or day than they were, `others` tells that somebody else wrote the store meanwhile.
    """

    listed: int = 0
    skipped: int = 0
    renamed: int = 0
    done: int = 0
    failed: int = 0
    unavailable: int = 0
    cpu_s: float = 0.0
    bytes: int = 0
    workers: int = 0
    others: bool = False
    began: float = field(default_factory=time.monotonic)

    @property
    def left(self) -> int:
        """How many are still to be done."""
        return self.listed - self.skipped - self.done - self.unavailable

    @property
    def rate(self) -> float:
        """Captures per second."""
        return (self.done + self.unavailable) / max(time.monotonic() - self.began, 1e-9)


def jobs_of(found: Iterable[ListedCapture], names: Provenance, settings: str) -> list[Job]:
    """Return a job for each capture, all with the hash of the settings."""
    return [Job(one.url, one.etag, one.size, *names.of(one.url), settings) for one in found]


class FleetRun:
    """Has the jobs done that the store does not have yet, and commits their rows in batches.

    Args:
        store: where the results are.
        settings: what decides them.
        retries: for captures that cannot be read now.
        told: is called with the counts after each result.
    """

    def __init__(
        self,
        store: ResultStore,
        settings: FleetSettings,
        retries: Retries,
        told: Callable[[RunCounts], None] = lambda _: None,
    ) -> None:
        self._store, self._settings, self._retries, self._told = store, settings, retries, told
        self.counts = RunCounts()
        self._held: dict[str, list[pa.Table]] = {}
        self._waiting = 0
        self._committed = time.monotonic()

    def over(self, jobs: list[Job], workers: Serial | Dask, *, retry: bool = False) -> None:
        """Do them. Ctrl-C commits what there is and goes on up. Raises `StoreError` and `ClusterError`."""
        run, start, ended = uuid4().hex, time.time_ns(), "interrupted"
        known = self._store.done(retry=retry)
        todo = [replace(job, run=run) for job in jobs if job.key not in known]
        counts = self.counts
        counts.listed, counts.skipped, counts.workers = len(jobs), len(jobs) - len(todo), workers.workers
        settings, retries = self._settings, self._retries
        self._renew([job for job in jobs if job.key in known])

        def work(some: Sequence[Job]) -> dict[str, bytes]:
            return judge_all(some, settings, retries)

        try:
            for some, rows, error in workers.results(todo, work):
                self._take(rows if error is None else killed(some[0], str(error) or type(error).__name__, 2))
            ended = "done"
        finally:
            row = {
                "key": "", "run": run, "command": "check", "version": version(), "settings": settings.digest(),
                "chosen": json.dumps(settings.chosen(), default=str), "workers": workers.workers, "start_ns": start,
                "end_ns": time.time_ns(), "ended": ended, "listed": counts.listed, "skipped": counts.skipped,
                "done": counts.done, "unavailable": counts.unavailable, "cpu_s": counts.cpu_s,
                "bytes": counts.bytes,
            }  # fmt: skip
            self._held["runs"] = [rows_table("runs", [row])]
            self._commit()

    def _renew(self, done: Sequence[Job]) -> None:
        """Have captures that were done before count as they are asked for now: settings, vehicle, day."""
        stored = self._store.opened("captures") if done else None
        if stored is not None:
            names = {job.key: (job.vehicle, job.date) for job in done}
            told = names if any(map(any, names.values())) else {}
            rows, self.counts.renamed = renewed(stored.to_pyarrow_table(), list(names), told)
            self._held["captures"] = [rows] if len(rows) else []

    def _take(self, streams: dict[str, bytes]) -> None:
        rows = {name: from_stream(stream) for name, stream in streams.items()}
        for name, some in rows.items():
            self._held.setdefault(name, []).append(some)
        counts = self.counts
        for capture in rows["captures"].select(["outcome", "error", "cpu_s", "bytes"]).to_pylist():
            if capture["outcome"] == UNAVAILABLE:
                counts.unavailable += 1
            else:
                counts.done += 1
                counts.failed += bool(capture["error"])
            counts.cpu_s += capture["cpu_s"]
            counts.bytes += capture["bytes"]
            self._waiting += 1
        late = time.monotonic() - self._committed > COMMIT_SECONDS
        if late or self._waiting >= COMMIT_CAPTURES:
            self._commit()
        self._told(counts)

    def _commit(self) -> None:
        held, self._held, self._waiting = self._held, {}, 0
        self.counts.others |= self._store.append(held)
        self._committed = time.monotonic()
