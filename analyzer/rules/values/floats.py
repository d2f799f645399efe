"""Floats that are no numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.values.shapes import BYTE, Shape, column_of, dsdl_name, shape_of
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View

_MANTISSA = {16: 10, 32: 23, 64: 52}


class Floats(Rule):
    """TYP-007, -008: floats that are no numbers."""

    rules = ("TYP-007", "TYP-008")

    def __init__(self) -> None:
        self._shapes: dict[str, Shape] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Find them in one pass over the floats of each table."""
        for context in view.contexts:
            for table in context.tables:
                shape = shape_of(self._shapes, view, table)
                for field in shape.float_fields:
                    for path, rows, values in table.not_finite(column_of(table, field)):
                        yield from _special(view, table, path, rows, _raw(values, shape.floats[dsdl_name(path)]))


def _special(view: View, table: DecodedTable, path: str, rows: Array, raw: Array) -> Iterator[Occurrences]:
    good = table.trusted[rows]
    mantissa = _MANTISSA[raw.dtype.itemsize * BYTE]
    nan = raw & raw.dtype.type((1 << mantissa) - 1) != 0
    for rule, kind in (("TYP-007", nan), ("TYP-008", ~nan)):
        here, first = np.unique(rows[good & kind], return_index=True)
        if len(here):
            codes = raw[good & kind][first].tolist()
            said = {
                row: {"field": dsdl_name(path), "raw": code} for row, code in zip(here.tolist(), codes, strict=True)
            }
            yield view.among_rows(rule, table, here, said.__getitem__)


def _raw(values: Array, width: int) -> Array:
    """Return floats as they were sent; float16 comes as float32."""
    if width == 64:
        return values.view(np.uint64)
    bits = values.astype(np.float32).view(np.uint32)
    if width == 32:
        return bits
    return (bits >> 16 & 0x8000 | bits >> 13 & 0x7FFF & 0x3FF | 0x7C00).astype(np.uint16)
