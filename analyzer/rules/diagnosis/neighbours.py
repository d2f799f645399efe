"""The frames of a session around a broken transfer, and which of them belong to whole ones.

All is read from the bytes of a fixed stretch of frames, so that it does not depend on how a capture is cut.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis.proofs import LATE_COPY, Cause, KnownType, Part
from analyzer.tables import ERROR, EXTENDED, REMOTE, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE, TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND, SESSION
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dissectors.kit import Kept, View

LOOK = 64  # frames before and behind a transfer among which its own may have strayed
AHEAD = 512  # frames behind it that show what the sender's other transfers are like
BEFORE = 2048  # frames before it that do
_MOST = 48  # frames of the session before it, and as many behind it
WIDEST = 8192  # frames from the first to the last of a transfer that is looked into
TIMEOUT = 2 * SECOND  # frames that are further apart than this belong to no common transfer
MOST_KNOWN = 8192  # frames that are remembered
_UNSTEADY = 2  # toggles that stand still by habit, not by accident
_NOTHING: tuple[list[Part], list[int]] = ([], [])


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


def late_copy(numbers: Sequence[int]) -> Cause:
    """Return the cause of frames that came before with these numbers."""
    which = "frame" if len(numbers) == 1 else "frames"
    return Cause(LATE_COPY, f" of {which} {', '.join(str(number + 1) for number in numbers)}")


def part_of(number: int, kept: Kept | None) -> Part | None:
    """Return a frame of the recent past with its tail byte apart; None without one."""
    return Part(number, kept.data[-1], kept.data[:-1]) if kept is not None and kept.data else None


def parts_of(view: View, frames: Iterable[int]) -> list[Part]:
    """Return frames of the recent past; those that are gone are left out."""
    return [part for part in (part_of(number, view.frame(number)) for number in frames) if part]


class NeighbourFinder:
    """Looks around; remembers frames, as broken transfers seldom come alone."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Part, int] | None] = {}
        self._right: dict[tuple[int, ...], bool] = {}

    def of(self, view: View, frames: Sequence[int], code: int, *, fd: bool) -> Neighbours | None:
        """Return what is around frames of one session and type; None if they are gone or too far apart."""
        parts, first = parts_of(view, frames), view.frame(frames[0])
        if first is None or len(parts) != len(frames) or frames[-1] - frames[0] > WIDEST:
            return None
        session = self._session(view, frames[0], frames[-1], first)
        every = [part for part, _ in session]
        starts = [crc_start(signature) for signature in view.types.signatures(code)]
        expected = KnownType(starts, view.types.fixed_bytes(code), fd)
        whole, settled = self._whole(every, expected)
        times = [t for part, t in session if frames[0] <= part.number <= frames[-1] and t != NO_TIME]
        low, high = (min(times) - TIMEOUT, max(times) + TIMEOUT) if times else (NO_TIME, NO_TIME)
        near = [part for part, t in session if NO_TIME in (t, low) or low <= t <= high]
        singles = frozenset(len(part.body) for part in every if part.start and part.end and not part.toggle)
        right = [run for run in whole if not starts or run[0].number in settled]
        lengths = frozenset((len(run), len(run[-1].body)) for run in right)
        return Neighbours(parts, near, whole, settled, expected._replace(lengths=lengths, singles=singles))

    def _session(self, view: View, first: int, last: int, like: Kept) -> list[tuple[Part, int]]:
        """Return frames with the session of another one, and their times.

        From some before `first` to some behind `last`.
        """
        bits = like.id & SESSION
        before = [*islice(view.numbers_before(first, BEFORE, like.bus, bits), _MOST)][::-1]
        inside = view.numbers_between(first, last + 1, like.bus, bits)
        behind = view.numbers_between(last + 1, last + 1 + AHEAD, like.bus, bits)[:_MOST]
        if len(self._known) > MOST_KNOWN:
            self._known.clear()
        numbers = (*before, *inside, *behind)
        known = self._known
        for number in numbers:
            if number not in known:
                known[number] = _part(view, number)
        return [one for one in map(known.__getitem__, numbers) if one is not None]

    def _whole(self, near: Sequence[Part], expected: KnownType) -> tuple[list[list[Part]], frozenset[int]]:
        """Return runs from start to end with right toggles, and the frames of those (and copies) whose CRC is right."""
        runs: list[list[Part]] = []
        settled: set[int] = set()
        under_way: dict[int, tuple[list[Part], list[int]]] = {}
        for part in near:
            number, tail, body = part
            transfer_id = tail & TAIL_ID
            run, numbers = under_way.get(transfer_id, _NOTHING)
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
                    if not expected.starts or self._fits(run, expected):
                        settled.update(numbers)
                    del under_way[transfer_id]
            else:
                under_way.pop(transfer_id, None)
        return runs, frozenset(settled)

    def _fits(self, run: Sequence[Part], expected: KnownType) -> bool:
        """Return whether the CRC of a run is right; who asks for one asks for those around it again."""
        key = tuple(part.number for part in run)
        if key not in self._right:
            if len(self._right) > MOST_KNOWN:
                self._right.clear()
            self._right[key] = expected.fits(run)
        return self._right[key]


def _part(view: View, number: int) -> tuple[Part, int] | None:
    """Return a data frame and its time."""
    kept = view.frame(number)
    part = part_of(number, kept)
    plain = kept is not None and kept.flags & (EXTENDED | REMOTE | ERROR) == EXTENDED
    return (part, kept.t) if kept is not None and part is not None and plain else None
