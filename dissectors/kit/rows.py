"""Rows of a table: which can be relied on, who sent them, and what a breach in one of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit.occurrence import TURNED, Occurrence
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit.array import Array
    from dissectors.kit.decoded import DecodedTable
    from dissectors.kit.occurrence import Values
    from dissectors.kit.view import View

NODES = 1 << 15  # 8 bits of bus, 7 of node ID


def usable(table: DecodedTable) -> Array:
    """Return a mask of the rows of a message table with a good CRC that hold every field; not to be written to."""
    return table.once(_usable)


def _usable(table: DecodedTable) -> Array:
    return table.trusted & (table["bits_left"] >= 0)


def sound(table: DecodedTable) -> Array:
    """Return a mask of the rows whose packet is whole, with the right length and checksum, in a trusted transfer.

    It is not to be written to.
    """
    return table.once(_sound)


def _sound(table: DecodedTable) -> Array:
    return table["packet_ok"] & table.trusted


def doubtful(table: DecodedTable, rows: Array) -> Array | None:
    """Return a mask of rows whose packet is read in a byte order that is not proved; None if there are none."""
    if "big_endian" not in table or "decided" not in table:
        return None
    unsure: Array = ~table["decided"][rows]
    return unsure if unsure.any() else None


def sender(table: DecodedTable, rows: Array | slice = slice(None)) -> Array:
    """Return bus and node of rows in one number of 16 bits each, below `NODES`; not to be written to."""
    found: Array = table.sender[rows]
    return found


def frames_of(view: View, table: DecodedTable, row: int) -> tuple[int, ...]:
    """Return the numbers of the frames of one row's transfer."""
    return tuple(view.transfers.frames(int(table.row[row])))


def breach(
    view: View, table: DecodedTable, row: int, rule: str, values: Values, *, held: bool = False, **about: Any
) -> Occurrence:
    """Return a breach in one row; what is `held` back keeps its lines. `about` as `Occurrence` has it."""
    frames = frames_of(view, table, row)
    if held:
        about["lines"] = view.lines(frames)
    if doubtful(table, np.array([row])) is not None:
        about["dialects"] = {**about.get("dialects", {}), **TURNED}
    place = {"t": int(table.t[row]), "bus": int(table.bus[row]), "node": int(table.src[row]), "type": table.name}
    return Occurrence(**{"rule": rule, "frames": frames, "values": values, **place, **about})


def rows_by_bus(bus: Array, t: Array) -> Iterator[tuple[int, Array | None]]:
    """Yield rows that have a time by bus, None for all."""
    if not len(bus):
        return
    if int(bus.min()) == int(bus.max()) and int(t.min()) != NO_TIME:
        yield int(bus[0]), None
        return
    timed = t != NO_TIME
    for index in np.bincount(bus).nonzero()[0].tolist():
        rows = ((bus == index) & timed).nonzero()[0]
        if len(rows):
            yield index, rows
