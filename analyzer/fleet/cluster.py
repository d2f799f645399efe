"""Where jobs run: in this process, on a local cluster of Dask, or on any scheduler of it."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias

from analyzer.fleet.preload import calm
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.fleet.jobs import Job

MEMORY = "2GiB"  # of a local worker; with 95 % of it a worker is ended, and its capture tried alone
LEAST_MEMORY = "256MiB"  # below that a worker is ended for what it takes itself, again and again
_SAFE_PATH = "PYTHONSAFEPATH"
_AHEAD = 4  # tasks that wait for each worker: enough that none is idle, few enough to stop soon
# Small captures go to a worker together, as a task has a price of its own; stored bytes of a second of work.
_TASK_BYTES, _TASK_JOBS = 8 << 20, 32
# What Dask does for its dashboard, which is not there, and looks after many times a second in each process: as much
# time as a capture takes it, and more. Memory is looked at once a second by who ends a worker; the worker itself has
# nothing that it could write to disk, and if it held captures back until there is more memory, it would for ever.
_QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "10s",
    "distributed.admin.tick.cycle": "10s",
    "distributed.admin.tick.limit": "60s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.scheduler.work-stealing-interval": "1s",
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.nanny.pre-spawn-environ.MALLOC_ARENA_MAX": 1,  # from its first thread on: see quick_start
    "distributed.worker.preload": ["analyzer.fleet.preload"],
}

Work: TypeAlias = "Callable[[Sequence[Job]], Any]"
Result: TypeAlias = tuple["Sequence[Job]", Any, BaseException | None]


class ClusterError(Exception):
    """A cluster that cannot be had, or is lost; says which and why."""


@dataclass(frozen=True, slots=True)
class ClusterChoice:
    """The wish for workers: a scheduler's address, or how many here; 0 does everything in this process."""

    scheduler: str | None = None
    workers: int | None = None
    memory: str = MEMORY


class Serial:
    """Jobs one after the other in this process: the measure of what a cluster may give."""

    workers = 0

    def results(self, jobs: Sequence[Job], work: Work) -> Iterator[Result]:
        """Yield each job with its result."""
        for job in jobs:
            yield [job], work([job]), None


class Dask:
    """Jobs on a cluster of Dask, through its `distributed.Client`."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self.workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))

    def results(self, jobs: Sequence[Job], work: Work) -> Iterator[Result]:
        """Yield jobs that were done together with their result, in any order, or with the error that is no result.

        Jobs that ran on a worker when it died are tried alone at the end, one after the other: whose worker dies then,
        it has killed it. Raises `ClusterError` when the cluster is lost.
        """
        suspects: list[Job] = []
        most = self.workers * _AHEAD
        yield from self._some(tasks(jobs, most), work, most, suspects)
        for job in suspects:
            again: list[Job] = []
            yield from self._some([[job]], work, 1, again)
            if again:
                yield [job], None, ClusterError("its worker died of it, alone again")

    def _some(self, some: Iterable[Sequence[Job]], work: Work, most: int, suspects: list[Job]) -> Iterator[Result]:
        distributed = _distributed()
        of: dict[str, Sequence[Job]] = {}
        waiting = distributed.as_completed(loop=self._client.loop)
        left = iter(some)

        def submit() -> None:
            for jobs in left:
                future = self._client.submit(work, jobs, pure=False)
                of[future.key] = jobs
                waiting.add(future)
                if len(of) >= most:
                    return

        submit()
        while of:
            future = next(waiting)
            jobs, error = of.pop(future.key), None
            if future.status == "finished":
                yield jobs, future.result(), None
            elif isinstance(error := future.exception(), distributed.KilledWorker):
                suspects += jobs
            elif future.cancelled():
                raise ClusterError("the scheduler is lost")
            elif len(jobs) > 1:
                suspects += jobs
            else:
                yield jobs, None, error
            future.release()
            submit()


def tasks(jobs: Sequence[Job], least: int) -> Iterator[Sequence[Job]]:
    """Yield jobs as they are done together: small captures, in `least` tasks if there are as many jobs."""
    most = min(_TASK_JOBS, max(1, len(jobs) // least))
    task: list[Job] = []
    held = 0
    for job in jobs:
        size = _TASK_BYTES if job.size is None else job.size
        if task and (len(task) == most or held + size > _TASK_BYTES):
            yield task
            task, held = [], 0
        task.append(job)
        held += size
    if task:
        yield task


def _distributed() -> Any:
    """Return the module, which has types for a part of itself only."""
    return import_module("distributed")


@contextmanager
def cluster(choice: ClusterChoice) -> Iterator[Serial | Dask]:
    """Have workers as long as this lasts. Raises `ClusterError`."""
    if choice.scheduler is None and choice.workers == 0:
        yield Serial()
        return
    import logging  # noqa: PLC0415

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if choice.scheduler is None:
        with _here(choice) as workers:
            yield workers
        return
    try:
        client = _distributed().Client(choice.scheduler, timeout=30)
    except (OSError, ValueError) as error:
        raise ClusterError(f"{choice.scheduler}: {error}") from None
    with client:
        yield Dask(client)


@contextmanager
def _here(choice: ClusterChoice) -> Iterator[Dask]:
    """Have workers on this machine, which nothing but this machine can reach."""
    import logging  # noqa: PLC0415

    import dask  # noqa: PLC0415 - of the extra

    distributed = _distributed()
    with ExitStack() as held:
        # Whoever was on a worker that died is tried alone, rather than with others again.
        held.enter_context(dask.config.set({
            **_QUIET, "distributed.scheduler.allowed-failures": 0, "distributed.worker.daemon": True,
        }))  # fmt: skip
        held.enter_context(_without_this_folder())
        starting = held.enter_context(ExitStack())
        starting.enter_context(_deaf())
        try:
            local = held.enter_context(distributed.LocalCluster(
                n_workers=choice.workers, threads_per_worker=1, memory_limit=choice.memory, dashboard_address=None,
                host="127.0.0.1", silence_logs=logging.CRITICAL, scheduler_sync_interval="60s",
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # of its health, on any port that is free
            ))  # fmt: skip
            client = held.enter_context(distributed.Client(local))
        except (OSError, RuntimeError) as error:
            raise ClusterError(f"no workers can be started: {error.__cause__ or error}") from None
        starting.close()
        for one in (local.scheduler, *local.workers.values()):
            calm(one)
        yield Dask(client)


@contextmanager
def _deaf() -> Iterator[None]:
    """Let Ctrl-C wait, and threads and processes that are started meanwhile never hear it: we end them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker  # noqa: PLC0415

    resource_tracker.ensure_running()  # which would have its thread hear it again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _without_this_folder() -> Iterator[None]:
    """Keep Python of workers from importing what lies in the folder we are in, which may be one of captures."""
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before
