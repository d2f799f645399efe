"""Rows by key from the core are those that the kit's own way gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.decode.grouped import grouped
from dissectors.kit import by_key


@pytest.mark.parametrize("kind", [np.uint8, np.uint32, np.int64])
@given(keys=st.lists(st.integers(0, 3) | st.integers(0, 255)))
def test_rows_by_key(kind: type, keys: list[int]) -> None:
    given_keys = np.array(keys, kind)
    for found, expected in zip(grouped(given_keys), by_key(given_keys.astype(np.int64)), strict=True):
        assert found.tolist() == expected.tolist()


def test_many_keys_and_every_second_one() -> None:
    keys = np.random.default_rng(1).integers(0, 1 << 40, 20_000)[::2]
    for found, expected in zip(grouped(keys), by_key(keys), strict=True):
        assert np.array_equal(found, expected)
