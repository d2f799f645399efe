"""Data types that nobody defines, and vendors' types with numbers of the standard range."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import KINDS, STATUSES
from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View

_UNCHECKED = STATUSES.index("unchecked")
_MESSAGE, _RESPONSE = KINDS.index("message"), KINDS.index("response")
VENDOR_IDS = 20000  # message types from here on are for vendors
STANDARD = ("uavcan", "dronecan")  # namespaces that are no vendor's


@rule("CAN-015")
def unknown(view: View) -> Iterator[Occurrences]:
    """Yield complete transfers of types without a definition: those whose CRC nobody can check."""
    t = view.transfers
    rows = np.flatnonzero(t.status == _UNCHECKED)

    def values(row: int) -> Values:
        kind = KINDS[int(t.kind[row])]
        return {"kind": kind, "type_id": int(t.type_id[row]), "length": int(t.length[row])}

    if len(rows):
        yield view.among_transfers("CAN-015", rows, values)


@rule("CAN-017")
def misplaced(view: View) -> Iterator[Occurrences]:
    """Yield messages of vendors' types that have a number of the standard range."""
    t = view.transfers
    rows = np.flatnonzero((t.kind == _MESSAGE) & (t.type_id < VENDOR_IDS))
    codes = t.code[rows]
    for code in np.unique(codes).tolist():
        message = view.type_of(code)
        if message is not None and message.full_name.partition(".")[0] not in STANDARD:
            about = {"name": message.full_name, "type_id": message.type_id}
            yield view.among_transfers("CAN-017", rows[codes == code], partial(_always, about))


def _always(values: Values, _row: int) -> Values:
    return values
