"""Rows of a table: which can be relied on, who sent them, and what a breach in one of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.conformance import Occurrence

if TYPE_CHECKING:
    from dissectors.conformance import Table, Values, View, Words

NODES = 1 << 15  # 8 bits of bus, 7 of node ID


def usable(table: Table) -> Words:
    """Rows with a good CRC that hold every field."""
    return table.trusted & (table["bits_left"] >= 0)


def sound(table: Table) -> Words:
    """Rows whose packet is whole, with the right length and checksum, in a transfer that can be relied on."""
    return table["packet_ok"] & table.trusted


def sender(table: Table, rows: Words | slice = slice(None)) -> Words:
    """Bus and node of rows in one number of 16 bits below `NODES`."""
    node = table.bus[rows].astype(np.uint16) << 7
    node |= table.src[rows] & 0x7F
    return node


def frames_of(view: View, table: Table, row: int) -> tuple[int, ...]:
    """The frames of one row's transfer."""
    return tuple(view.transfers.frames(int(table.row[row])))


def breach(
    view: View, table: Table, row: int, rule: str, values: Values, *, held: bool = False, **about: Any
) -> Occurrence:
    """A breach in one row; what is `held` back keeps its lines. `about` as `Occurrence` has it, else from the row."""
    frames = frames_of(view, table, row)
    if held:
        about["lines"] = view.lines(frames)
    place = {"t": int(table.t[row]), "bus": int(table.bus[row]), "node": int(table.src[row]), "type": table.name}
    return Occurrence(**{"rule": rule, "frames": frames, "values": values, **place, **about})
