"""Single frames whose form is wrong, whoever sent them: identifiers of 11 bits, lengths that CAN cannot send."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import who
from analyzer.rules.anomalies import flagged
from analyzer.tables import EXTENDED, FRAME_ANOMALIES
from dissectors.kit import rule
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View

_IMPOSSIBLE = 1 << FRAME_ANOMALIES.index("impossible length")


@rule("CAN-001")
def narrow(view: View) -> Iterator[Occurrences]:
    """Yield identifiers of 11 bits."""
    f = view.frames
    if not len(f) or np.bitwise_and.reduce(f.flags) & EXTENDED:
        return
    rows = np.flatnonzero(f.flags & EXTENDED == 0)

    def values(row: int) -> Values:
        return {"can_id": int(f.id[row]), "length": int(f.length[row])}

    yield view.among_frames("CAN-001", rows, values, key=f.id[rows], lasts=True)


@rule("CAN-019")
def impossible(view: View) -> Iterator[Occurrences]:
    """Yield lengths that no controller sends, whoever's the frame is."""
    f = view.frames
    rows = flagged(f.anomaly, _IMPOSSIBLE)
    if len(rows):
        found = view.among_frames("CAN-019", rows, lambda row: {"length": int(f.length[row])})
        node, code = who(f.id[rows], f.flags[rows], np.zeros(len(rows), np.uint8))
        yield replace(found, node=node, type=code)
