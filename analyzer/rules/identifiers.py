"""Which data types are sent, and by whom: unknown ones, vendors' ones among the standard ones, tools that report."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import KINDS, STATUSES
from dissectors.conformance import Occurrence, Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Found, Values, View
    from dissectors.schema import Message

_UNCHECKED = STATUSES.index("unchecked")
_MESSAGE, _RESPONSE = KINDS.index("message"), KINDS.index("response")
VENDOR_IDS = 20000  # message types from here on are for vendors
STANDARD = ("uavcan", "dronecan")  # namespaces that are no vendor's
HOUSEKEEPING = "uavcan.protocol."  # messages that tools send, too
FIRST_TOOL = 126


@watches("CAN-015")
def unknown(view: View) -> Iterator[Found]:
    """Complete transfers of types without a definition: those whose CRC nobody can check."""
    t = view.transfers
    rows = np.flatnonzero(t.status == _UNCHECKED)

    def values(row: int) -> Values:
        kind = KINDS[int(t.kind[row])]
        return {"kind": kind, "type_id": int(t.type_id[row]), "length": int(t.length[row])}

    if len(rows):
        yield view.among_transfers("CAN-015", rows, values)


@watches("CAN-017")
def misplaced(view: View) -> Iterator[Found]:
    """Messages of vendors' types that have a number of the standard range."""
    t = view.transfers
    rows = np.flatnonzero((t.kind == _MESSAGE) & (t.type_id < VENDOR_IDS))
    codes = t.code[rows]
    for code in np.unique(codes).tolist():
        message = view.type_of(code)
        if message is not None and message.full_name.partition(".")[0] not in STANDARD:
            about = {"name": message.full_name, "type_id": message.type_id}
            yield view.among_transfers("CAN-017", rows[codes == code], partial(_always, about))


class Tools(Watcher):
    """Nodes 126 and 127. Remembers what each first sent, and which ones act as devices."""

    rules = ("CAN-011",)

    def __init__(self) -> None:
        self._first: dict[tuple[int, int], Occurrence] = {}
        self._devices: set[tuple[int, int]] = set()

    def look(self, view: View) -> Iterator[Found]:
        """Answers and reports."""
        t = view.transfers
        rows = np.flatnonzero(t.src >= FIRST_TOOL)
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

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Those that did nothing but ask and command."""
        yield from (one for node, one in self._first.items() if node not in self._devices)


def _tool(view: View, row: int, bus: int, node: int) -> Occurrence:
    frames = view.transfers.frames(row)
    about = {"node": node, "what": "only asks and commands, as a tool does"}
    t, lines = int(view.transfers.t[row]), view.lines(frames)
    return Occurrence("CAN-011", t, bus, node, "", frames, about, severity="note", lines=lines)


def _device(view: View, what: str, row: int) -> Values:
    return {"node": int(view.transfers.src[row]), "what": what}


def _always(values: Values, _row: int) -> Values:
    return values


def _acts(message: Message | None, kind: int, name: str) -> str:
    """What makes the sender of a type a device, empty if nothing does."""
    if kind == _RESPONSE:
        return f"answers {name.removesuffix('.Response')}"
    if message is None or kind != _MESSAGE or message.actuates or message.full_name.startswith(HOUSEKEEPING):
        return ""
    return "" if message.name.endswith("Command") else f"reports {name}"


WATCHERS: tuple[type[Watcher], ...] = (unknown, misplaced, Tools)
