"""Parts of a capture that show a finding: each is judged alone, and has little else in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES
from kit.judged import judge, outcome, registry

from analyzer.rules.catalogue import load
from analyzer.rules.extract.search import WantedFinding, extracts
from analyzer.rules.settings import Settings
from analyzer.sources import Source
from analyzer.sources.native import rows
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from analyzer._native import FrameBatch

FAULTS = CAPTURES / "mission-8-faults.log"


def pieces(path: Path) -> Iterator[FrameBatch]:
    return (piece for piece in rows(Source(str(path)).chunks()) if not isinstance(piece, bytes))


def found(path: Path, rule: str, *, timed: bool = True) -> WantedFinding:
    """The first finding of a rule."""
    key, run = outcome(path.read_bytes(), (rule,)).runs[0]
    t, frame = run.first
    t = t if timed else NO_TIME
    return WantedFinding(rule, key.severity, "can0", None if key.node < 0 else key.node, key.type, (frame + 1,), t, t)


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["CAN-002", "TRF-003", "TRF-010", "TYP-302", "PUSH-005"])
def test_a_part_shows_the_finding_and_is_much_smaller(rule: str) -> None:
    wanted = found(FAULTS, rule)
    (part,) = extracts([wanted], lambda: pieces(FAULTS), registry(), Settings())
    assert part.shown
    assert part.wanted is wanted
    assert (wanted.rule, wanted.severity) in {(one.rule, one.severity) for one in judge(part.text, (rule,))}
    assert part.text.count(b"\n") == part.lines
    assert len(part.text) * 20 < FAULTS.stat().st_size
    assert set(part.text.splitlines()) <= set(FAULTS.read_bytes().splitlines())


@pytest.mark.slow
def test_what_needs_a_history_gets_it() -> None:
    (small,) = extracts([found(FAULTS, "CAN-002")], lambda: pieces(FAULTS), registry(), Settings())
    (large,) = extracts([found(FAULTS, "TRF-016")], lambda: pieces(FAULTS), registry(), Settings())
    assert small.lines == 1
    assert large.shown
    assert 3 < large.lines < 30
    first, *_, last = (float(line[1 : line.index(b")")]) for line in large.text.splitlines())
    assert last - first > 2, "in its first 2 s a capture says nothing of missing transfers"


@pytest.mark.slow
def test_without_times_frames_are_counted() -> None:
    (part,) = extracts([found(FAULTS, "TRF-010", timed=False)], lambda: pieces(FAULTS), registry(), Settings())
    assert part.shown
    assert part.lines <= 101


@pytest.mark.slow
def test_many_at_once_give_what_each_gives_alone() -> None:
    wanted = [found(FAULTS, rule) for rule in ("TRF-003", "TRF-010", "TYP-302", "PUSH-005")] * 5
    alone = {one.rule: next(extracts([one], lambda: pieces(FAULTS), registry(), Settings())).text for one in wanted[:4]}
    parts = list(extracts(wanted, lambda: pieces(FAULTS), registry(), Settings()))
    assert len(parts) == 20
    assert all(part.text == alone[part.wanted.rule] for part in parts)


def test_what_is_not_there_is_not_shown() -> None:
    wanted = WantedFinding("TRF-010", "error", "can0", 99, "ESCStatus", (5000,), NO_TIME, NO_TIME)
    (part,) = extracts([wanted], lambda: pieces(FAULTS), registry(), Settings())
    assert not part.shown


@pytest.mark.slow
def test_what_another_rule_excuses_is_judged_by_all_of_them() -> None:
    """A second device behind a node ID turns much of what follows into notes, but only if it is looked for."""
    path = CAPTURES / "duplicate-node.log"
    runs = outcome(path.read_bytes(), tuple(load(registry()))).runs
    key, run = next((key, run) for key, run in runs if (key.rule, key.severity) == ("TYP-502", "note"))
    t, number = run.first
    wanted = WantedFinding(key.rule, key.severity, "can0", key.node, key.type, (number + 1,), t, t)
    (part,) = extracts([wanted], lambda: pieces(path), registry(), Settings())
    assert part.shown
    assert 0 < part.lines < 100


@pytest.mark.slow
def test_a_smaller_piece_shows_it_at_the_same_time_in_the_same_words() -> None:
    wanted = found(FAULTS, "TRF-016")
    (part,) = extracts([wanted], lambda: pieces(FAULTS), registry(), Settings())
    (whole,) = (run.examples[0] for _, run in outcome(FAULTS.read_bytes(), ("TRF-016",)).runs[:1])
    (small,) = (run.examples[0] for _, run in outcome(part.text, ("TRF-016",)).runs)
    assert (small.t, small.text) == (whole.t, whole.text)
