"""`tailbyte fleet check` and `export`: captures in, a store out."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

import dissectors
from analyzer.app.process import streams
from analyzer.app.process.interrupt import cleaning
from analyzer.cli import status
from analyzer.cli.arguments import options, rules
from analyzer.decode.by_name import find_table
from analyzer.fleet.cluster import LEAST_MEMORY, ClusterChoice, cluster
from analyzer.fleet.driver import FleetRun, jobs_of
from analyzer.fleet.export import PARTITIONS, ExportGoal, ExportRun
from analyzer.fleet.jobs import FleetSettings, Retries
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.store import ResultStore

if TYPE_CHECKING:
    import argparse

    from analyzer.fleet.driver import RunCounts
    from analyzer.fleet.jobs import Job

NAME = "tailbyte fleet"
_EVERY = 0.5  # seconds between two lines of progress on a terminal
_EVERY_LOGGED = 30.0  # and in a log


def check(args: argparse.Namespace) -> int:
    """Judge what the store does not have yet; return the exit status."""
    store, settings = ResultStore(args.output), _settings(args)
    rules.criteria(settings.rules, dissectors.load(settings.dissectors, settings.trusted), NAME)
    jobs = _jobs(args, store.place, settings)
    if not jobs:
        return status.NOT_JUDGED
    choice, progress = _choice(args), _Progress()
    run = FleetRun(store, settings, Retries(args.attempts), progress)
    try:
        with cleaning(), store.alone(), cluster(choice) as workers:
            run.over(jobs, workers, retry=args.retry is not None)
    except KeyboardInterrupt:
        progress.end(run.counts, "interrupted: the same command goes on")
        return status.INTERRUPTED
    progress.end(run.counts)
    return _status(run.counts)


def export(args: argparse.Namespace) -> int:
    """Write the tables of captures that are not exported yet; return the exit status."""
    settings = _settings(args)
    registry = dissectors.load(settings.dissectors, settings.trusted)
    if not args.table:
        raise ValueError("export needs a table: --table NAME (tailbyte fields lists them)")
    tables = tuple(dict.fromkeys(find_table(registry, name)[1] for name in args.table))
    partitions = tuple(filter(None, args.partition.split(",")))
    if unknown := set(partitions) - set(PARTITIONS):
        raise ValueError(f"--partition {min(unknown)}: it takes vehicle and date")
    goal = ExportGoal(ResultStore(args.output).place, tables, partitions)
    jobs = _jobs(args, goal.place, settings)
    if not jobs:
        return status.NOT_JUDGED
    choice, progress = _choice(args), _Progress()
    run = ExportRun(settings, Retries(args.attempts), goal, progress)
    try:
        with cleaning(), cluster(choice) as workers:
            run.over(jobs, workers)
    except KeyboardInterrupt:
        progress.end(run.counts, "interrupted: the same command goes on")
        return status.INTERRUPTED
    for url, error in run.errors:
        streams.complain(f"{url}: {error}", NAME)
    progress.end(run.counts)
    return _status(run.counts)


def _settings(args: argparse.Namespace) -> FleetSettings:
    folders, trusted = options.folders(args)
    return FleetSettings(rules.choice(args), folders, trusted)


def _jobs(args: argparse.Namespace, store: str, settings: FleetSettings) -> list[Job]:
    found = listed(args.place, store, lambda pattern: streams.complain(f"{pattern}: no capture", NAME))
    jobs = jobs_of(found, Provenance(args.name, args.names), settings.digest())
    if args.name or args.names:
        _tell_untold(args, jobs)
    return jobs


def _tell_untold(args: argparse.Namespace, jobs: list[Job]) -> None:
    """Complain of captures whose vehicle is not told, or of a day that is none: the name may fit the wrong folders."""
    wish = f"--name {args.name!r}" if args.name else f"--names {args.names}"
    nobody = [job for job in jobs if not job.vehicle]
    if nobody:
        known = len(jobs) - len(nobody)
        whose = f"{known or 'none'} of {len(jobs)} captures, {'not of' if known else 'such as'} {nobody[0].url}"
        streams.complain(f"{wish} tells the vehicle of {whose}", NAME)
    dayless = [job for job in jobs if job.vehicle and not job.date] if "{date}" in (args.name or "") else []
    if dayless:
        one = f"{dayless[0].url}, of vehicle {dayless[0].vehicle}"
        streams.complain(f"{wish} finds no day in {len(dayless)} of {len(jobs)} captures, such as {one}", NAME)


def _choice(args: argparse.Namespace) -> ClusterChoice:
    """Return the workers that are wished for. Raises `ValueError` for a memory in which no worker gets to a capture."""
    if args.scheduler is None and args.workers != 0:
        from dask.utils import parse_bytes  # noqa: PLC0415 - of the extra

        try:
            size = parse_bytes(args.memory)
        except ValueError:
            raise ValueError(f"--memory {args.memory!r} is no size, such as 2GiB") from None
        if size < parse_bytes(LEAST_MEMORY):
            raise ValueError(
                f"--memory {args.memory}: a worker takes most of that before it reads anything; at least {LEAST_MEMORY}"
            )
    return ClusterChoice(args.scheduler, args.workers, args.memory)


def _status(counts: RunCounts) -> int:
    return status.DAMAGED if counts.failed or counts.unavailable else status.OK


class _Progress:
    """Lines on standard error: one that changes on a terminal, else one now and then."""

    def __init__(self) -> None:
        self._terminal, self._warned = sys.stderr.isatty(), False
        self._next = time.monotonic() + _EVERY

    def __call__(self, counts: RunCounts) -> None:
        """Say how far it is, if it is time to."""
        self._warn(counts)
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + (_EVERY if self._terminal else _EVERY_LOGGED)
        left = counts.left / counts.rate
        text = (
            f"{counts.done + counts.unavailable} of {counts.listed - counts.skipped}  {counts.rate:.1f}/s  "
            f"{_duration(left)} left  {counts.failed} failed  {counts.unavailable} unavailable"
        )
        streams.tell(f"\r\x1b[K{text}" if self._terminal else f"-- {text}\n")

    def _warn(self, counts: RunCounts) -> None:
        if counts.others and not self._warned:
            self._warned = True
            streams.complain("another run writes this store, too: both do the same work, and it counts once", NAME)

    def end(self, counts: RunCounts, more: str = "") -> None:
        """Say what came of it."""
        self._warn(counts)
        read = f"captures: {counts.done} read, {counts.skipped} done before, {counts.failed} without a result"
        lines = [
            f"-- {read}, {counts.unavailable} could not be read now",
            f"-- {counts.bytes / 1e6:.1f} MB, {counts.cpu_s:.1f} s of CPU on {counts.workers or 'no'} workers",
        ]
        if counts.renamed:
            lines.append(f"-- {counts.renamed} of those done before are of another vehicle or day now")
        if more:
            lines.append(f"-- {more}")
        streams.tell(("\r\x1b[K" if self._terminal else "") + "".join(f"{line}\n" for line in lines))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
