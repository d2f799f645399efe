"""Frames that stand in a row though their tail bytes tear them apart: wrong start, end or ID bits of the sender."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from analyzer.rules.diagnosis.proofs import END_BIT, OTHER_ID, START_BIT, Cause, Proof
from analyzer.tables import TRANSFER_IDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.diagnosis.proofs import KnownType, Part

EVERY_START, EVERY_END = "start bit in every frame at the sender", "end bit in every frame at the sender"
EVERY_ID = "transfer ID counted for every frame at the sender"


def in_a_row(parts: Sequence[Part], near: Sequence[Part], expected: KnownType) -> Proof | None:
    """Return the transfer that frames make without a start, end or ID bit that tears them apart.

    None if the CRC is wrong.

    Args:
        parts: frames of a broken transfer, or what is left of one.
        near: all frames of its session around it, in order.
        expected: what is known of its type.
    """
    if not expected.starts:
        return None
    own = [part for part in near if part.transfer_id == parts[0].transfer_id]
    at = next((k for k, part in enumerate(own) if part.number == parts[0].number), None)
    if at is None:
        return None
    return _ends(own, at, expected) or _starts(own, at, expected) or _other_id(parts, near, expected)


def _ends(own: Sequence[Part], at: int, expected: KnownType) -> Proof | None:
    """Look from a start to before the next one, with ends in between."""
    first = next((k for k in range(at, -1, -1) if own[k].start), 0)
    behind = next((k for k in range(first + 1, len(own)) if own[k].start), len(own))
    order = own[first:behind]
    wrong = [part for part in order[:-1] if part.end]
    return _proof(order, wrong, (END_BIT, EVERY_END), expected)


def _starts(own: Sequence[Part], at: int, expected: KnownType) -> Proof | None:
    """Look from behind an end to the next one, with starts in between."""
    first = next((k for k in range(at, 0, -1) if own[k - 1].end), 0)
    last = next((k for k in range(at, len(own)) if own[k].end), len(own) - 1)
    order = own[first : last + 1]
    wrong = [part for part in order[1:] if part.start]
    return _proof(order, wrong, (START_BIT, EVERY_START), expected)


def _proof(order: Sequence[Part], wrong: Sequence[Part], what: tuple[str, str], expected: KnownType) -> Proof | None:
    """Prove one wrong bit, or the same in every frame."""
    if not wrong or not order[0].start or not _alternate(order) or not expected.fits(order):
        return None
    one, every = what
    if len(wrong) == 1:
        return Proof(Cause(one, f" (frame {wrong[0].number + 1})"), order)
    return Proof(Cause(every), order) if len(wrong) == len(order) - 1 else None


def _other_id(parts: Sequence[Part], near: Sequence[Part], expected: KnownType) -> Proof | None:
    """Look for a first frame, and behind it the rest of a transfer with another ID, or with one more in each frame."""
    at = next(k for k, part in enumerate(near) if part.number == parts[0].number)
    first = next((k for k in range(at, -1, -1) if near[k].start), 0)
    end = next((k for k in range(first + 1, len(near)) if near[k].end or near[k].start), first)
    order = near[first : end + 1]
    begins = [part.start for part in order] == [True] + [False] * (end - first)
    if first == end or not begins or order[0].end or not _alternate(order) or not expected.fits(order):
        return None
    ids = [part.transfer_id for part in order]
    if len(ids) > 2 and all((after - one) % TRANSFER_IDS == 1 for one, after in pairwise(ids)):
        return Proof(Cause(EVERY_ID), order)
    apart = order[0] not in parts if not parts[0].start else len(parts) == 1
    if not apart or ids[0] == ids[1] or len({*ids[1:]}) > 1:
        return None
    other = f" or {order[1].number + 1}" if len(order) == 2 else ""  # nobody knows which
    return Proof(Cause(OTHER_ID, f" in frame {order[0].number + 1}{other}"), order)


def _alternate(order: Sequence[Part]) -> bool:
    return all(part.toggle == bool(k & 1) for k, part in enumerate(order))
