"""Reports at a steady pace and their breaks: many senders at once, and reports that come piece by piece."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import paces_in_columns

from analyzer.rules.paces import Paces
from dissectors.kit import MILLISECOND, SECOND, Break, PacedReports

STEADY, ROUNDS, HOLES, CHANCE = range(4)
REPORTS = st.lists(
    st.tuples(st.sampled_from((STEADY, ROUNDS, HOLES, CHANCE)), st.integers(0, 60), st.integers(0, 2**32 - 1)),
    min_size=1, max_size=6,
)  # fmt: skip


def made(kinds: list[tuple[int, int, int]]) -> tuple[Any, Any]:
    """Times and losses of one sender: stretches of reports of some kinds."""
    apart, lost = [], []
    for kind, count, seed in kinds:
        chance = np.random.default_rng(seed)
        usual = chance.choice((20, 150, 900)) * MILLISECOND
        jitter = usual * chance.uniform(0.9, 1.1, count)
        apart.append(
            {
                STEADY: jitter,
                ROUNDS: np.where(chance.random(count) < 0.6, usual / 40, jitter),
                HOLES: np.where(chance.random(count) < 0.1, jitter * chance.uniform(3, 40, count), jitter),
                CHANCE: chance.exponential(usual, count),
            }[kind]
        )
        lost.append(chance.random(count) < 0.1)
    return np.cumsum(np.concatenate(apart)).astype(np.int64), np.cumsum(np.concatenate(lost)).astype(np.int64)


def paced() -> Paces:
    return Paces(100 * MILLISECOND, 5, 4, 2 * SECOND)


def breaks(paced: PacedReports, parts: list[tuple[Any, Any]]) -> list[list[Break]]:
    """Return what is found of each sender whose next reports these are."""
    found: list[list[Break]] = [[] for _ in parts]
    senders = [k for k, (t, _) in enumerate(parts) if len(t)]
    some = [parts[k] for k in senders]
    if some:
        t, lost = map(np.concatenate, zip(*some, strict=True))
        for k, one in paced.feed(np.array(senders), np.array([len(t) for t, _ in some]), t, lost):
            found[senders[k]].append(one)
    return found


def said(one: Break | None) -> object:
    return one and (*told(one), one.lowered)


def told(one: Break) -> tuple[Any, ...]:
    return one.start, one.stop, one.period, one.kept


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(REPORTS, min_size=1, max_size=4), st.data())
def test_together_and_piece_by_piece_they_break_where_each_breaks_alone(kinds: Any, data: st.DataObject) -> None:
    reports = [made(one) for one in kinds]
    alone = [paced() for _ in reports]
    expected = [breaks(one, [whole])[0] for one, whole in zip(alone, reports, strict=True)]
    together = paced()
    found: list[list[Break]] = [[] for _ in reports]
    cuts = [sorted(data.draw(st.lists(st.integers(0, len(t)), min_size=2, max_size=2))) for t, _ in reports]
    begins, ends = zip(*cuts, strict=True)
    for first, last in (([0] * len(cuts), begins), (begins, ends), (ends, [None] * len(cuts))):
        parts = [(t[a:b], lost[a:b]) for (t, lost), a, b in zip(reports, first, last, strict=True)]
        for known, new in zip(found, breaks(together, parts), strict=True):
            known.extend(new)
    assert [list(map(said, one)) for one in found] == [list(map(said, one)) for one in expected]
    until = together.last + 30 * SECOND
    silent = dict(together.silences(until))
    for k, one in enumerate(alone[: len(until)]):
        assert said(silent.get(k)) == said(dict(one.silences(until[k : k + 1])).get(0) if len(one.last) else None)


def test_a_break_is_told_with_the_period_before_it() -> None:
    times = [*range(40), *range(60, 100)]
    (found,) = breaks(paced(), [(np.array(times, np.int64) * SECOND // 10, np.zeros(len(times), np.int64))])
    assert [(one.start, one.stop, one.period, one.at) for one in found] == [
        (39 * SECOND // 10, 6 * SECOND, SECOND / 10, 39)
    ]


def test_several_close_together_are_one_round() -> None:
    rounds = [second * SECOND + k * MILLISECOND for second in (*range(9), *range(20, 29)) for k in range(4)]
    (found,) = breaks(paced(), [(np.array(rounds, np.int64), np.zeros(len(rounds), np.int64))])
    assert [(one.start, one.stop, one.period) for one in found] == [
        (8 * SECOND + 3 * MILLISECOND, 20 * SECOND, float(SECOND))
    ]


@settings(max_examples=60, deadline=None)
@given(st.lists(REPORTS, min_size=1, max_size=5), st.data())
def test_the_core_finds_what_is_found_in_columns(kinds: Any, data: st.DataObject) -> None:
    reports = [made(one) for one in kinds]
    size, periods = data.draw(st.integers(1, 40)), data.draw(st.sampled_from((2, 5)))
    limits = 100 * MILLISECOND, periods, 4, data.draw(st.sampled_from((0, 2 * SECOND)))
    core, columns = Paces(*limits), paces_in_columns.PacedReports(*limits)
    all_: list[tuple[Break, Break]] = []
    for first in range(0, max(len(t) for t, _ in reports), size):
        parts = [(t[first : first + size], lost[first : first + size]) for t, lost in reports]
        for some, others in zip(breaks(core, parts), breaks(columns, parts), strict=True):
            assert [(*told(one), one.at) for one in some] == [(*told(one), one.at) for one in others]
            all_ += zip(some, others, strict=True)
    assert [said(one) for one, _ in all_] == [said(other) for _, other in all_]  # what was not known at first, too
    if any(len(t) for t, _ in reports):
        assert core.last.tolist() == columns.last.tolist()
        until = core.last + data.draw(st.sampled_from((SECOND, 30 * SECOND)))
        assert [(k, said(one)) for k, one in core.silences(until)] == [
            (k, said(one)) for k, one in columns.silences(until)
        ]


def test_a_copy_grows_apart() -> None:
    one = paced()
    times = np.arange(40, dtype=np.int64) * SECOND // 10
    assert breaks(one, [(times, np.zeros(40, np.int64))]) == [[]]
    behind = np.array([60 * SECOND]), np.zeros(1, np.int64)
    other = deepcopy(one)
    (found,), (same,) = breaks(one, [behind]), breaks(other, [behind])
    assert [told(found[0]), found[0].lowered] == [told(same[0]), None]
    breaks(other, [(behind[0] + SECOND // 10, behind[1])])
    assert (found[0].lowered, same[0].lowered) == (None, False)


def test_columns_have_to_fit() -> None:
    one, two = np.zeros(1, np.int64), np.zeros(2, np.int64)
    for columns in ((one, one, two, two), (one, one, one, two), (two, one, one, one), (one, one - 1, one, one)):
        with pytest.raises((ValueError, OverflowError)):
            paced().feed(*columns)
