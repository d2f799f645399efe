"""Runs cases: kinds in turn, each with a seed of its own."""

from __future__ import annotations

import sys
from random import Random
from typing import TYPE_CHECKING, Any

from bench.outside.flight import Flight
from bench.outside.in_devices import DEVICES
from bench.outside.in_dialogue import DIALOGUE
from bench.outside.in_frames import FRAMES
from bench.outside.in_transfers import TRANSFERS
from bench.outside.in_values import VALUES
from bench.outside.innocent import OF_CAPTURES, OF_FLIGHTS
from bench.outside.kinds import Score, said, score
from bench.outside.trace import Trace

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

from bench.outside.kinds import Case, Kind

HALVES = {
    "Transport faults": {**FRAMES, **TRANSFERS, **OF_CAPTURES},
    "Values and devices": {**VALUES, **DEVICES, **DIALOGUE, **OF_FLIGHTS},
}
ESCS = (4, 6, 5, 8)
TRIES = 8  # places in one capture at which a kind looks for its occasion


def run(
    captures: Sequence[Path], cases: int, seed: int, words: Sequence[str], escs: Sequence[int] = ESCS
) -> Iterator[tuple[str, dict[str, Score]]]:
    """Each half with its title."""
    for title, kinds in HALVES.items():
        mine = [kind for name, kind in kinds.items() if any(word in name for word in words)]
        if mine:
            sources = [Trace(path) for path in captures] if title == "Transport faults" else [Flight(n) for n in escs]
            yield title, tried(mine, sources, cases, seed)


def tried(kinds: list[Kind], sources: Sequence[Any], cases: int, seed: int) -> dict[str, Score]:
    """So many cases, which go through all kinds and sources; a source that gives no occasion is left out."""
    usual = [said(source.text) for source in sources]
    scores = {kind.name: Score() for kind in kinds}
    for number in range(cases):
        kind, turn = kinds[number % len(kinds)], seed + number // len(kinds)
        for more in range(len(sources)):
            which = (turn + number + more) % len(sources)
            case = occasion(kind, sources[which], Random(f"{kind.name} {turn}"))
            if case is not None:
                result = score(kind, case, usual[which])
                scores[kind.name].add(result)
                sys.stdout.writelines(f"{kind.name}: {line}\n" for line in result.trouble())
                sys.stdout.flush()
                break
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{number + 1} of {cases}")
    return scores


def occasion(kind: Kind, source: Any, rng: Random) -> Case | None:
    """A case, if the source has an occasion for it."""
    for _ in range(TRIES):
        try:
            return kind.make(source, rng)
        except LookupError:
            continue
    return None
