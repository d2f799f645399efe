"""What the rules say of a capture, and whether the witness finds the same in its bytes.

A capture is given as candump text.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import crc32

from hypothesis import settings
from witness import finder
from witness.reader import Log

import dissectors
from analyzer.decode.engine import Engine
from analyzer.rules.catalogue import load, matching
from analyzer.rules.judge import Judge, Outcome
from analyzer.rules.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.decode.engine import Batch
    from dissectors.registry import Registry

Rules = tuple[str, ...] | None
MOST_CUTS = 30


class Said(NamedTuple):
    """One finding. Frames are numbered from 1; `frames` are the places of its examples."""

    rule: str
    severity: str
    bus: int
    node: int
    type: str
    key: str
    count: int
    first: int
    last: int
    text: str
    frames: tuple[int, ...]
    cause: str


@cache
def registry() -> Registry:
    return dissectors.load()


def outcome(text: str | bytes, rules: Rules = None, step: int | None = None, **how: Any) -> Outcome:
    """`rules` selects as on the command line, `step` cuts the text into batches of so many lines."""
    pages = load(registry())
    chosen = Settings(select=None if rules is None else matching(rules, pages), **how)
    judge, engine = Judge(registry(), chosen), Engine(registry(), chosen.dialects)
    for batch in _batches(engine, text.encode() if isinstance(text, str) else text, step):
        judge.feed(batch)
    return judge.finish()


def judge(text: str | bytes, rules: Rules = None, step: int | None = None, **how: Any) -> list[Said]:
    """What it found, by place."""
    return [
        Said(
            key.rule, key.severity, key.bus, key.node, key.type, key.key, run.count, run.first[1] + 1, run.last[1] + 1,
            run.text or run.examples[0].text, tuple(one.frame + 1 for one in run.examples), run.examples[0].cause,
        )
        for key, run in outcome(text, rules, step, **how).runs
    ]  # fmt: skip


def said(rule: str, text: str | bytes, step: int | None = None) -> list[Said]:
    """What one rule says, in the order of places."""
    return judge(text, (rule,), step)


def whole(text: str | bytes, rules: Rules = None, steps: tuple[int, ...] = (1, 7), **how: Any) -> list[Said]:
    """What it found, which must be the same in batches of so many lines, as `cuts` has them."""
    found = judge(text, rules, **how)
    for step in steps:
        assert judge(text, rules, step, **how) == found
    return found


def _batches(engine: Engine, text: bytes, step: int | None) -> Iterator[Batch]:
    if step is None:
        yield from engine.run([text])
        return
    lines = text.splitlines(keepends=True)
    for begin, end in pairwise([0, *cuts(text, len(lines), step), len(lines)]):
        yield from engine.feed(b"".join(lines[begin:end]))
        yield engine.flush()
    yield engine.finish()


def cuts(text: bytes, lines: int, step: int) -> Sequence[int]:
    """Where a text is cut: behind every so many lines, or at `MOST_CUTS` of these places in the fast run.

    They follow each other; where they begin, the text itself decides, so that other texts are cut elsewhere.
    """
    places = range(step, lines, step)
    spare = len(places) - MOST_CUTS
    if spare <= 0 or settings.get_current_profile_name() == "all":
        return places
    begin = crc32(text) % (spare + 1)
    return places[begin : begin + MOST_CUTS]


MOST_EXAMPLES = 20  # of a finding
STEP = 401  # lines of a batch


def exact(rule: str, text: str, step: int = STEP) -> list[Said]:
    """The findings of a rule: an occurrence where each proof begins, and no other."""
    said, proofs = whole(text, (rule,), (step,)), _proofs(rule, text)
    begin = sorted(min(proof) for proof in proofs)
    assert sum(one.count for one in said) == len(begin)
    assert sorted(frame for one in said for frame in one.frames) == begin[:MOST_EXAMPLES]
    return said


def proved(rule: str, text: str, step: int = STEP) -> list[Said]:
    """The findings of a rule: each of their places lies in a proof, and each proof has a place in it."""
    said = whole(text, (rule,), (step,))
    _meet([{frame} for one in said for frame in one.frames], _proofs(rule, text))
    return said


def agree(rule: str, text: str) -> None:
    """The evidence of each occurrence has a frame of a proof, and each proof has a frame in evidence."""
    runs = [run for key, run in outcome(text, (rule,)).runs if key.rule == rule]
    _meet([{frame + 1 for frame in example.frames} for run in runs for example in run.examples], _proofs(rule, text))
    assert whole(text, (rule,), (41,))


def _proofs(rule: str, text: str) -> list[set[int]]:
    proofs = [set(proof) for proof in finder(rule)(Log(text))]
    assert proofs
    return proofs


def _meet(shown: list[set[int]], proofs: list[set[int]]) -> None:
    assert all(any(frames & proof for proof in proofs) for frames in shown)
    assert all(any(frames & proof for frames in shown) for proof in proofs)
