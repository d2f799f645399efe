"""Thousands of simulated flights, each judged by a function: how often is the verdict right, unknown or wrong?

    python tests/bench/triage_campaign.py --judge MODULE:FUNCTION [--seeds 1400] [--first 100000] [--jobs 2]
        [--families desync,tree] [--sample 60 [--turn 7]] [--cases cases.jsonl] [--each]

The function takes the path of a capture and returns (kind, nodes, channels), or that with the two times in ns between
which it began. Families and variants (tail, twin, distractors, firmware, report rates, ESC counts, standard dialect,
recordings that begin in the air) follow from the seed alone. `--sample` tries so many seeds evenly out of all, each
`--turn` others. Exit status 1 if a goal is missed: 97 % right (or `unknown` where the key says so), at most 1 %
wrong, 97 % of first events right, nothing healthy called faulty. Of a sample of few shares say nothing: its goal is
that nothing is wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from math import gcd
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults import catalogue

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.triage_cases import Answer, Case, Score, case, score

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

RIGHT, WRONG, FIRST = 0.97, 0.01, 0.97
OUTCOMES = ("right", "unknown", "wrong")
SHOWN = 20


@dataclass(frozen=True, slots=True)
class Judged:
    """A case, what its key says, and what was said of it; `error` if the judge failed."""

    case: Case
    cause: dict[str, Any]
    knowable: list[str]
    first_event: dict[str, Any] | None
    answer: Answer
    score: Score
    error: str = ""


@cache
def named(text: str) -> Callable[[Path], Sequence[Any]]:
    """The function that MODULE:FUNCTION names."""
    module, _, function = text.partition(":")
    found: Callable[[Path], Sequence[Any]] = getattr(import_module(module), function)
    return found


def tried(job: tuple[Case, str]) -> Judged:
    """One capture, which lies alone in its folder: nothing beside it tells the answer."""
    one, judge = job
    text, story = one.made()
    error = ""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "crash.log"
        path.write_text(text)
        try:
            answer = Answer.of(named(judge)(path))
        except Exception as failure:  # noqa: BLE001 - any way to fail is a wrong answer
            answer, error = Answer("error"), repr(failure)
    return Judged(one, story["cause"], story["knowable"], story["first_event"], answer, score(story, answer), error)


def seeds(first: int, count: int, sample: int, turn: int) -> list[int]:
    """All of them, or a sample of every family's that each turn shifts."""
    if not sample or sample >= count:
        return list(range(first, first + count))
    return sorted({first + (turn * sample + k) * _stride(count) % count for k in range(sample)})


def _stride(count: int) -> int:
    """A step that comes to every seed before it comes to one again, and never to the same few families."""
    return next(step for step in range(round(count * 0.618), count + 2) if gcd(step, count) == 1)


def run(cases: list[Case], judge: str, jobs: int) -> Iterator[Judged]:
    """Judged cases in their order."""
    work = [(one, judge) for one in cases]
    if jobs == 1:
        yield from map(tried, work)
        return
    with get_context("spawn").Pool(jobs) as pool:
        for done, found in enumerate(pool.imap(tried, work, chunksize=2), 1):
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{done} of {len(work)}")
            yield found


def matrix(found: Iterable[Judged]) -> Iterator[str]:
    """A row for each cause, a column for each first verdict."""
    cells = Counter((one.cause["kind"], one.answer.kind) for one in found)
    rows = sorted({cause for cause, _ in cells})
    columns = sorted({said for _, said in cells})
    yield f"{'cause':16}" + "".join(f"{name[:13]:>14}" for name in columns)
    for row in rows:
        yield f"{row:16}" + "".join(f"{cells[row, name] or '.':>14}" for name in columns)


def shares(name: str, found: Sequence[Judged]) -> str:
    """One line: how many, and the share of each outcome."""
    outcomes = Counter(one.score.outcome for one in found)
    return f"{name:20}{len(found):>7}" + "".join(f"{outcomes[outcome] / len(found):>10.1%}" for outcome in OUTCOMES)


def groups(found: Sequence[Judged], of: Callable[[Judged], Iterable[str]]) -> Iterator[str]:
    """A line for each group that a case belongs to."""
    members: dict[str, list[Judged]] = {}
    for one in found:
        for name in of(one):
            members.setdefault(name, []).append(one)
    for name in sorted(members):
        yield shares(name, members[name])


def report(found: Sequence[Judged], *, each: bool, sampled: bool = False) -> tuple[list[str], bool]:
    """The text, and whether all goals are met; those of a sample are that no verdict is wrong."""
    count, outcomes = len(found), Counter(one.score.outcome for one in found)
    timed = [one.score.first for one in found if one.score.first is not None]
    blamed = [one for one in found if one.score.healthy_blamed]
    healthy = sum(one.cause["kind"] == "none" for one in found)
    head = f"{'':20}{'cases':>7}" + "".join(f"{outcome:>10}" for outcome in OUTCOMES)
    lines = [*matrix(found), "", head, *groups(found, lambda one: (one.case.family,)), ""]
    lines += [*groups(found, lambda one: one.case.variants), "", shares("all", found)]
    honest = sum(one.score.outcome == "right" and one.answer.kind == "unknown" for one in found)
    lines.append(f"of the right ones an honest unknown: {honest}")
    lines.append(f"first event right: {sum(timed)} of {len(timed)} that were told")
    lines.append(f"healthy called faulty: {len(blamed)} of {healthy}")
    bad = [one for one in found if one.score.outcome == "wrong" or one.score.first is False]
    for one in bad if each else bad[:SHOWN]:
        told = one.error or f"{one.answer.kind} {list(one.answer.nodes)} {list(one.answer.channels)}"
        what = "wrong" if one.score.outcome == "wrong" else "first event"
        lines.append(f"{what}: {told}; {one.cause['kind']} {one.cause['channels']}: {one.case.command}")
    if sampled:
        return lines, not outcomes["wrong"]
    met = (
        outcomes["right"] >= RIGHT * count
        and outcomes["wrong"] <= WRONG * count
        and sum(timed) >= FIRST * len(timed)
        and not blamed
    )
    return lines, met


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--judge", required=True, metavar="MODULE:FUNCTION")
    parser.add_argument("--seeds", type=int, default=1400)
    parser.add_argument("--first", type=int, default=100_000, help="the first seed; rules are written with others")
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--turn", type=int, default=0)
    parser.add_argument("--families", default="", help="with commas between them; default: all")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cases", type=Path, help="write key and verdict of each case there, a line of JSON each")
    parser.add_argument("--each", action="store_true", help="list every case that is wrong")
    args = parser.parse_args(argv)
    families = args.families.split(",") if args.families else list(catalogue.stories())
    for name in families:
        catalogue.scenario(name)
    wanted = [case(seed, families) for seed in seeds(args.first, args.seeds, args.sample, args.turn)]
    found = list(run(wanted, args.judge, args.jobs))
    if args.cases:
        args.cases.write_text("".join(json.dumps(asdict(one)) + "\n" for one in found))
    lines, met = report(found, each=args.each, sampled=0 < args.sample < args.seeds)
    sys.stdout.write("\n".join(lines) + "\n")
    return int(not met)


if __name__ == "__main__":
    sys.exit(main())
