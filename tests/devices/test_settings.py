"""Values of parameters in the standard's services, and the rows that hold one."""

from __future__ import annotations

import pyarrow as pa

from analyzer.devices.settings import VALUES, given, holds_value

KIND = pa.struct(
    [("empty", pa.struct([])), ("integer_value", pa.int64()), ("real_value", pa.float32()),
     ("boolean_value", pa.uint8()), ("string_value", pa.list_(pa.uint8()))]
)  # fmt: skip
EMPTY = {"empty": {}}
HELD = [{"integer_value": 0}, {"real_value": 0.5}, {"boolean_value": 0}, {"string_value": []}]


def test_rows_that_hold_a_value_are_those_of_which_one_is_given() -> None:
    column = pa.array([EMPTY, *HELD, None, EMPTY], KIND)
    assert [next(iter(one)) for one in HELD] == list(VALUES)
    for some in (column, column[2:], column[:0]):
        assert holds_value(some).tolist() == [given(one) is not None for one in some.to_pylist()]


def test_a_column_of_another_kind_holds_none() -> None:
    assert holds_value(pa.array([1, 2])).tolist() == [False, False]
