"""Records that cannot be read, and frames that the recorder says it lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.events import among_events, drops_in, when
from analyzer.tables import EVENTS
from dissectors.kit import Occurrence, Occurrences, rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

_ERROR_FRAME, _UNREADABLE = EVENTS.index("error frame"), EVENTS.index("unreadable")


@rule("CAP-003")
def unreadable(view: View) -> Iterator[Occurrences]:
    """Yield lines that are not what the format allows."""
    events = view.events
    rows = np.flatnonzero(events.kind == _UNREADABLE) if len(events) else ()
    if not len(rows):
        return
    t = np.fromiter((when(view, int(row)) for row in rows), np.int64, len(rows))
    yield among_events("CAP-003", view, rows, t, lambda k: {"what": _what(view, int(rows[k]))})  # type: ignore[arg-type]


def _what(view: View, row: int) -> str:
    return f"line {int(view.events.line[row])}: {view.events.text(row)}"


@rule("CAP-004")
def lost(view: View) -> Iterator[Occurrence]:
    """Yield frames that the recorder says it lost."""
    for drop in drops_in(view):
        yield Occurrence("CAP-004", drop.t, drop.bus, None, "", (), {"dropped": drop.frames or "some"})
