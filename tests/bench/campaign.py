"""Flights with one fault each, over all errors and warnings: what the rules find, and what they should not have.

    python tests/bench/campaign.py [--captures 3000] [--rules TRF,PUSH-005] [--seed 1] [--workers 2] [--each]

Every flight is judged with all rules. The fault must be found where the answer key says it is (recall); every other
error or warning must be one that the key or the page of the rule allows for the same cause, or that the flight shows
without the fault, too (precision). Exit status 1 if a fault is missed or a protocol error is false.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analyzer.rules.catalogue import load, matching
from analyzer.simulate.faults import catalogue

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit.judged import outcome, registry
from kit.simulated import Flown, simulation

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun

SECONDS = 6.0
BIT_RATE = 1_000_000
# Where a fault finds no occasion in one flight, the next one may have it.
FLIGHTS: tuple[dict[str, Any], ...] = (
    {"flight": "hover"}, {"flight": "mission"}, {"flight": "bench"}, {"flight": "hover", "seconds": 20.0},
    {"flight": "bench", "seconds": 20.0}, {"flight": "startup"},
)  # fmt: skip
Trouble = tuple[str, str, int]  # rule, severity, node


@dataclass(slots=True)
class Score:
    """Of one rule. `false` are other findings that nothing allows, `errors` those of them that are protocol errors."""

    captures: int = 0
    found: int = 0
    false: int = 0
    errors: int = 0
    missed: list[str] = field(default_factory=list)
    wrong: Counter[str] = field(default_factory=Counter)

    def add(self, other: Score) -> None:
        """Adds up."""
        self.captures += other.captures
        self.found += other.found
        self.false += other.false
        self.errors += other.errors
        self.missed += other.missed
        self.wrong += other.wrong

    @property
    def recall(self) -> float:
        """Share of the faults that were found."""
        return self.found / self.captures if self.captures else 0.0

    @property
    def precision(self) -> float:
        """Share of right ones among all findings that a fault brought about."""
        return self.found / (self.found + self.false) if self.found + self.false else 0.0


@cache
def pages() -> dict[str, Page]:
    return load(registry())


def rules() -> list[str]:
    """The errors and warnings that the simulator can bring about."""
    return [rule for rule in catalogue.faults() if pages()[rule].severity != "note"]


def fly(*orders: str, seed: int, which: int) -> tuple[str, list[dict[str, Any]]]:
    """A flight as candump text, and the answers to its faults."""
    more = {"seconds": SECONDS, **FLIGHTS[which]}
    made = Flown(simulation(seed=seed, orders=orders, **more))
    return made.text, made.simulation.key()["faults"]


def worst(runs: Iterable[tuple[FindingKey, OccurrenceRun]]) -> Iterator[tuple[FindingKey, OccurrenceRun]]:
    return ((key, run) for key, run in runs if key.severity != "note")


@lru_cache(maxsize=256)
def usual(seed: int, which: int) -> frozenset[Trouble]:
    """What a flight shows without a fault."""
    found = outcome(fly(seed=seed, which=which)[0], ("all",), bit_rate=BIT_RATE).runs
    return frozenset((key.rule, key.severity, key.node) for key, _ in worst(found))


def flown(rule: str, seed: int) -> tuple[str, dict[str, Any], int]:
    """A flight with one such fault, its answer, and which of `FLIGHTS` it is."""
    for k in range(len(FLIGHTS)):
        which = (seed + k) % 3 if k < 3 else k
        text, answers = fly(rule, seed=seed, which=which)
        answer = next((one for one in answers if one["rule"] == rule), None)
        if answer is not None:
            return text, answer, which
    raise LookupError(f"no flight has an occasion for {rule}, seed {seed}")


def tried(job: tuple[str, int]) -> tuple[str, Score]:
    """One capture."""
    rule, seed = job
    text, answer, which = flown(rule, seed)
    runs = outcome(text, ("all",), bit_rate=BIT_RATE).runs
    score = Score(captures=1)
    if any(key.rule == rule and shows(run, answer) for key, run in runs):
        score.found = 1
    else:
        score.missed.append(f"{rule} seed {seed} {FLIGHTS[which]}")
    allowed = {rule, *answer["also"], *pages()[rule].body.get("also", ())}
    for key, _ in worst(runs):
        if key.rule not in allowed and (key.rule, key.severity, key.node) not in usual(seed, which):
            score.false += 1
            score.errors += key.severity == "error" and pages()[key.rule].category == "protocol"
            score.wrong[f"{key.rule} ({key.severity}) for {rule}"] += 1
    return rule, score


def shows(run: OccurrenceRun, answer: dict[str, Any]) -> bool:
    """Whether a finding is about the frames of an answer, or about the time of a silence."""
    frames = {number - 1 for number in answer["frames"]}
    if any(frames & {*example.frames, example.frame} for example in run.examples):
        return True
    return run.first[0] <= answer["t_end_ns"] + 3 * 10**9 and run.last[0] >= answer["t_ns"] - 10**9


def run(wanted: list[str], captures: int, seed: int, workers: int) -> dict[str, Score]:
    """Scores by rule, `captures` in all."""
    jobs = [(wanted[k % len(wanted)], seed + k // len(wanted)) for k in range(captures)]
    scores = {rule: Score() for rule in wanted}
    with get_context("spawn").Pool(workers) as pool:
        for done, (rule, score) in zip(count(1), pool.imap_unordered(tried, jobs, chunksize=4), strict=False):
            scores[rule].add(score)
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{done} of {len(jobs)}")
    return scores


def table(scores: dict[str, Score], *, each: bool) -> Iterator[str]:
    """Markdown: a row for each layer, or for each rule."""
    yield "| Rules | Captures | Recall | Precision | False protocol errors |"
    yield "|---|---:|---:|---:|---:|"
    groups: dict[str, Score] = {}
    for rule, score in scores.items():
        for name in (rule if each else rule.partition("-")[0], "all"):
            groups.setdefault(name, Score()).add(score)
    whole = groups.pop("all", Score())
    for name, score in [*groups.items(), ("all", whole)]:
        yield f"| {name} | {score.captures} | {score.recall:.1%} | {score.precision:.1%} | {score.errors} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=3000)
    parser.add_argument("--rules", default="all", help="rules or layers, with commas between them")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--each", action="store_true", help="a row for each rule")
    args = parser.parse_args()
    chosen = matching(args.rules.split(","), pages())
    scores = run([rule for rule in rules() if rule in chosen], args.captures, args.seed, args.workers)
    report = [*table(scores, each=args.each)]
    report += [f"missed: {missed}" for score in scores.values() for missed in score.missed]
    wrong = sum((score.wrong for score in scores.values()), Counter())
    report += [f"not allowed: {text}, {times}x" for text, times in wrong.most_common()]
    sys.stdout.write("\n".join(report) + "\n")
    return int(any(score.missed or score.errors for score in scores.values()))


if __name__ == "__main__":
    sys.exit(main())
