"""The outcome of the rules as findings of a report: named, with places and examples."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from analyzer.report.model import SEVERITIES, DeviceEvent, Example, Finding, Place
from analyzer.report.problems import MOST_FRAMES
from analyzer.rules import verdicts
from analyzer.rules.events import EVERY_BUS
from analyzer.rules.found.runs import Shown
from analyzer.rules.gate import FailOn
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.report.model import Category, Origin, Severity
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun
    from analyzer.rules.judge import Outcome
    from analyzer.rules.settings import Settings

NEVER_FAILS = FailOn()
_UNSHOWN = Shown(NO_TIME, -1, "", "", (), ())


class FindingMaker:
    """Makes findings of runs of one outcome.

    Args:
        buses: names by index.
        pages: the pages of rules.
        settings: what was looked for.
        capture: the name of the capture.
        coarse: its times are too far apart to judge rules by.
        fail_on: what fails.
    """

    def __init__(
        self,
        buses: Sequence[str],
        pages: Mapping[str, Page],
        settings: Settings,
        *,
        capture: str = "",
        coarse: bool = False,
        fail_on: FailOn = NEVER_FAILS,
    ) -> None:
        self._buses, self._pages, self._settings = buses, pages, settings
        self._capture, self._coarse, self._fail_on = capture, coarse, fail_on

    def of(self, outcome: Outcome) -> Iterator[Finding]:
        """Give a finding for each run that is no event."""
        for key, run in outcome.runs:
            if not self._pages[key.rule].event:
                yield self.one(key, run, outcome.labels.get((key.bus, key.node), ""))

    def one(self, key: FindingKey, run: OccurrenceRun, label: str) -> Finding:
        """Make the finding of a run; `label` is what its node is called."""
        page = self._pages[key.rule]
        doubtful = self._coarse and verdicts.TIMES in page.inconclusive and key.rule not in self._settings.severities
        severity: Severity = "note" if doubtful else key.severity
        examples = run.examples
        first, shown = _place(*run.first), examples[0] if examples else _UNSHOWN
        return Finding(
            key.rule,
            page.title,
            severity,
            cast("Category", page.category),
            cast("Origin", page.origin),
            page.clause,
            self._capture,
            "" if key.bus == EVERY_BUS else self._buses[key.bus],
            None if key.node < 0 else key.node,
            label,
            key.type,
            key.key,
            run.count,
            first,
            first if run.last == run.first else _place(*run.last),
            _frames(examples),
            ", ".join(filter(None, (verdicts.COARSE, shown.cause))) if doubtful else shown.cause,
            run.text or shown.text,
            tuple(map(_example, examples)),
            fails=self._fail_on.fails(page.category, severity),
        )


def events_from(
    outcome: Outcome, buses: Sequence[str], pages: Mapping[str, Page], *, capture: str = ""
) -> Iterator[DeviceEvent]:
    """Give an event for each run of a rule that finds such, by time; `buses` are names by index."""
    for key, run in outcome.runs:
        page = pages[key.rule]
        if page.event:
            yield DeviceEvent(
                rule=key.rule,
                title=page.title,
                category=cast("Category", page.category),
                capture=capture,
                bus="" if key.bus == EVERY_BUS else buses[key.bus],
                node=None if key.node < 0 else key.node,
                label=outcome.labels.get((key.bus, key.node), ""),
                type=key.type,
                place=_place(*run.first),
                text=run.text or run.examples[0].text,
            )


def ranked(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort by severity, the worst first, then by time."""

    def order(one: Finding) -> tuple[int, int]:
        return SEVERITIES.index(one.severity), -1 if one.first.t_ns is None else one.first.t_ns

    return tuple(sorted(found, key=order))


def _frames(examples: Sequence[Shown]) -> tuple[int, ...]:
    """Return the first frames of some occurrences, each once, as people count them; most runs have one occurrence."""
    if len(examples) == 1 and examples[0].frame >= 0:
        return (examples[0].frame + 1,)
    frames = dict.fromkeys(number + 1 for shown in examples for number in _evidence(shown))
    return tuple(frames)[:MOST_FRAMES]


def _evidence(shown: Shown) -> Sequence[int]:
    """Return the frame where an occurrence is; for one without, what it is concluded from."""
    return (shown.frame,) if shown.frame >= 0 else shown.frames


def _example(shown: Shown) -> Example:
    return Example(_number(shown.frame), _time(shown.t), shown.text, shown.lines)


def _place(t: int, frame: int) -> Place:
    return Place(_number(frame), _time(t))


def _number(frame: int) -> int | None:
    return None if frame < 0 else frame + 1


def _time(t: int) -> int | None:
    return None if t == NO_TIME else t
