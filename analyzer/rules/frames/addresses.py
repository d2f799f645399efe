"""Transfers with an identifier that none may have, with two of them, or in CAN FD frames."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.anomalies import GONE, flagged
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Occurrences, Values, View


@rule("CAN-003", "CAN-006", "CAN-007", "CAN-012", "CAN-014")
def addressed(view: View) -> Iterator[Occurrences]:
    """Yield transfers with an identifier that none may have, with two of them, or in CAN FD frames."""
    t = view.transfers
    some = int(np.bitwise_or.reduce(t.anomaly)) if len(t) else 0
    for code, bit, values in _BITS:
        if some & bit:
            yield view.among_transfers(code, flagged(t.anomaly, bit), partial(values, view))
    if t.fd.any():
        yield view.among_transfers("CAN-003", np.flatnonzero(t.fd), lambda row: {"length": _fd_length(view, row)})


def _service(view: View, row: int) -> Values:
    t = view.transfers
    return {"type_id": int(t.type_id[row]), "dst": int(t.dst[row]), "node": int(t.src[row])}


def _priorities(view: View, row: int) -> Values:
    kept = [view.frame(number) for number in view.transfers.frames(row)]
    first = int(view.transfers.priority[row])
    other = (frame.id >> 24 for frame in kept if frame is not None and frame.id >> 24 != first)
    return {"first_priority": first, "priority": next(other, GONE)}


def _fd_length(view: View, row: int) -> Any:
    kept = view.frame(int(view.transfers.lead[row]))
    return GONE if kept is None else len(kept.data)


_BITS: tuple[tuple[str, int, Callable[[View, int], Values]], ...] = tuple(
    (code, 1 << TRANSFER_ANOMALIES.index(name), values)
    for code, name, values in (
        ("CAN-006", "destination zero", _service),
        ("CAN-007", "source zero", _service),
        ("CAN-012", "addressed to itself", _service),
        ("CAN-014", "priority changed", _priorities),
    )
)
