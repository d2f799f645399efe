"""Numbers beyond limits, and numbers that a note does not allow, against masks of every number."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.rules.limits import outside
from analyzer.rules.values.noted_fields import NotedColumn, NotedTest

KINDS = st.sampled_from(["u1", "u2", "u4", "i1", "i2", "i8", "f4", "f8", "?"])
RAW = st.lists(st.integers(-5, 300) | st.sampled_from([float("nan"), float("inf"), -0.5, 255.5]), max_size=12)
LIMIT = st.none() | st.integers(-3, 260).map(Fraction) | st.fractions(-3, 260, max_denominator=4)


def column_of(kind: str, raw: list[Any], scale: Fraction) -> Any:
    values = np.array([one if kind[0] == "f" or one == one // 1 else 0 for one in raw], np.float64)
    whole = values if kind[0] == "f" else np.clip(np.nan_to_num(values, posinf=0), 0 if kind[0] in "u?" else -128, 127)
    return whole.astype(kind) if scale == 1 else whole * float(scale)


@given(KINDS, RAW, st.floats(-3, 260) | st.just(-np.inf), st.floats(-3, 260) | st.just(np.inf))
def test_what_is_outside_of_limits(kind: str, raw: list[Any], low: float, high: float) -> None:
    shown = column_of(kind, raw, Fraction(1))
    assert outside(shown, low, high).tolist() == np.flatnonzero((shown < low) | (shown > high)).tolist()


def plain(column: NotedColumn, shown: Any) -> list[int]:
    """The places of wrong numbers, by a mask for each of what is allowed."""
    raw = np.rint(shown / float(column.scale))
    special = [] if column.word else list(column.special)
    if column.enum:
        return np.flatnonzero(~np.isin(raw, [*column.enum, *special])).tolist()
    wrong = np.zeros(len(shown), bool)
    scale, half = column.scale, 0 if column.float_bits else Fraction(1, 2)
    for limit, side in ((column.low, -1), (column.high, 1)):
        if limit is not None:
            edge = float((limit + side * half) * scale)
            if column.float_bits:
                sent = float(np.dtype(f"f{column.float_bits // 8}").type(float(limit)))
                edge = sent if scale == 1 else float(np.nextafter(sent * float(scale), side * np.inf))
            wrong |= shown < edge if side < 0 else shown > edge
    return np.flatnonzero(wrong & ~np.isin(raw, special)).tolist()


@given(
    KINDS, RAW, LIMIT, LIMIT, st.frozensets(st.integers(0, 255), max_size=3), st.frozensets(st.integers(0, 9)),
    st.sampled_from([Fraction(1), Fraction(1, 10), Fraction(5, 2)]), st.booleans(),
)  # fmt: skip
def test_numbers_that_a_note_does_not_allow(
    kind: str, raw: list[Any], low: Any, high: Any, special: Any, enum: Any, scale: Fraction, word: bool
) -> None:
    bits = {"f4": 32, "f8": 64}.get(kind, 0)
    names = {code: str(code) for code in enum}
    column = NotedColumn("x", "", scale, bits, False, tuple(special), names, low, high, word="w" if word else "")
    shown = column_of(kind, raw, scale)
    test = NotedTest(column)
    assert test.wrong(shown).tolist() == plain(column, shown)
    assert test.wrong(shown).tolist() == plain(column, shown)
