"""Nodes that call themselves unhealthy or not operational."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.node_status import HEALTHS, MODES, NODE_STATUS
from dissectors.kit import Occurrence, rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrences, Severity, Values, View

_OPERATIONAL, _INITIALIZATION = 0, 1
_CRITICAL = 3
_NOT_OPERATIONAL = np.isin(np.arange(1 << 8), [mode for mode in MODES if mode != _OPERATIONAL])  # by mode


@rule("BUS-022")
def health(view: View) -> Iterator[Occurrences | Occurrence]:
    """Yield nodes that call themselves unhealthy or not operational."""
    table = view.table(NODE_STATUS)
    if table is None:
        return
    codes, modes = table["health"], table["mode"]
    bad = table.trusted & ((codes > 0) | _NOT_OPERATIONAL[modes.astype(np.uint8)])
    if not bad.any():
        return

    def values(row: int) -> Values:
        mode = int(modes[row])
        return {"health": HEALTHS[int(codes[row])], "mode": MODES.get(mode, str(mode))}

    fresh = (codes == 0) & (modes == _INITIALIZATION) & (table["uptime_sec"] < view.number("BUS-022", "start_s"))
    critical = bad & (codes == _CRITICAL)
    some: tuple[tuple[Array, Severity | None], ...]
    some = ((bad & ~fresh & ~critical, None), (critical, "error"), (bad & fresh, "note"))
    for mask, said in some:
        rows = np.flatnonzero(mask)
        if len(rows):
            key = codes[rows].astype(np.int64) * 8 + modes[rows]
            yield view.among_rows("BUS-022", table, rows, values, key=key, severity=said)
