"""Findings while they come in: as the report would have them now, and what has changed since the last look."""

from __future__ import annotations

import time
from collections import ChainMap
from typing import TYPE_CHECKING

from analyzer.report.draft import Draft
from analyzer.report.folding import Folds
from analyzer.report.found import FindingMaker, ranked
from analyzer.rules.found.runs import PAUSE
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from analyzer.report.draft import Revise
    from analyzer.report.model import Finding, Place, Severity
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun
    from analyzer.rules.judge import Judge
    from analyzer.rules.settings import Settings

    _Run = tuple[FindingKey, OccurrenceRun]
    _Counts = dict[Severity, tuple[int, Place]]
    _Seen = dict[tuple[object, ...], _Counts]

# Times as long as a look took the next one waits.
_PATIENCE = 40


@dataclass(frozen=True, slots=True)
class Change:
    """A finding that is new, or has come up again; `fresh` says which, `more` how often since the last look.

    What has come up since then is not before `since` (ns); None is the time of the last that was found.
    """

    finding: Finding
    fresh: bool
    more: int
    since: int | None = None


class Newest:
    """The findings of a judge at work.

    A look costs the more, the more is new, and a little for each finding: the next one waits many times as long as it
    took.

    Args:
        judge: has not finished.
        settings: those of the judge.
        revise: what a vehicle file has to say, such as waivers.
        capture: the name of the capture in the findings.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        judge: Judge,
        settings: Settings,
        revise: Sequence[Revise] = (),
        capture: str = "",
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._judge, self._settings, self._revise, self._capture = judge, settings, revise, capture
        self._now = now
        self._made: dict[int, tuple[_Run, Finding | None]] = {}  # by the identity of the run; none of an event
        self._labels: Mapping[tuple[int, int], str] = {}
        self._folds = Folds()
        self._told: dict[int, Finding] = {}  # all of the last look, by their identity
        self._seen: _Seen = {}
        self._early: _Seen = {}  # what a look ahead has told
        self._changes = 0
        self._next = 0.0
        self._all: tuple[Finding, ...] | None = ()

    @property
    def all(self) -> tuple[Finding, ...]:
        """Every finding of the last look, worst first, then by time."""
        if self._all is None:
            self._all = ranked(self._told.values())
        return self._all

    def look(self, buses: Sequence[str], *, last: bool = False) -> list[Change]:
        """Return what is new, worst first, then by time; `all` has every finding then.

        `buses` are names by index; the `last` look comes in any case.
        """
        start = self._now()
        if self._judge.changes == self._changes or (start < self._next and not last):
            return []
        self._changes = self._judge.changes
        found = self._compared(self._revised(self._folds.shown(self._kept(buses))))
        self._wait(start)
        return found

    def look_ahead(self, buses: Sequence[str]) -> list[Change] | None:
        """Return what would be new if nothing more came; None if it is too early for another look.

        It is provisional: what comes may explain it. Notes can wait, and what is said of the end of a capture is not
        true of one that goes on.
        """
        start = self._now()
        if start < self._next:
            return None
        outcome = self._judge.as_ended()
        pages = self._judge.pages
        runs = tuple(
            (key, run) for key, run in outcome.runs if key.severity != "note" and pages[key.rule].category != "capture"
        )
        made = self._maker(buses).of(replace(outcome, runs=runs))
        findings = self._revised(Folds().shown(list(made)))
        found, self._early = _changes(ranked(findings), ChainMap(self._early, self._seen))
        self._wait(start)
        return found

    def _maker(self, buses: Sequence[str]) -> FindingMaker:
        return FindingMaker(buses, self._judge.pages, self._settings, capture=self._capture)

    def _kept(self, buses: Sequence[str]) -> list[Finding]:
        """Return the findings of now, by place; one whose run is as it was is the same object again."""
        outcome, maker = self._judge.so_far(), self._maker(buses)
        renamed = {node for node, _ in outcome.labels.items() ^ self._labels.items()}
        self._labels = outcome.labels
        before = self._made
        if renamed:
            before = {name: one for name, one in before.items() if (one[0][0].bus, one[0][0].node) not in renamed}
        names = list(map(id, outcome.runs))
        known = zip(outcome.runs, map(before.get, names), strict=True)
        made = [one or (told, self._finding(told, maker)) for told, one in known]
        self._made = dict(zip(names, made, strict=True))
        return [one for _, one in made if one is not None]

    def _finding(self, told: _Run, maker: FindingMaker) -> Finding | None:
        key, run = told
        event = self._judge.pages[key.rule].event
        return None if event else maker.one(key, run, self._labels.get((key.bus, key.node), ""))

    def _revised(self, findings: Sequence[Finding]) -> Sequence[Finding]:
        if not self._revise:
            return findings
        draft = Draft((), (), ranked(findings))
        for revise in self._revise:
            draft = revise(draft)
        return draft.findings

    def _compared(self, findings: Iterable[Finding]) -> list[Change]:
        """Return what differs from the last look, and keep it in mind."""
        before, self._told = self._told, {id(one): one for one in findings}
        self._all = None
        new = ranked([one for name, one in self._told.items() if name not in before])
        found, seen = _changes(new, ChainMap(self._early, self._seen) if self._early else self._seen)
        for one in [one for name, one in before.items() if name not in self._told]:
            _forget(one, self._seen)
        for run, counts in seen.items():
            self._seen.setdefault(run, {}).update(counts)
        self._early = {run: counts for run, counts in self._early.items() if run not in self._seen}
        return found

    def _wait(self, start: float) -> None:
        end = self._now()
        self._next = end + _PATIENCE * (end - start)


def _name(one: Finding) -> tuple[object, ...]:
    return one.rule, one.bus, one.node, one.type, one.key, one.first.frame, one.first.t_ns


def _forget(one: Finding, seen: _Seen) -> None:
    name = _name(one)
    counts = seen.get(name, {})
    counts.pop(one.severity, None)
    if not counts:
        seen.pop(name, None)


def _changes(findings: Iterable[Finding], before: Mapping[tuple[object, ...], _Counts]) -> tuple[list[Change], _Seen]:
    """Return what differs from what has been seen before, and what has been seen now."""
    found: list[Change] = []
    seen: _Seen = {}
    for one in findings:
        name = _name(one)
        seen.setdefault(name, {})[one.severity] = one.count, one.last
        then = before.get(name, {})
        known = then.get(one.severity)
        if known == (one.count, one.last):
            continue
        if not then:
            found.append(Change(one, fresh=True, more=one.count, since=one.first.t_ns))
            continue
        # Another severity than before makes it no new one.
        count, last = known or (one.count, one.last)
        found.append(Change(one, fresh=False, more=one.count - count, since=_since(one, one.count - count, last.t_ns)))
    return found, seen


def _since(finding: Finding, more: int, last: int | None) -> int | None:
    """Return the time behind which all that is new lies: its occurrences follow each other without a pause."""
    now = finding.last.t_ns
    return now if now is None or last is None else max(last, now - max(0, more - 1) * PAUSE)
