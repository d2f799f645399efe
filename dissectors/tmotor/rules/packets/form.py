"""PUSH-001 to -008: headers, lengths, checksums, frame IDs and units of packets (4.4.4, 4.4.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import rule, sound
from dissectors.tmotor.rules.packets.carried import (
    ALL_UNITS,
    FIRST_UNIT,
    FORMS,
    HEADERS,
    LAST_UNIT,
    UNRECOGNIZED,
    Carried,
    carrier,
    hexadecimal,
    occurrence,
    packet,
    packet_tables,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, Values, View
    from dissectors.tmotor.rules.packets.carried import CarriedPiece

_SHOWN = 8  # first bytes of data that is no packet
_SHORTEST = 7  # header, frame ID, count, unit, length, checksum
_PRINTED_END = 28  # of the sum of FocParameters


@rule("PUSH-002", "PUSH-003", "PUSH-005", "PUSH-006", "PUSH-008")
def known_packets(view: View) -> Iterator[Occurrences]:
    """Find what is wrong with packets whose frame ID is known."""
    for table in packet_tables(view):
        good = table.trusted
        if not (table["packet_ok"] & table["header_ok"]).all():
            yield from _broken(view, table, good)
        if packet(table) == "FocParameters":
            rows = (sound(table) & (table["checksum_end"] == _PRINTED_END)).nonzero()[0]
            if len(rows):
                yield view.among_rows("PUSH-006", table, rows, _cell(table, "value", "checksum"))
        unit = table["unit_id"]
        wrong = (unit < FIRST_UNIT) | (unit > LAST_UNIT)
        if wrong.any():
            wrong &= good & table.has("unit_id")
            if packet(table) == "FocQuery":
                wrong &= unit != ALL_UNITS
            rows = wrong.nonzero()[0]
            if len(rows):
                yield view.among_rows("PUSH-008", table, rows, _cell(table, "unit_id", "unit_id"), key=unit[rows])


def _broken(view: View, table: DecodedTable, good: Array) -> Iterator[Occurrences]:
    frame_id, length = FORMS[packet(table)]
    carried = Carried(view, carrier(table))

    def checksums_of(row: int) -> Values:
        start = int(table["offset"][row])
        whole = carried.data(int(table.row[row]))[start : start + length]
        return {"value": whole[-1], "expected": sum(whole[:-1]) & 0xFF}

    def lengths(row: int) -> Values:
        return {"value": int(table["length"][row]), "expected": length, "frame_id": frame_id}

    def other(row: int) -> Values:
        start = int(table["offset"][row])
        return _header(carried.data(int(table.row[row]))[start:], carrier(table))

    wrong = {
        "PUSH-002": (good & ~table["header_ok"], other),
        "PUSH-003": (good & ~table["length_ok"] & table.has("length"), lengths),
        "PUSH-005": (good & table["length_ok"] & table["complete"] & ~table["checksum_ok"], checksums_of),
    }
    for rule_, (mask, values) in wrong.items():
        rows = mask.nonzero()[0]
        if len(rows):
            yield view.among_rows(rule_, table, rows, values)


@rule("PUSH-001", "PUSH-002", "PUSH-004", "PUSH-005", "PUSH-007", "PUSH-008")
def leftovers(view: View) -> Iterator[Occurrence]:
    """Find bytes that are no packet, packets that end early or late, and packets that the document does not have."""
    for name in HEADERS:
        table = view.table(name)
        if table is None or not table.good:
            continue
        odd = _odd(view, name)
        if odd.size:
            carried = Carried(view, name)
            rows = np.isin(table.row, odd).nonzero()[0]
            for row in rows[table.trusted[rows]].tolist():
                for piece in carried.pieces(int(table.row[row])):
                    for rule, values in _judge(piece, name):
                        yield occurrence(view, table, row, rule, values)


def _odd(view: View, name: str) -> Array:
    """Return transfers with anything but whole packets of the length that they say."""
    found = [np.empty(0, np.int64)]
    rest = view.table(f"{name}.{UNRECOGNIZED}")
    if rest is not None:
        found.append(rest.row)
    for table in packet_tables(view):
        if carrier(table) == name:
            wrong = ~(table["complete"] & table["length_ok"])
            if wrong.any():
                found.append(table.row[wrong])
    return np.unique(np.concatenate(found))


def _judge(piece: CarriedPiece, name: str) -> Iterator[tuple[str, Values]]:
    """Yield breaches of a piece; of a packet that the document has, only those that its table does not show."""
    if not piece.direction:
        yield "PUSH-001", {"first_bytes": hexadecimal(piece.data[:_SHOWN]), "where": _where(piece)}
        return
    length, available = piece.length, len(piece.data)
    if length != available:
        yield "PUSH-004", {"available": available, "length": "unknown" if length is None else length}
    if piece.named:
        return
    if piece.direction != name:
        yield "PUSH-002", _header(piece.data, name)
    if piece.frame_id is not None:
        yield "PUSH-007", {"frame_id": piece.frame_id}
    if piece.unit is not None and not FIRST_UNIT <= piece.unit <= LAST_UNIT:
        yield "PUSH-008", {"unit_id": piece.unit}
    if length is not None and _SHORTEST <= length <= available:
        expected = sum(piece.data[: length - 1]) & 0xFF
        if expected != piece.data[length - 1]:
            yield "PUSH-005", {"value": piece.data[length - 1], "expected": expected}


def _where(piece: CarriedPiece) -> str:
    """Say where a piece begins; bytes without a header reach to the first header."""
    return "nowhere" if piece.last else f"at byte {piece.offset + len(piece.data) + 1}"


def _header(data: bytes, name: str) -> Values:
    return {"header": hexadecimal(data[:2]), "type": name}


def _cell(table: DecodedTable, name: str, column: str) -> Callable[[int], Values]:
    return lambda row: {name: int(table[column][row])}
