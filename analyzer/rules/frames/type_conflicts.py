"""Two data types with one ID: the CRC fits another definition than the preferred one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.anomalies import flagged
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View

_OTHER_TYPE = 1 << TRANSFER_ANOMALIES.index("other type")
_PREFERRED = 0xFF_FFFF  # bits of a type's code: all but the variant


@rule("CAN-020")
def named_by_crc(view: View) -> Iterator[Occurrences]:
    """Find transfers that the core decoded by another type with the same ID."""
    rows = flagged(view.transfers.anomaly, _OTHER_TYPE)
    if len(rows):
        codes = view.transfers.code
        yield view.among_transfers(
            "CAN-020", rows, lambda row: types_of(view, int(codes[row]), view.type_name(int(codes[row])))
        )


def types_of(view: View, code: int, name: str) -> Values:
    """Return what is said of a type that its CRC gives another name."""
    return {"type_id": code & 0xFFFF, "name": name, "expected": view.type_name(code & _PREFERRED)}
