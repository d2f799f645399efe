"""The frames of a transfer that are missing, as far as toggles, the type's length and the sender's habit tell."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from analyzer.rules.diagnosis.proofs import END_BIT, START_BIT, UNPROVEN, Cause, break_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.diagnosis.proofs import KnownType, Part

LOST, LOST_SEVERAL = "one frame lost", "several frames lost"
LOST_ODD = "an odd number of frames lost"  # one, most likely; the toggles cannot tell
FIRST, FIRSTS = "first frame lost", "first frames lost"
LAST, LASTS = "last frame lost", "last frames lost"
NO_ORDER = "its frames fit in no order"
TOO_MANY = "more frames than the type has"


def missing(parts: Sequence[Part], expected: KnownType) -> Cause | None:
    """Return what is missing of a broken transfer, or of what is left of one; None if nothing shows that anything is.

    Args:
        parts: its frames, in the order in which they came; no order of them has the right CRC.
        expected: what is known of its type.
    """
    return _alone(parts, expected) or _gone(parts, expected)


def _gone(parts: Sequence[Part], expected: KnownType) -> Cause | None:
    breaks = sum(one.toggle == after.toggle for one, after in pairwise(parts))
    totals = _totals(parts, breaks, expected)
    total = totals.pop() if len(totals) == 1 else None
    gone = None if total is None else total - len(parts)
    if gone is not None and gone < 0:
        return Cause(TOO_MANY, f" ({len(parts)} instead of {total})")
    if not parts[0].start:
        return _without_start(parts, breaks, gone)
    if breaks:
        return _with_breaks(parts, breaks, gone, expected)
    if not parts[-1].end:
        return _without_end(parts, gone, expected)
    if gone and total is not None:
        return Cause(LOST_SEVERAL, f" ({gone} of {total})")
    return None


def _alone(parts: Sequence[Part], expected: KnownType) -> Cause | None:
    """Return the start or end bit of a transfer in one frame, which has no CRC: nothing but its length tells."""
    if len(parts) != 1 or parts[0].toggle or parts[0].start == parts[0].end:
        return None
    (part,) = parts
    if expected.size is not None:
        by_length = expected.frames() == 1 and len(part.body) == expected.size
    else:
        by_length = len(part.body) in expected.singles and not expected.lengths
    if not by_length:
        return None
    return Cause(END_BIT if part.start else START_BIT, f" (frame {part.number + 1})")


def _totals(parts: Sequence[Part], breaks: int, expected: KnownType) -> set[int]:
    """Return how many frames it may have had."""
    fixed = expected.frames()
    if fixed is not None:
        return {fixed}
    first, last = parts[0], parts[-1]
    known = {n for n, size in expected.lengths if not last.end or size == len(last.body)}
    if first.start and last.end:
        if not breaks and (len(parts), len(last.body)) in expected.lengths:
            return set()  # it is as long as others are
        return {n for n in known if n - len(parts) >= breaks and (n - len(parts) - breaks) % 2 == 0}
    odd = last.end and not first.start and first.toggle
    least = len(parts) + max(breaks, 1)
    return {n for n in known if n >= least and (not last.end or first.start or (n - len(parts)) % 2 == odd or breaks)}


def _with_breaks(parts: Sequence[Part], breaks: int, gone: int | None, expected: KnownType) -> Cause:
    """Return the cause if toggles do not alternate: between two equal ones an odd number of frames is missing."""
    where = ordinal(break_at(parts) + 1)
    if gone is not None and gone < breaks:
        # Nothing is missing at its end, or nobody can tell.
        return Cause(NO_ORDER) if parts[-1].end else Cause(LOST_SEVERAL, f" (from the {where} on)")
    if gone is None:
        if not expected.starts:
            return Cause(UNPROVEN)
        if breaks > 1:
            return Cause(LOST_SEVERAL, f" (at least {breaks}, from the {where} on)")
        return Cause(LOST_ODD, f" (from the {where} on)")
    total = len(parts) + gone
    if gone > 1:
        return Cause(LOST_SEVERAL, f" ({gone} of {total}, from the {where} on)")
    return Cause(LOST, f" (the {where} of {total})")


def _without_end(parts: Sequence[Part], gone: int | None, expected: KnownType) -> Cause:
    if gone is None:
        return Cause(LASTS, f" (from the {ordinal(len(parts) + 1)} on)")
    total = len(parts) + gone
    if gone == 1:
        return Cause(LAST, f" (the {ordinal(total)} of {total})")
    if gone > 1:
        return Cause(LASTS, f" (the {ordinal(len(parts) + 1)} to {ordinal(total)} of {total})")
    return Cause(NO_ORDER if expected.starts else UNPROVEN)


def _without_start(parts: Sequence[Part], breaks: int, gone: int | None) -> Cause:
    if breaks:
        return Cause(LOST_SEVERAL, ", the first one too")
    if gone is None or gone < 1 or not parts[-1].end:
        return Cause(FIRST if parts[0].toggle else FIRSTS)
    if gone == 1:
        return Cause(FIRST, f" (of {1 + len(parts)})")
    return Cause(FIRSTS, f" ({gone} of {gone + len(parts)})")


def ordinal(number: int) -> str:
    """Return `1st`, `2nd`, `3rd`, `4th`, and so on."""
    ending = "th" if number % 100 in {11, 12, 13} else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"
