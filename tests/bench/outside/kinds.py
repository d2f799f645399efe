"""Kinds of faults with what must be said of each, and the score of what was said.

An expectation is written by hand from the document (TM-UAVCAN V2.2), ISO 11898 and the DroneCAN specification, and
names no more than codes of rules: `needs` tell the cause ("A|B" is one of both, all words are needed), `also` is what
else the same fault explains. "TRF-*" is every rule of a layer, "TRF-005:note" only a note of that rule. What needs
nothing is no fault, but looks like one: then nothing may be said.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from fnmatch import fnmatch
from typing import TYPE_CHECKING, Any

from kit.judged import outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from random import Random

# Where one of two nodes fails, the other one is named: who asked, who commands, who has the ESC with that number.
RELATED = {"PUSH-102", "PUSH-201", "PUSH-304", "BUS-007", "BUS-011", "BUS-012", "BUS-013", "BUS-027", "TYP-103"}
Said = tuple[str, str, int, str, str]  # rule, severity, node, type, key


@dataclass(frozen=True, slots=True)
class Case:
    """A faulted capture: its text, and the nodes of which the fault can make findings (none: of the bus alone)."""

    text: str
    nodes: frozenset[int]
    about: str = ""


@dataclass(frozen=True, slots=True)
class Kind:
    """`make` returns None where a capture has no occasion; `says` must be in the text of a finding of `needs`."""

    name: str
    needs: tuple[str, ...]
    also: tuple[str, ...]
    says: str
    make: Callable[[Any, Random], Case | None]


@dataclass(slots=True)
class Score:
    """Of one kind. `wrong` are findings that the fault does not explain."""

    cases: int = 0
    found: int = 0
    cause: int = 0
    wrong: Counter[str] = field(default_factory=Counter)
    missed: list[str] = field(default_factory=list)

    def add(self, other: Score) -> None:
        self.cases += other.cases
        self.found += other.found
        self.cause += other.cause
        self.wrong += other.wrong
        self.missed += other.missed

    def trouble(self) -> Iterator[str]:
        yield from self.missed
        yield from (f"not explained: {text}" for text in self.wrong)


class Kinds(dict[str, Kind]):
    """A register of kinds."""

    def kind(self, name: str, needs: str, also: str = "", says: str = "") -> Callable[[Any], Any]:
        def register(make: Any) -> Any:
            assert name not in self, name
            self[name] = Kind(name, tuple(needs.split()), tuple(also.split()), says, make)
            return make

        return register


def said(text: str) -> dict[Said, tuple[int, str]]:
    """How often each finding is, and its texts, with the rules that are on by default."""
    found: dict[Said, tuple[int, str]] = {}
    for key, run in outcome(text, None, bit_rate=1_000_000).runs:
        name = (key.rule, key.severity, key.node, key.type, key.key)
        times, texts = found.get(name, (0, ""))
        found[name] = times + run.count, "\n".join([texts, run.text, *(one.text for one in run.examples)])
    return found


def matches(key: Said, wanted: Iterable[str]) -> bool:
    """Whether one of `wanted` names it, "A|B" and "TRF-*" among them."""
    names = key[0], f"{key[0]}:{key[1]}"
    return any(fnmatch(name, one) for word in wanted for one in word.split("|") for name in names)


def score(kind: Kind, case: Case, usual: dict[Said, tuple[int, str]]) -> Score:
    """What was said of a case beside what the same capture says without its fault."""
    now, result = said(case.text), Score(cases=1)
    news = {key: text for key, (times, text) in now.items() if key not in usual or times > usual[key][0]}
    mine = {key: text for key, text in news.items() if key[2] in {-1, *case.nodes} or key[0] in RELATED}
    result.found = int(bool(mine) or not kind.needs)
    told = all(any(matches(key, [need]) for key in mine) for need in kind.needs)
    if told and kind.says:
        told = any(re.search(kind.says, text) for key, text in mine.items() if matches(key, kind.needs))
    result.cause = int(told)
    if not told:
        result.missed.append(f"wrong cause: {case.about}: said {sorted({key[0] for key in news}) or 'nothing'}")
    for key in news:
        if key not in usual and not (matches(key, kind.needs + kind.also) and key in mine):
            result.wrong[f"{key[0]} ({key[1]}, node {key[2]}, {key[3]}) in {case.about}"] += 1
    return result


def table(scores: dict[str, Score], *, each: bool) -> Iterator[str]:
    """Markdown, a row for each kind or one for all."""
    yield "| Kind | Cases | Recall | Right cause | Not explained |"
    yield "|---|---:|---:|---:|---:|"
    whole = Score()
    for name, one in scores.items():
        whole.add(one)
        if each:
            yield row(name, one)
    yield row("all", whole)


def row(name: str, one: Score) -> str:
    cases = one.cases or 1
    return f"| {name} | {one.cases} | {one.found / cases:.1%} | {one.cause / cases:.1%} | {one.wrong.total()} |"
