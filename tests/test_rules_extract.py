"""Parts of a capture that show a finding: each is judged alone, and has little else in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from command import CAPTURES
from judged import judge, outcome, registry

from analyzer.rules.extract import Wanted, extracts, shows
from analyzer.rules.settings import Settings
from analyzer.sources import Source
from analyzer.sources.native import rows
from dissectors.conformance import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from analyzer._native import Piece

FAULTS = CAPTURES / "mission-8-faults.log"


def pieces(path: Path) -> Iterator[Piece]:
    return (piece for piece in rows(Source(str(path)).chunks()) if not isinstance(piece, bytes))


def found(path: Path, rule: str, *, timed: bool = True) -> Wanted:
    """The first finding of a rule."""
    key, run = outcome(path.read_bytes(), (rule,)).runs[0]
    t, frame = run.first
    t = t if timed else NO_TIME
    return Wanted(rule, key.severity, "can0", None if key.node < 0 else key.node, key.type, (frame + 1,), t, t)


@pytest.mark.parametrize("rule", ["CAN-002", "TRF-003", "TRF-010", "TYP-302", "PUSH-005"])
def test_a_part_shows_the_finding_and_is_much_smaller(rule: str) -> None:
    wanted = found(FAULTS, rule)
    (part,) = extracts([wanted], lambda: pieces(FAULTS), registry(), Settings())
    assert part.shown
    assert part.wanted is wanted
    assert (wanted.rule, wanted.severity) in {(one.rule, one.severity) for one in judge(part.text, (rule,))}
    assert part.text.count(b"\n") == part.frames
    assert len(part.text) * 20 < FAULTS.stat().st_size
    assert set(part.text.splitlines()) <= set(FAULTS.read_bytes().splitlines())


def test_what_needs_a_history_gets_it() -> None:
    (small,) = extracts([found(FAULTS, "CAN-002")], lambda: pieces(FAULTS), registry(), Settings())
    (large,) = extracts([found(FAULTS, "TRF-016")], lambda: pieces(FAULTS), registry(), Settings())
    assert small.frames == 1
    assert large.shown
    assert large.frames > 1000, "in its first 2 s a capture says nothing of missing transfers"


def test_without_times_frames_are_counted() -> None:
    (part,) = extracts([found(FAULTS, "TRF-010", timed=False)], lambda: pieces(FAULTS), registry(), Settings())
    assert part.shown
    assert part.frames <= 101


def test_many_at_once_give_what_each_gives_alone() -> None:
    wanted = [found(FAULTS, rule) for rule in ("TRF-003", "TRF-010", "TYP-302", "PUSH-005")] * 5
    alone = {one.rule: next(extracts([one], lambda: pieces(FAULTS), registry(), Settings())).text for one in wanted[:4]}
    parts = list(extracts(wanted, lambda: pieces(FAULTS), registry(), Settings()))
    assert len(parts) == 20
    assert all(part.text == alone[part.wanted.rule] for part in parts)


def test_what_is_not_there_is_not_shown() -> None:
    wanted = Wanted("TRF-010", "error", "can0", 99, "ESCStatus", (5000,), NO_TIME, NO_TIME)
    (part,) = extracts([wanted], lambda: pieces(FAULTS), registry(), Settings())
    assert not part.shown
    assert not shows(wanted, FAULTS.read_bytes(), registry(), Settings())
