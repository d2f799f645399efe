"""Identifiers of frames: priorities (4.3.1), and a type that V2.2 no longer has (6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrences, View

_LOWEST = 31
_COMMANDS = (1030, 1033, 1038)
_ESC_STATUS = 1034
_REPORTS = (1039, 1332)  # only a node with the T-Motor dialect sends them
_FOC_CTRL = 1035
_ANONYMOUS = 1  # the last kind of messages; services follow


@rule("CAN-013")
def priorities(view: View) -> Iterator[Occurrences]:
    """Find document types with another priority than 31 (4.3.1)."""
    transfers = view.transfers
    rows = np.flatnonzero((transfers.priority != _LOWEST) & (transfers.kind <= _ANONYMOUS))
    if not rows.size:
        return
    types = transfers.type_id[rows]

    def found(mine: Array, **about: Any) -> Occurrences:
        key = transfers.priority[mine]
        return view.among_transfers(
            "CAN-013", mine, lambda row: {"priority": int(transfers.priority[row])}, key=key, **about
        )

    for chosen, about in (
        (_COMMANDS, {}),
        ((_ESC_STATUS,), {"dialects": {"tm": "warning"}}),
        (_REPORTS, {"severity": "warning", "dialects": {"dronecan": "note"}}),
    ):
        mine = rows[np.logical_or.reduce([types == one for one in chosen])]
        if mine.size:
            yield found(mine, **about)


@rule("CAN-016")
def foc_ctrl(view: View) -> Iterator[Occurrences]:
    """Find type 1035, which V2.2 no longer has (6)."""
    transfers = view.transfers
    rows = np.flatnonzero((transfers.type_id == _FOC_CTRL) & (transfers.kind <= _ANONYMOUS))
    if rows.size:
        yield view.among_transfers("CAN-016", rows, lambda _row: {})
