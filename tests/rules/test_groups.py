"""Rows of occurrences that belong together: a few are put together like many."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.rules.found import groups
from dissectors.kit import SECOND, Occurrences

ROW = st.tuples(
    st.integers(0, 40), st.integers(0, 9), st.integers(0, 1), st.integers(-1, 1), st.integers(0, 1), st.booleans(),
    st.booleans(), st.sampled_from([0.0, 1.5, float("nan")]),
)  # fmt: skip


def found(rows: list[tuple[Any, ...]], *, keyed: bool) -> Occurrences:
    t, frame, bus, node, type_, doubtful, _, key = (np.array(column) for column in zip(*rows, strict=True))
    return Occurrences(
        rule="TYP-101", t=t * SECOND, bus=bus, node=node, type=type_, frame=frame, values=lambda _: {},
        frames=lambda _: (), doubtful=doubtful, key=key if keyed else None,
    )  # fmt: skip


@pytest.mark.parametrize("apart", [groups.by_pause, groups.by_piece, groups.all_one])
@given(rows=st.lists(ROW, min_size=1, max_size=12), keyed=st.booleans())
def test_a_few_are_put_together_like_many(apart: Any, rows: list[tuple[Any, ...]], keyed: bool) -> None:
    def pieces() -> list[Any]:
        told = groups.pieces_by_key(found(rows, keyed=keyed), [row[6] for row in rows], apart)
        return [([piece.tolist() for piece in each], *same) for each, *same in told]

    with pytest.MonkeyPatch.context() as patched:
        few = pieces()
        patched.setattr(groups, "FEW", 0)
        assert few == pieces()
