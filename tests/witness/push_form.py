"""Proofs of PUSH-001 to PUSH-011: headers, lengths, checksums, counts, byte order and units of packets."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from typing import TYPE_CHECKING

from witness.packets import SIZES, Piece, packets, pieces
from witness.views import MILLISECOND, Finder, Found, Latest, Message, by_node

if TYPE_CHECKING:
    from collections.abc import Callable

    from witness.reader import Log

UNITS = range(0xA1, 0xAA)
SET = "PUSHSCI.FocParameters"


def _pieces(wrong: Callable[[Piece], bool]) -> Finder:
    return lambda log: [piece.numbers for piece in pieces(log) if wrong(piece)]


def unknown_id(piece: Piece) -> bool:
    """PUSH-007: a header that is known, and a frame ID that its direction does not have."""
    return bool(piece.direction) and piece.frame_id >= 0 and not piece.name


def wrong_length(piece: Piece) -> bool:
    """PUSH-003: the length is not that of the table of its frame ID."""
    return bool(piece.name) and piece.length >= 0 and piece.length != SIZES[piece.name]


def wrong_sum(piece: Piece) -> bool:
    """PUSH-005: the last byte is not the sum of those before, for FocParameters not that of bytes 1..28 either."""
    if not piece.direction or not 7 <= piece.size <= len(piece.data) or piece.summed():
        return False
    return piece.name != SET or not piece.summed(28)


def other_range(piece: Piece) -> bool:
    """PUSH-006: FocParameters whose checksum is that of bytes 1..28 and not that of 1..30, which is expected."""
    return piece.name == SET and piece.sound and not piece.summed()


def wrong_unit(piece: Piece) -> bool:
    """PUSH-008: a unit other than 0xA1..0xA9; 0xFF is good in FocQuery."""
    allowed = piece.unit in UNITS or (piece.name == "PUSHSCI.FocQuery" and piece.unit == 0xFF)
    return bool(piece.direction) and piece.unit >= 0 and not allowed


def counts(log: Log) -> Found:
    """PUSH-009: a count that does not follow on the last of its node, direction and unit.

    Where more of the node follow on with a count for each frame ID, for the node, or for each frame ID of the node,
    those that then do not.
    """
    rows: dict[tuple[int, str], list[Piece]] = defaultdict(list)
    for piece in pieces(log):
        if piece.direction and piece.unit >= 0:
            rows[piece.src, piece.direction].append(piece)
    found = []
    for row in rows.values():
        readings = (
            _steps(row, lambda piece: piece.unit),
            _steps(row, lambda piece: (piece.unit, piece.frame_id)),
            _steps(row, lambda _: 0),
            _steps(row, lambda piece: piece.frame_id),
        )
        best = max(readings, key=lambda steps: sum(step == 1 for step, _ in steps))
        found += [piece.numbers for step, piece in best if step != 1]
    return found


def _steps(row: list[Piece], shared: Callable[[Piece], object]) -> list[tuple[int, Piece]]:
    """How far the count went on, modulo 256, and the later packet of each two that share it."""
    apart: dict[object, list[Piece]] = defaultdict(list)
    for piece in row:
        apart[shared(piece)].append(piece)
    return [((piece.count - before.count) % 256, piece) for own in apart.values() for before, piece in pairwise(own)]


def near(a: float, b: float, share: float) -> bool:
    """Do two readings of one quantity agree? Both are rounded, to a hundredth or by float16 to a thousandth of it."""
    size = max(abs(a), abs(b))
    return abs(a - b) <= share * size + 0.02 + 0.001 * size


def big_endian(log: Log) -> Found:
    """PUSH-010: voltage and speed read big-endian agree with the node's ESCStatus, read little-endian they do not."""
    statuses = {src: Latest(sent) for src, sent in by_node(log, "ESCStatus").items()}
    found = []
    for piece, little in packets(log, "PUSHCAN.MotorStatus"):
        status = statuses[piece.src].nearest(piece.t, 100 * MILLISECOND) if piece.src in statuses else None
        if status is None:
            continue
        big = piece.read(">")
        if _agrees(big, status) and not _agrees(little, status):
            found.append(piece.numbers)
    return found


def _agrees(values: dict[str, int], status: Message) -> bool:
    return near(values["voltage"] / 100, status["voltage"], 0.02) and near(values["speed"], status["rpm"], 0.05)


def units(log: Log) -> Found:
    """PUSH-011: unit 0xA1 + k from a node whose esc_index is not k.

    Where both are one number, the map is the one that positions suggest, and the rule's note is no oddity.
    """
    statuses = {src: Latest(sent) for src, sent in by_node(log, "ESCStatus").items()}
    found = []
    for piece in pieces(log):
        if piece.carried.name != "PUSHCAN" or not piece.sound or piece.src not in statuses:
            continue
        status = statuses[piece.src].nearest(piece.t, 1000 * MILLISECOND)
        if status is not None and piece.unit - 0xA1 != status["esc_index"]:
            found.append(piece.numbers)
    return found


FINDERS: dict[str, Finder] = {
    "PUSH-001": _pieces(lambda piece: not piece.direction),
    "PUSH-002": _pieces(lambda piece: piece.direction not in {"", piece.carried.name}),
    "PUSH-003": _pieces(wrong_length),
    "PUSH-004": _pieces(lambda piece: bool(piece.direction) and len(piece.data) != piece.length),
    "PUSH-005": _pieces(wrong_sum),
    "PUSH-006": _pieces(other_range),
    "PUSH-007": _pieces(unknown_id),
    "PUSH-008": _pieces(wrong_unit),
    "PUSH-009": counts,
    "PUSH-010": big_endian,
    "PUSH-011": units,
}
