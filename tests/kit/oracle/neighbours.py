"""The frames of a session around a broken transfer, which of them belong to whole ones, and which are missing.

All is read from the bytes of a fixed stretch of frames, so that it does not depend on how a capture is cut.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis.causes import (
    END_BIT,
    FIRST,
    FIRSTS,
    LAST,
    LASTS,
    LOST,
    LOST_ODD,
    LOST_SEVERAL,
    NO_ORDER,
    START_BIT,
    TOO_MANY,
    UNPROVEN,
    Cause,
    late_copy,
    ordinal,
)  # fmt: skip
from analyzer.tables import TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE, TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND
from kit.oracle.proofs import KnownType, Part, break_at

if TYPE_CHECKING:
    from collections.abc import Sequence

LOOK = 64  # frames before and behind a transfer among which its own may have strayed
AHEAD = 512  # frames behind it that show what the sender's other transfers are like
BEFORE = 2048  # frames before it that do
_MOST = 48  # frames of the session before it, and as many behind it
WIDEST = 8192  # frames from the first to the last of a transfer that is looked into
TIMEOUT = 2 * SECOND  # frames that are further apart than this belong to no common transfer
_UNSTEADY = 2  # toggles that stand still by habit, not by accident


class Neighbours(NamedTuple):
    """The surroundings of a broken transfer.

    Frames of its session in order, and the whole transfers of more than one frame.
    `near` are those within 2.0 s, `settled` the numbers of those that belong to transfers with the right CRC.
    """

    parts: Sequence[Part]
    near: Sequence[Part]
    whole: Sequence[Sequence[Part]]
    settled: frozenset[int]
    expected: KnownType

    def around(self) -> list[Part]:
        """Return frames that may belong to it, though they are of no whole transfer.

        They have its ID, or another one and stand inside, or behind it if it has no end.
        """
        low, high, own = self.parts[0].number, self.parts[-1].number, {part.number for part in self.parts}
        mine, found = self.parts[0].transfer_id, []
        others = (part for part in self.near if part.number > high and part.transfer_id != mine)
        last = None if self.parts[-1].end else next(others, None)
        for part in self.near:
            number = part.number
            if number in own or number in self.settled or not low - LOOK <= number <= high + LOOK:
                continue
            if part.transfer_id == mine or (not part.start and (low < number < high or part is last)):
                found.append(part)
        return found

    def copy(self) -> Cause | None:
        """Return the cause if a whole transfer before it had each of its frames, byte for byte."""
        first = self.parts[0].number
        known = {part[1:]: part.number for part in self.near if part.number < first and part.number in self.settled}
        found = [known.get(part[1:]) for part in self.parts]
        return late_copy([number for number in found if number is not None]) if None not in found else None

    def misnumbered(self, order: Sequence[Part]) -> list[Part]:
        """Return the frame of two with different transfer IDs whose ID is wrong, both if nobody knows.

        Right is the ID that follows that of the transfer before them, or is followed by that of the one behind them.
        """
        first, second = order
        starts = [part for part in self.near if part.start and (part.end or part.number in self.settled)]
        before = next((part.transfer_id for part in reversed(starts) if part.number < first.number), None)
        behind = next((part.transfer_id for part in starts if part.number > second.number), None)
        near = {None if before is None else (before + 1) % TRANSFER_IDS}
        near |= {None if behind is None else (behind - 1) % TRANSFER_IDS}
        wrong = [part for part in order if part.transfer_id not in near]
        return wrong if len(wrong) == 1 else [*order]

    def unsteady(self) -> bool:
        """Return whether toggles stand still in other transfers of the session too."""
        own, last, breaks = {part.number for part in self.parts}, dict[int, Part](), 0
        for part in self.near:
            before = last.get(part.transfer_id)
            if before is not None and not part.start and part.number not in own and part[1:] != before[1:]:
                breaks += part.toggle == before.toggle
            last[part.transfer_id] = part
        return breaks >= _UNSTEADY


class Frame(NamedTuple):
    """A frame of one session, with its number in the capture."""

    number: int
    t: int
    data: bytes
    plain: bool = True

    @property
    def part(self) -> Part:
        """It with its tail byte apart."""
        return Part(self.number, self.data[-1], self.data[:-1])


def look_around(frames: Sequence[Frame], wanted: Sequence[int], expected: KnownType) -> Neighbours | None:
    """Return what is around frames of the session `frames`; None if they are gone or too far apart."""
    first, last = wanted[0], wanted[-1]
    by_number = {frame.number: frame for frame in frames}
    parts = [by_number[number].part for number in wanted if number in by_number and by_number[number].data]
    if len(parts) != len(wanted) or last - first > WIDEST:
        return None
    session = [(frame.part, frame.t) for frame in _session(frames, first, last) if frame.plain and frame.data]
    every = [part for part, _ in session]
    whole, settled = _whole(every, expected)
    times = [t for part, t in session if first <= part.number <= last and t != NO_TIME]
    low, high = (min(times) - TIMEOUT, max(times) + TIMEOUT) if times else (NO_TIME, NO_TIME)
    near = [part for part, t in session if NO_TIME in (t, low) or low <= t <= high]
    singles = frozenset(len(part.body) for part in every if part.start and part.end and not part.toggle)
    right = [run for run in whole if not expected.starts or run[0].number in settled]
    lengths = frozenset((len(run), len(run[-1].body)) for run in right)
    return Neighbours(parts, near, whole, settled, expected._replace(lengths=lengths, singles=singles))


def _session(frames: Sequence[Frame], first: int, last: int) -> list[Frame]:
    """Return frames from some before `first` to some behind `last`."""
    before = [frame for frame in frames if first - BEFORE <= frame.number < first][-_MOST:]
    inside = [frame for frame in frames if first <= frame.number <= last]
    behind = [frame for frame in frames if last < frame.number <= last + AHEAD][:_MOST]
    return [*before, *inside, *behind]


def _whole(near: Sequence[Part], expected: KnownType) -> tuple[list[list[Part]], frozenset[int]]:
    """Return runs from start to end with right toggles, and the frames of those (and copies) whose CRC is right."""
    runs: list[list[Part]] = []
    settled: set[int] = set()
    under_way: dict[int, tuple[list[Part], list[int]]] = {}
    for part in near:
        number, tail, body = part
        transfer_id = tail & TAIL_ID
        run, numbers = under_way.get(transfer_id, ([], []))
        if run and tail == run[-1].tail and body == run[-1].body:
            numbers.append(number)
        elif tail & TAIL_START:
            under_way.pop(transfer_id, None)
            if tail & TAIL_END:
                settled.add(number)
            elif not tail & TAIL_TOGGLE:
                under_way[transfer_id] = [part], [number]
        elif run and (tail ^ run[-1].tail) & TAIL_TOGGLE:
            run.append(part)
            numbers.append(number)
            if tail & TAIL_END:
                runs.append(run)
                if not expected.starts or expected.fits(run):
                    settled.update(numbers)
                del under_way[transfer_id]
        else:
            under_way.pop(transfer_id, None)
    return runs, frozenset(settled)


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
