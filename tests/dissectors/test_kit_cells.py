"""Columns as numpy arrays."""

from __future__ import annotations

import pyarrow as pa
import pytest

from dissectors.kit.cells import holds_text

CHOICES = [None, "tm", "apd", "", "tmx", "tm"]


@pytest.mark.parametrize("text", ["tm", "", "tmx", "other", "µ"])
@pytest.mark.parametrize("rows", [CHOICES, CHOICES[1:], [], [None], ["µ", "m"], ["tm", "tm"], ["tm", "tx"]])
def test_which_cells_hold_a_text(text: str, rows: list[str | None]) -> None:
    whole = pa.array(["tm", *rows, "apd"], pa.string())
    for array in (pa.array(rows, pa.string()), whole.slice(1, len(rows))):
        assert holds_text(array, text).tolist() == [one == text for one in rows]
