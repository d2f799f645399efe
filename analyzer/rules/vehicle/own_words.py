"""Words for what a rule of a vehicle file has found: the values of fields of a row."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.values import ByteSpans, CodedWords
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.rowsets import RowSet
    from dissectors.kit import Array

MOST_SHOWN = 4  # fields in a text, and values of a list


def value_words(rows: RowSet, ref: FieldRef, place: int) -> str:
    """Return a field of a row in words, `-` if there is none."""
    values = rows.values(ref)
    at = np.flatnonzero((values.rows() == place) & values.there())
    shown = [_word(values.data, ref, int(k)) for k in at[:MOST_SHOWN]]
    unit = f" {ref.kind.unit}" if ref.kind.unit and shown else ""
    return (" ".join(shown) + (" ..." if len(at) > MOST_SHOWN else "") + unit) or "-"


def _word(data: Array | CodedWords | ByteSpans, ref: FieldRef, k: int) -> str:
    if isinstance(data, CodedWords):
        return data.words[int(data.codes[k])][:64]
    if isinstance(data, ByteSpans):
        return bytes(data.buffer[data.start[k] : data.end[k]][:16]).hex(" ").upper()
    value = data[k].item()
    if value in ref.kind.texts:
        return ref.kind.texts[value][0]
    if ref.origin == "frame" and ref.kind.sort in ("moment", "duration"):
        whole, part = divmod(abs(int(value)), SECOND)
        return f"{'-' if value < 0 else ''}{whole}.{part // 1000:06d}"
    if ref.origin == "frame" and ref.column == "id":
        return f"0x{value:X}"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
