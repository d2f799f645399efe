"""ESCStatus: bit fields in the order of a C compiler (4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import rule, usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View

# Where the bit fields of a C compiler stand in the little-endian word of bytes 11 to 14: first bit and width.
_C_SPEED, _C_THROTTLE, _C_INDEX, _C_PADDING = (0, 18), (18, 7), (25, 5), (30, 2)
_C_START, _C_END = 10, 14


@rule("TYP-010")
def low_bits_first(view: View) -> Iterator[Occurrences]:
    """Find reports that make sense as bit fields of a C compiler and have dirty padding (4.4.3)."""
    table = view.table("ESCStatus")
    if table is None:
        return
    found: dict[int, Values] = {}
    for row in (table["pad_nonzero"] & usable(table)).nonzero()[0].tolist():
        payload = view.transfers.payload(int(table.row[row]))
        reading = _c_reading(int.from_bytes(payload[_C_START:_C_END], "little"))
        if reading is not None:
            found[row] = reading
    if found:
        yield view.among_rows("TYP-010", table, np.array(list(found)), found.__getitem__)


def _c_reading(word: int) -> Values | None:
    speed, throttle, index, padding = (
        word >> low & (1 << width) - 1 for low, width in (_C_SPEED, _C_THROTTLE, _C_INDEX, _C_PADDING)
    )
    if padding or throttle > 100 or index > 19:
        return None
    sign = 1 << _C_SPEED[1] - 1
    return {"rpm": (speed ^ sign) - sign, "throttle": throttle, "esc_index": index}
