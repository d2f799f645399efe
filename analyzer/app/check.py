"""Captures under all rules, for Python: `check` gives the report that the command `tailbyte check` shows."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from os import PathLike, fspath
from typing import TYPE_CHECKING
from warnings import warn

import dissectors
from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.rules.gate import DEFAULT, LEAST_SECONDS, LEAST_TRANSFERS, Least
from analyzer.sources import CaptureError
from analyzer.sources.merge import Plan
from analyzer.sources.origin import given

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    from analyzer.report.draft import JudgedCapture
    from analyzer.report.model import Report
    from analyzer.sources.origin import Origin

Name = str | PathLike[str]


def check(
    paths: Origin | Sequence[Origin],
    *,
    select: Iterable[str] = (),
    ignore: Iterable[str] = (),
    origins: Iterable[str] = (),
    fail_on: str = DEFAULT,
    least_transfers: int = LEAST_TRANSFERS,
    least_seconds: float = LEAST_SECONDS,
    bit_rate: int | None = None,
    dialects: Mapping[int, Collection[str]] | None = None,
    same_bus: bool = False,
    dissectors_: Sequence[Path] = (),
    trust_dissectors: bool = False,
    vehicle: Name | None = None,
    baseline: Name | None = None,
    profile: Name | None = None,
    drawn: bool = False,
) -> Report:
    """Judge captures one by one, or as recordings of one bus with `same_bus`.

    Args:
        paths: captures of any format, as paths or binary file objects with a name.
        select: rules or layers instead of those that are on by default.
        ignore: rules or layers that are left out.
        origins: only rules that these state: document, implied, dronecan, heuristic, vehicle.
        fail_on: what fails the gate, like `protocol:error,device:warning`, or `never`.
        least_transfers: complete transfers that a capture must have to be judged.
        least_seconds: seconds that it must last.
        bit_rate: bits per second of the bus.
        dialects: readings of doubtful fields by node ID, against the node's own data.
        same_bus: merge the captures and leave out what repeats.
        dissectors_: folders with further data types.
        trust_dissectors: run the Python that these folders bring.
        vehicle: a vehicle file; what is given here as an argument goes before it.
        baseline: the JSON of an older report, to tell what is new.
        profile: the name that `vehicle` had.
        drawn: keep what the time line of an HTML report is drawn from, in `timelines` of each triage.

    A capture that cannot be read is in the report, as damage. Raises `LookupError` for an unknown rule and `ValueError`
    for other arguments that make no sense (`ProfileError` and `BaselineError` are such).
    """
    if profile is not None:
        warn("check(profile=...) is deprecated: it is vehicle=... now", DeprecationWarning, stacklevel=2)
        if vehicle is not None:
            raise ValueError("vehicle and profile name the same thing: give vehicle alone")
        vehicle = profile
    captures = list(paths) if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths]
    if not captures:
        raise ValueError("no capture is given")
    rules = RuleChoice(
        select=tuple(select),
        ignore=tuple(ignore),
        origins=tuple(origins),
        fail_on=(fail_on,),
        least=Least(least_transfers, least_seconds),
        bit_rate=bit_rate,
        dialects=tuple((node, choice) for node, choices in (dialects or {}).items() for choice in choices),
        vehicle=None if vehicle is None else fspath(vehicle),
        baseline=None if baseline is None else fspath(baseline),
    )
    request = Request(
        tuple(map(given, captures)),
        Plan(same_bus=same_bus),
        tuple(dissectors_),
        tuple(dissectors_) if trust_dissectors else (),
        rules=rules,
        arguments=("--same-bus",) if same_bus else (),
    )
    criteria = Criteria(rules, dissectors.load(request.dissectors, request.trusted))
    return criteria.report(list(_judged(request, criteria, drawn=drawn)))


def _judged(request: Request, criteria: Criteria, *, drawn: bool) -> Iterator[JudgedCapture]:
    for label, alone in request.each().items():
        run = Run(alone, registry=criteria.registry)
        judged = JudgedRun(run, criteria)
        looked = RunTriage(run, drawn=drawn)
        with suppress(CaptureError):
            for _ in judged.batches(looked.over(run.inside())):
                pass
        yield judged.taken(label, triage=looked.found())
