"""Statistics of batches that the engine has made of text, however that is cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from analyzer.facts.traffic import times
from analyzer.filter import compile_filter
from analyzer.stats.catalogue import statistics
from analyzer.stats.chosen import Chooser, frame_rows
from analyzer.stats.statistic import StatEnd

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.stats.table import StatTable
    from dissectors import Registry


@pytest.fixture
def tables(decode: Callable[..., Any], registry: Registry) -> Callable[..., dict[str, StatTable]]:
    """Gives tables by name: of chunks of candump text, for statistics, and perhaps a filter."""

    def run(*chunks: Any, names: list[str], where: str = "") -> dict[str, StatTable]:
        got = decode(*chunks)

        def matcher(text: str) -> Any:
            both = " && ".join(f"({one})" for one in (where, text) if one)
            return compile_filter(both, registry).matcher(frame_list=True)

        made = statistics(names, registry, 1_000_000, matcher, filtered=bool(where))
        chooser = Chooser(matcher("") if where else None)
        parts = list(dict.fromkeys(part for one in made for part in (*one.parts, one)))
        start = end = None
        for batch in got.batches:
            t, timed = times(batch.frames) if len(batch.frames) else ([], None)
            if timed is not None and timed.any():
                start = min(int(t[timed].min()), start if start is not None else 1 << 62)
                end = max(int(t[timed].max()), end or 0)
            chosen = chooser.feed(batch, frame_rows(batch))
            for part in parts:
                part.feed(chosen)
        ended = StatEnd(registry, got.engine, [], 1_000_000, start, end)
        return {table.name: table for one in made for table in one.finish(ended)}

    return run
