"""The work of a worker: judge each capture in one pass, and hand the rows back."""

from __future__ import annotations

import time
from contextlib import closing
from typing import TYPE_CHECKING, Any

import dissectors
from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.fleet import rows
from analyzer.fleet.health import EscHealth
from analyzer.fleet.tables import DAMAGED, JUDGED, KILLED, UNAVAILABLE, UNREADABLE, as_stream
from analyzer.sources import CaptureError, UnavailableError
from analyzer.sources.origin import given
from analyzer.sources.storage import open_stream

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.fleet.jobs import FleetSettings, Job, Retries

    Rows = dict[str, list[dict[str, Any]]]

_ready: list[tuple[FleetSettings, Criteria]] = []  # types and rules are loaded once a worker


def judge_all(jobs: Sequence[Job], settings: FleetSettings, retries: Retries) -> dict[str, bytes]:
    """Return the rows of captures as a stream of Arrow for each table that has any."""
    rows: Rows = {}
    for job in jobs:
        for name, some in judge(job, settings, retries).items():
            rows.setdefault(name, []).extend(some)
    return {name: as_stream(name, some) for name, some in rows.items() if some}


def judge(job: Job, settings: FleetSettings, retries: Retries) -> Rows:
    """Return the rows of every table for one capture; whatever a capture does is told in its row of `captures`."""
    before = time.process_time()
    attempts, result = tried(job.url, retries, lambda: _judged(job, settings))
    (capture,) = result["captures"]
    capture |= rows.of_job(job) | {"attempts": attempts, "cpu_s": time.process_time() - before, "at_ns": time.time_ns()}
    if not capture["date"] and capture["start_ns"] is not None:
        capture["date"] = rows.day(capture["start_ns"])
    return {name: [{"key": job.key, "run": job.run, **row} for row in some] for name, some in result.items()}


def tried(url: str, retries: Retries, attempt: Callable[[], Rows]) -> tuple[int, Rows]:
    """Return how often it was tried, and the rows of the last time; what cannot be read now is tried again."""
    pause = retries.pause
    for count in range(1, retries.attempts + 1):
        try:
            return count, attempt()
        except UnavailableError as error:
            if count == retries.attempts:
                return count, {"captures": [rows.without_result(url, UNAVAILABLE, error.reason)]}
            time.sleep(pause)
            pause *= 2
        except (Exception, MemoryError) as error:  # noqa: BLE001 - one capture never ends the run
            reason = error.reason if isinstance(error, CaptureError) else f"{type(error).__name__}: {error}"
            return count, {"captures": [rows.without_result(url, UNREADABLE, reason)]}
    raise AssertionError


def _judged(job: Job, settings: FleetSettings) -> Rows:
    criteria = _criteria(settings)
    with closing(open_stream(job.url)) as stream:
        run = Run(
            Request((given(stream),), dissectors=settings.dissectors, rules=settings.rules, threads=1),
            registry=criteria.registry,
        )
        judged, looked, health = JudgedRun(run, criteria), RunTriage(run), EscHealth(criteria.registry)
        for measured in judged.batches(looked.over(run.batches())):
            health.feed(measured.batch)
        part = run.source.parts[0]
        if isinstance(part.damage, UnavailableError):  # the network failed in the middle: no damage of the capture
            raise part.damage
        found = looked.found()
        report = criteria.report([judged.taken(job.url, triage=found)])
        result = rows.of_report(report, run)
        result |= rows.happened(looked.witness, found, run.engine.buses)
        result["esc_health"] = rows.of_health(health.rows(result["flights"]), result, run.engine.buses)
    (capture,) = result["captures"]
    flights = result["flights"]
    if capture["damage"] and not capture["frames"]:
        capture |= {"error": capture["damage"], "verdict": None}
    capture |= {
        "outcome": UNREADABLE if capture["error"] else DAMAGED if capture["damage"] else JUDGED,
        "flights": len(flights),
        "flight_ns": sum(one["ran_ns"] for one in flights),
        "bytes": part.size,
    }
    return result


def _criteria(settings: FleetSettings) -> Criteria:
    if not _ready or _ready[0][0] != settings:
        registry = dissectors.load(settings.dissectors, settings.trusted)
        _ready[:] = [(settings, Criteria(settings.rules, registry))]
    return _ready[0][1]


def killed(job: Job, reason: str, attempts: int) -> dict[str, bytes]:
    """Return the row of a capture that its worker died of, as `judge_all` does."""
    row = rows.without_result(job.url, KILLED, reason) | rows.of_job(job)
    row |= {"attempts": attempts, "cpu_s": 0.0, "at_ns": time.time_ns()}
    return {"captures": as_stream("captures", [{"key": job.key, "run": job.run, **row}])}
