"""Two captures compared, for Python and for the command: each is read once, one after the other."""

from __future__ import annotations

from os import PathLike, fspath
from typing import TYPE_CHECKING

import dissectors
from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.app.version import UNKNOWN, version
from analyzer.report.comparison.compare import compare
from analyzer.report.comparison.failing import DiffGate
from analyzer.report.comparison.traits import MeasuredSide, Traits
from analyzer.sources.origin import given
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    from analyzer.report.comparison.model import CaptureDiff
    from analyzer.rules.checking import Measured
    from analyzer.sources.origin import Origin

    Name = str | PathLike[str]


def measured(
    judged: JudgedRun, traits: Traits, over: Callable[[Iterable[Measured]], Iterable[Measured]] = iter
) -> None:
    """Read a run to its end, under its rules and into the traits; `over` is told of each batch.

    What cannot be opened raises `CaptureError`; what is damaged is measured as far as it can be read.
    """
    for batch, _ in over(judged.batches(judged.run.inside(alone=judged.run.chosen is not None))):
        traits.feed(batch)


def finished(judged: JudgedRun, traits: Traits, criteria: Criteria) -> MeasuredSide:
    """Return what is compared of a run that has been read, or could not be opened."""
    one = judged.taken(judged.run.source.name)
    return MeasuredSide(traits, one.checked.facts, criteria.report([one]))


def tool() -> str:
    """Return the name and version of this program."""
    known = version()
    return "tailbyte" if known == UNKNOWN else f"tailbyte {known}"


def diff(
    good: Origin,
    bad: Origin,
    *,
    select: Iterable[str] = (),
    ignore: Iterable[str] = (),
    fail_on: str = "",
    bit_rate: int | None = None,
    dialects: Mapping[int, Collection[str]] | None = None,
    dissectors_: Sequence[Path] = (),
    vehicle: Name | None = None,
) -> CaptureDiff:
    """Compare two captures of any format, the second one to the first.

    Args:
        good: path, or binary file object with a name, of what went well.
        bad: the other one.
        select: rules or layers that are compared instead of those that are on by default.
        ignore: rules or layers that are left out.
        fail_on: differences for which `failed` is true: `any`, `error`, `warning`, a kind; comma-separated.
        bit_rate: bits per second of the bus.
        dialects: readings of doubtful fields by node ID, against the node's own data.
        dissectors_: folders with further data types.
        vehicle: a vehicle file with limits of its own.

    Damage is in the result. Raises `CaptureError` for a capture that cannot be opened, `LookupError` for an unknown
    rule and `ValueError` for other arguments that make no sense.
    """
    rules = RuleChoice(
        select=tuple(select),
        ignore=tuple(ignore),
        bit_rate=bit_rate,
        dialects=tuple((node, choice) for node, choices in (dialects or {}).items() for choice in choices),
        vehicle=None if vehicle is None else fspath(vehicle),
    )
    gate = DiffGate.parse([fail_on] if fail_on else [])
    request = Request((given(good),), dissectors=tuple(dissectors_), rules=rules)
    registry = dissectors.load(request.dissectors, request.trusted)
    sides = []
    for asked in (request, replace(request, captures=(given(bad),))):
        criteria = Criteria(rules, registry)
        judged, traits = JudgedRun(Run(asked, registry=registry), criteria), Traits(registry, criteria.settings)
        measured(judged, traits)
        sides.append(finished(judged, traits, criteria))
    return compare(sides[0], sides[1], gate, tool())
