"""Where frames of a sender are missing: between two frames of a session that cannot follow each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.rules.bus.sessions import MOST_SESSIONS, bus_frames, node_of
from analyzer.rules.joint.lack_rows import UNASKED, LackRows
from analyzer.rules.joint.times import FEW, LONGEST, SETTLED, WIDEST, WINDOW

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_REACH = SETTLED + LONGEST + WIDEST  # what is missing before may not be joint with what is missing now


class Lacks:
    """Follows the tail bytes of all transfers; sessions are at most 4096.

    A type that begins anew at 0 lacks nothing: its node restarted. Answers of which a whole one is not there were not
    given, perhaps.
    """

    def __init__(self) -> None:
        self._native = _native.Lacks(MOST_SESSIONS, FEW, WINDOW, WIDEST, _REACH)

    def feed(self, view: View) -> tuple[LackRows, Array]:
        """Add a batch; return what is missing, in the order of the frames behind it.

        What was missing before is void now where the frame behind it is one of those that are returned, too.
        """
        by_bus = bus_frames(view.frames)
        codes = np.concatenate([np.empty(0, np.int64), *(ours.codes for ours in by_bus.values())])
        if self._native.open(codes) or not view.transfers.src.all():
            self._native.prove(view.transfers, lambda code: view.type_of(code) is not None)
        for bus, ours in by_bus.items():
            self._native.feed(bus, ours, view.frames.first, view.frames.flags)
        (columns, void), gone = self._native.take()
        session, *more = (cells(column, np.int64) for column in columns)
        seen = np.full(len(session), UNASKED, np.uint8)
        rows = LackRows._make((session, node_of(session), *more, cells(void, np.bool_), seen))
        return rows, cells(gone, np.int64)

    def known(self, lacks: LackRows, within: int) -> Array:
        """Return whether the sessions were known to be DroneCAN's up to a time after each."""
        return cells(self._native.known(lacks.session, lacks.until, within), np.bool_)

    def nodes(self, bus: int) -> Array:
        """Return when each node of a bus that sends messages became known, in the order of these times."""
        return cells(self._native.nodes(bus), np.int64)
