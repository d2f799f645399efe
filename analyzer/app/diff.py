"""Two captures compared, for Python and for the command: each is read once, one after the other."""

from __future__ import annotations

from os import PathLike, fspath
from typing import TYPE_CHECKING

import dissectors
from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
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


class MeasuredRun:
    """A run that is measured for a comparison: under the rules, into the traits, and under the eyes of triage.

    What a filter leaves tells nothing of a flight, so nobody looks at that.

    Args:
        run: not read yet.
        criteria: of the same types.
    """

    def __init__(self, run: Run, criteria: Criteria) -> None:
        self._run, self._criteria = run, criteria
        self._judged, self._traits = JudgedRun(run, criteria), Traits(run.registry, criteria.settings)
        self._looked = RunTriage(run) if run.chosen is None else None

    def read(self, over: Callable[[Iterable[Measured]], Iterable[Measured]] = iter) -> None:
        """Read it to its end; `over` is told of each batch.

        What cannot be opened raises `CaptureError`; what is damaged is measured as far as it can be read.
        """
        for batch, _ in over(self._judged.batches(self._run.inside(alone=self._run.chosen is not None))):
            self._traits.feed(batch)
            if self._looked is not None:
                self._looked.feed(batch)

    def side(self) -> MeasuredSide:
        """Return what is compared of it, after it has been read or could not be opened."""
        found = None if self._looked is None else self._looked.found()
        one, window = self._judged.taken(self._run.source.name, triage=found), self._run.request.window
        return MeasuredSide(
            self._traits, one.checked.facts, self._criteria.report([one]), not (window.leaves_off or window.cuts_in)
        )


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
        measured = MeasuredRun(Run(asked, registry=registry), criteria)
        measured.read()
        sides.append(measured.side())
    return compare(sides[0], sides[1], gate, tool())
