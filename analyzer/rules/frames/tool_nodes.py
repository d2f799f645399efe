"""Node IDs that are kept for tools, used by devices."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import KINDS
from dissectors.kit import Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View
    from dissectors.schema import Message

_MESSAGE, _RESPONSE = KINDS.index("message"), KINDS.index("response")
HOUSEKEEPING = "uavcan.protocol."  # messages that tools send, too
FIRST_TOOL = 126


class ToolNodes(Rule):
    """Nodes 126 and 127. Remembers what each first sent, and which ones act as devices."""

    rules = ("CAN-011",)

    def __init__(self) -> None:
        self._first: dict[tuple[int, int], Occurrence] = {}
        self._devices: set[tuple[int, int]] = set()

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Yield answers and reports."""
        t = view.transfers
        rows = (t.src >= FIRST_TOOL).nonzero()[0]
        if not len(rows):
            return
        senders, at = np.unique(t.bus[rows].astype(np.int64) << 8 | t.src[rows], return_index=True)
        for sender, row in zip(senders.tolist(), rows[at].tolist(), strict=True):
            node = sender >> 8, sender & 0xFF
            if node not in self._first:
                self._first[node] = _tool(view, row, *node)
        codes = t.code[rows]
        for code in np.unique(codes).tolist():
            what = _acts(view.type_of(code), code >> 16 & 0xFF, view.type_name(code))
            if what:
                mine = rows[codes == code]
                self._devices.update(zip(t.bus[mine].tolist(), t.src[mine].tolist(), strict=True))
                yield view.among_transfers("CAN-011", mine, partial(_device, view, what))

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield those that did nothing but ask and command."""
        yield from (one for node, one in self._first.items() if node not in self._devices)


def _tool(view: View, row: int, bus: int, node: int) -> Occurrence:
    frames = view.transfers.frames(row)
    about = {"node": node, "what": "only asks and commands, as a tool does"}
    t, lines = int(view.transfers.t[row]), view.lines(frames)
    return Occurrence("CAN-011", t, bus, node, "", frames, about, severity="note", lines=lines)


def _device(view: View, what: str, row: int) -> Values:
    return {"node": int(view.transfers.src[row]), "what": what}


def _acts(message: Message | None, kind: int, name: str) -> str:
    """Return what makes the sender of a type a device, empty if nothing does."""
    if kind == _RESPONSE:
        return f"answers {name.removesuffix('.Response')}"
    if message is None or kind != _MESSAGE or message.actuates or message.full_name.startswith(HOUSEKEEPING):
        return ""
    return "" if message.name.endswith("Command") else f"reports {name}"
