"""Occurrences to findings: what one node does wrong again and again is one line, with its first and last time.

The result does not depend on the order in which occurrences come in, as long as no bound is reached.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dissectors.conformance import SECOND, Found, Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.facts.dialects import Statement
    from analyzer.rules.catalogue import Page
    from dissectors.conformance import Severity, View

PAUSE = 10 * SECOND  # a run ends when this time passes without an occurrence
MOST_EXAMPLES = 20
MOST_RUNS = 100  # of one rule, node, type and key; later ones belong to the last
MOST_GROUPS = 4096  # of rule, node, type and key; what comes later is one finding a rule
RICH = 500  # runs with all their examples, the first ones in the capture; the others have one
KEPT = 4 * RICH  # runs whose examples are kept until it is known which ones are the first
FURTHER = "further"
FORCED = " (forced)"  # behind a choice that somebody insists on


class Key(NamedTuple):
    """What keeps findings apart. `node` is -1 and `type` empty for none."""

    rule: str
    severity: Severity
    bus: int
    node: int
    type: str
    key: str
    dialects: tuple[tuple[str, Severity | None], ...]


class Shown(NamedTuple):
    """One occurrence to show, ordered by place. `frames` are its evidence, numbers from 0."""

    t: int
    frame: int
    text: str
    cause: str
    frames: tuple[int, ...]
    lines: tuple[str, ...]


@dataclass(slots=True)
class Run:
    """Occurrences of one key without a pause of 10 s. Places are (t, frame)."""

    first: tuple[int, int]
    last: tuple[int, int]
    count: int
    examples: list[Shown] = field(default_factory=list)

    def take(self, other: Run) -> None:
        """Joins with another run of the same key."""
        self.first, self.last = min(self.first, other.first), max(self.last, other.last)
        self.count += other.count
        for example in other.examples:
            insort(self.examples, example)
        del self.examples[MOST_EXAMPLES:]


class Findings:
    """Adds up occurrences by rule, bus, node, type and key.

    Args:
        pages: the pages of the rules that are looked for; anything else is left out.
        severities: severities that stand instead of those of pages and occurrences.
    """

    def __init__(self, pages: Mapping[str, Page], severities: Mapping[str, Severity]) -> None:
        self._pages = pages
        self._severities = severities
        self._runs: dict[Key, list[Run]] = {}
        self._total = 0
        self.changes = 0  # how often something was added

    def add(self, found: Found | Occurrence, view: View, *, near_drops: Sequence[bool] | None = None) -> None:
        """Occurrences of one rule; `near_drops` marks those that lost frames may explain."""
        if found.rule not in self._pages:
            return
        if isinstance(found, Occurrence):
            self._add_one(found, view, bool(near_drops and near_drops[0]))
        elif len(found.t):
            self._add_many(found, view, near_drops)

    def results(self, readings: Iterable[Statement]) -> list[tuple[Key, Run]]:
        """Every run by place; what is no breach in the reading that its node turned out to use is left out.

        It may be asked for again after more has been added.
        """
        choices: dict[tuple[int, int], set[str]] = {}
        for one in readings:
            choices.setdefault((one.bus, one.node), set()).add(one.choice.removesuffix(FORCED))
        settled: dict[Key, list[Run]] = {}
        for key, runs in self._runs.items():
            severity: Severity | None = key.severity
            for choice, instead in key.dialects:
                if choice in choices.get((key.bus, key.node), ()):
                    severity = instead if instead is None else self._severities.get(key.rule, instead)
            if severity is not None:
                known = settled.setdefault(key._replace(severity=severity, dialects=()), [])
                for run in runs:
                    _merge(known, replace(run, examples=list(run.examples)))
        found = list(self._caused((key, run) for key, runs in settled.items() for run in runs))
        found.sort(key=lambda one: (one[1].first, one[0]))
        for _, run in found[RICH:]:
            del run.examples[1:]
        return found

    def _caused(self, found: Iterable[tuple[Key, Run]]) -> Iterator[tuple[Key, Run]]:
        """What another finding of the same node at that time is the cause of is a note that says so."""
        found = list(found)
        causes: dict[tuple[str, int, int], list[Run]] = {}
        wanted = {rule for page in self._pages.values() for rule in page.explained}
        for key, run in found:
            if key.rule in wanted and key.severity != "note":
                causes.setdefault((key.rule, key.bus, key.node), []).append(run)
        for key, run in found:
            because = [
                rule
                for rule in self._pages[key.rule].explained
                if any(_meets(cause, run) for cause in causes.get((rule, key.bus, key.node), ()))
            ]
            if not because or key.severity == "note" or key.rule in self._severities:
                yield key, run
                continue
            cause = f"{self._pages[because[0]].title} ({because[0]})"
            run.examples = [one._replace(cause=one.cause or cause) for one in run.examples]
            yield key._replace(severity="note"), run

    def _add_one(self, one: Occurrence, view: View, near_drops: bool) -> None:
        page = self._pages[one.rule]
        key = Key(
            one.rule, self._severity(one.rule, one.severity, near_drops), one.bus, -1 if one.node is None else one.node,
            one.type, page.key_of(one.values), tuple(one.dialects.items()),
        )  # fmt: skip
        place = (one.t, one.frames[0] if one.frames else -1)
        run = Run(place, place, 1)
        if not self._continues(key, run):
            cause = str(one.values.get("cause", ""))
            lines = one.lines or view.lines(one.frames)
            run.examples = [Shown(*place, page.say(one.values), cause, tuple(one.frames), lines)]
        self._put(key, run)

    def _add_many(self, found: Found, view: View, near_drops: Sequence[bool] | None) -> None:
        for rows, noted in _groups(found, near_drops):
            page = self._pages[found.rule]
            first = int(rows[0])
            key = Key(
                found.rule, self._severity(found.rule, found.severity, noted), int(found.bus[first]),
                int(found.node[first]), view.type_name(int(found.type[first])),
                page.key_of(found.values(first)) if page.key else "", tuple(found.dialects.items()),
            )  # fmt: skip
            t = found.t[rows]
            for piece in np.split(rows, np.flatnonzero(np.diff(t) > PAUSE) + 1):
                self._put(key, self._run(found, piece, key, view))

    def _run(self, found: Found, rows: Any, key: Key, view: View) -> Run:
        page = self._pages[key.rule]

        def place(row: int) -> tuple[int, int]:
            return int(found.t[row]), int(found.frame[row])

        def example(row: int) -> Shown:
            values, frames = found.values(row), tuple(found.frames(row))
            return Shown(*place(row), page.say(values), str(values.get("cause", "")), frames, view.lines(frames))

        run = Run(place(int(rows[0])), place(int(rows[-1])), len(rows))
        if not self._continues(key, run):
            most = MOST_EXAMPLES if self._total < KEPT else 1
            run.examples = [example(int(row)) for row in rows[:most]]
        return run

    def _continues(self, key: Key, run: Run) -> bool:
        """Whether it only goes on with a run that has all the examples it may have."""
        runs = self._runs.get(key)
        if not runs:
            return False
        last = runs[-1]
        return len(last.examples) == MOST_EXAMPLES and last.last <= run.first and _close(last, run)

    def _severity(self, rule: str, said: Severity | None, near_drops: bool) -> Severity:
        if rule in self._severities:
            return self._severities[rule]
        return "note" if near_drops else said or self._pages[rule].severity

    def _put(self, key: Key, run: Run) -> None:
        if key not in self._runs and len(self._runs) >= MOST_GROUPS:
            key = key._replace(bus=-1, node=-1, type="", key=FURTHER)
        self.changes += 1
        runs = self._runs.setdefault(key, [])
        self._total -= len(runs)
        _merge(runs, run)
        self._total += len(runs)


def _merge(runs: list[Run], run: Run) -> None:
    """Puts a run among others, in order of time; those without a pause between them become one."""
    at = bisect_left(runs, run.first, key=lambda one: one.first)
    runs.insert(at, run)
    if at and _close(runs[at - 1], run):
        runs[at - 1].take(run)
        del runs[at]
        at -= 1
    while at + 1 < len(runs) and _close(runs[at], runs[at + 1]):
        runs[at].take(runs.pop(at + 1))
    if len(runs) > MOST_RUNS:
        last = runs.pop()
        runs[-1].take(last)


def _meets(one: Run, other: Run) -> bool:
    """Whether two runs are at the same time, or nearly."""
    return max(one.first[0], other.first[0]) - min(one.last[0], other.last[0]) <= PAUSE


def _close(one: Run, after: Run) -> bool:
    return after.first[0] - one.last[0] <= PAUSE


def _groups(found: Found, near_drops: Sequence[bool] | None) -> Iterator[tuple[Any, bool]]:
    """Rows that belong to one key each, in order of place, and whether lost frames may explain them."""
    code = found.bus.astype(np.int64) << 9 | (found.node.astype(np.int64) + 1)
    code = code * (1 << 34) + found.type.astype(np.int64)
    if near_drops is not None:
        code = code * 2 + np.asarray(near_drops, np.int64)
    parts = [found.frame, found.t, code]
    if found.key is not None:
        parts.insert(2, np.unique(found.key, return_inverse=True)[1])
    order = np.lexsort(parts)
    changed = np.zeros(len(order) - 1, bool)
    for part in parts[2:]:
        changed |= np.diff(part[order]) != 0
    for rows in np.split(order, np.flatnonzero(changed) + 1):
        yield rows, bool(near_drops is not None and near_drops[int(rows[0])])
