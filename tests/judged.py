"""What the rules say of a capture given as candump text, in any batch size."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import dissectors
from analyzer.engine import Engine
from analyzer.rules.catalogue import load, matching
from analyzer.rules.judge import Judge, Outcome
from analyzer.rules.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.engine import Batch
    from dissectors.registry import Registry


Rules = tuple[str, ...] | None


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


def outcome(text: str | bytes, rules: Rules = None, step: int | None = None, **settings: Any) -> Outcome:
    """`rules` selects as on the command line, `step` cuts the text into batches of so many lines."""
    pages = load(registry())
    chosen = Settings(select=None if rules is None else matching(rules, pages), **settings)
    judge, engine = Judge(registry(), chosen), Engine(registry())
    for batch in _batches(engine, text.encode() if isinstance(text, str) else text, step):
        judge.feed(batch)
    return judge.finish()


def judge(text: str | bytes, rules: Rules = None, step: int | None = None, **settings: Any) -> list[Said]:
    """What it found, by place."""
    return [
        Said(
            key.rule, key.severity, key.bus, key.node, key.type, key.key, run.count, run.first[1] + 1, run.last[1] + 1,
            run.examples[0].text, tuple(example.frame + 1 for example in run.examples), run.examples[0].cause,
        )
        for key, run in outcome(text, rules, step, **settings).runs
    ]  # fmt: skip


def whole(text: str | bytes, rules: Rules = None, steps: tuple[int, ...] = (1, 7), **settings: Any) -> list[Said]:
    """What it found, which must be the same in batches of so many lines."""
    found = judge(text, rules, **settings)
    for step in steps:
        assert judge(text, rules, step, **settings) == found
    return found


def _batches(engine: Engine, text: bytes, step: int | None) -> Iterator[Batch]:
    if step is None:
        yield from engine.run([text])
        return
    lines = text.splitlines(keepends=True)
    for at in range(0, len(lines), step):
        yield from engine.feed(b"".join(lines[at : at + step]))
        yield engine.flush()
    yield engine.finish()
