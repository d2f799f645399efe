"""Identifiers of frames: priorities (4.3.1), and a type that V2.2 no longer has (6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, View

_LOWEST = 31
_FOC_CTRL = 1035
_LAST_MESSAGE = 1  # kinds up to here, anonymous ones too
# Types of one kind of breach, and what is said of it. Of the last only a node with the T-Motor dialect sends any.
_CHOSEN: tuple[tuple[tuple[int, ...], dict[str, Any]], ...] = (
    ((1030, 1033, 1038), {}),
    ((1034,), {"dialects": {"tm": "warning"}}),
    ((1039, 1332), {"severity": "warning", "dialects": {"dronecan": "note"}}),
)
_PLACES = np.zeros(1 << 16, np.uint8)  # among these of each type, from 1
for _place, (_types, _) in enumerate(_CHOSEN, 1):
    _PLACES[[*_types]] = _place


@rule("CAN-013")
def priorities(view: View) -> Iterator[Occurrences]:
    """Find document types with another priority than 31 (4.3.1)."""
    transfers = view.transfers
    rows = (transfers.priority != _LOWEST).nonzero()[0]
    places = _PLACES[transfers.type_id[rows]]
    if not places.any():
        return
    places *= transfers.kind[rows] <= _LAST_MESSAGE
    for place, (_, about) in enumerate(_CHOSEN, 1):
        mine = rows[places == place]
        if mine.size:
            key = transfers.priority[mine]
            yield view.among_transfers(
                "CAN-013", mine, lambda row: {"priority": int(transfers.priority[row])}, key=key, **about
            )


@rule("CAN-016")
def foc_ctrl(view: View) -> Iterator[Occurrences]:
    """Find type 1035, which V2.2 no longer has (6)."""
    transfers = view.transfers
    rows = (transfers.type_id == _FOC_CTRL).nonzero()[0]
    rows = rows[transfers.kind[rows] <= _LAST_MESSAGE] if rows.size else rows
    if rows.size:
        yield view.among_transfers("CAN-016", rows, lambda _row: {})
