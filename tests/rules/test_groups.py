"""Rows of occurrences that belong together: as they are if every row is looked at by itself."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer._native import LastRuns, OccurrenceGroups
from analyzer.rules.found import groups
from analyzer.rules.found.runs import PAUSE, PIECE
from dissectors.kit import SECOND, Occurrences

ROW = st.tuples(
    st.integers(-20, 40), st.integers(0, 9), st.integers(0, 1), st.integers(-1, 1), st.integers(0, 1), st.booleans(),
    st.booleans(), st.sampled_from([0.0, 1.5, float("nan")]),
)  # fmt: skip
NOT_A_NUMBER = 9.0  # where such keys come in order


def found(rows: list[tuple[Any, ...]], *, keyed: bool) -> Occurrences:
    t, frame, bus, node, type_, doubtful, _, key = (np.array(column) for column in zip(*rows, strict=True))
    return Occurrences(
        rule="TYP-101", t=t * SECOND, bus=bus.astype(np.uint8), node=node, type=type_, frame=frame,
        values=lambda _: {}, frames=lambda _: (), doubtful=doubtful, key=key if keyed else None,
    )  # fmt: skip


def begins(apart: Any, before: int, t: int) -> bool:
    if apart == groups.ALL_ONE:
        return False
    return t - before > PAUSE or (apart == groups.BY_PIECE and t // PIECE != before // PIECE)


def pieces(rows: list[tuple[Any, ...]], order: list[int], apart: Any) -> list[list[int]]:
    made: list[list[int]] = []
    for k in order:
        if made and not begins(apart, rows[made[-1][-1]][0] * SECOND, rows[k][0] * SECOND):
            made[-1].append(k)
        else:
            made.append([k])
    return made


@pytest.mark.parametrize("apart", [groups.BY_PAUSE, groups.BY_PIECE, groups.ALL_ONE])
@given(rows=st.lists(ROW, min_size=1, max_size=24), keyed=st.booleans(), data=st.data())
def test_rows_are_grouped_as_if_one_by_one(apart: Any, rows: list[Any], keyed: bool, data: Any) -> None:
    def about(k: int) -> tuple[Any, ...]:
        _, _, bus, node, type_, doubtful, noted, key = rows[k]
        return bus, node, type_, noted, doubtful, (NOT_A_NUMBER if key != key else key) * keyed  # noqa: PLR0124

    def place(k: int) -> tuple[int, int]:
        return rows[k][0] * SECOND, rows[k][1]

    order = sorted(range(len(rows)), key=lambda k: (about(k), place(k)))
    expected = [(key[:5], pieces(rows, list(same), apart)) for key, same in groupby(order, key=about)]
    made = groups.groups_of(found(rows, keyed=keyed), np.array([row[6] for row in rows]), apart)
    runs = LastRuns(1)
    each, beyond = runs.count(made, 0, None, None)
    assert (len(each), beyond) == (len(expected), [[], [], [], []])
    for (at, known, found_pieces), (what, mine) in zip(each, expected, strict=True):
        masks, (bus, node, number, _), first = made.group(at)
        assert (known, (bus, node, number, *masks), first) == (None, what, mine[0][0])
        assert [made.rows(*piece[2:]) for piece in found_pieces] == mine
        assert [piece[:2] for piece in found_pieces] == [(place(one[0]), place(one[-1])) for one in mine]
    chosen = data.draw(st.lists(st.sampled_from(range(len(each))), unique=True))
    joined = sorted((k for at in chosen for one in expected[at][1] for k in one), key=place)
    together = runs.count_together(made, chosen, runs.add(), None)
    assert [made.rows(*piece[2:]) for piece in together] == pieces(rows, joined, apart)


def test_columns_that_do_not_fit_together_are_refused() -> None:
    two, one = np.zeros(2, np.int64), np.zeros(1, np.int64)
    with pytest.raises(ValueError, match="do not fit"):
        OccurrenceGroups([two, two, two, one, two], None, [None, None], groups.ALL_ONE)
    with pytest.raises(ValueError, match="do not fit"):
        OccurrenceGroups([two] * 5, one, [None, None], groups.ALL_ONE)
    with pytest.raises(ValueError, match="do not fit"):
        OccurrenceGroups([two] * 5, None, [None, np.zeros(3, np.uint8)], groups.ALL_ONE)
