"""How the clocks of several captures relate: as a person says, or as frames show that two of them saw."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from analyzer._native import Fingerprint
from analyzer.sources.errors import CaptureError, MergeError
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.sources import Source

# Clocks this close count as one clock, in nanoseconds.
SAME_CLOCK = 20_000_000
# Times below this (1973) count from a start, not from 1970.
_CLOCK_FROM = 100_000_000 * 1_000_000_000


def align(
    looks: Sequence[Source], offsets: dict[int, int], stopped: Callable[[], bool] = lambda: False
) -> dict[int, tuple[int, int]]:
    """Read every capture once and compare; `offsets` are the nanoseconds given already, by capture.

    Returns for each capture whose clock was found by comparison the nanoseconds to add and the number of frames that
    say so; nothing once `stopped` is true. Raises `MergeError` when a capture has no times, or times that relate to no
    other's.
    """
    found: dict[int, tuple[int, int]] = {}
    prints: list[Fingerprint] = []
    relative = False
    for index, look in enumerate(looks):
        seen, frames = fingerprint(look, stopped)
        if stopped():
            return {}
        if frames and seen.start is None:
            raise MergeError(f"{look.name} has no times: it cannot be merged with other captures")
        relative |= seen.start is not None and seen.start + offsets.get(index, 0) < _CLOCK_FROM
        if index not in offsets:
            meetings = ((earlier, other.meet(seen)) for earlier, other in enumerate(prints))
            earlier, met = next(((e, m) for e, m in meetings if m is not None), (0, None))
            if met is not None:
                base = offsets.get(earlier, 0) + found.get(earlier, (0, 0))[0]
                if abs(met[0] + base) > SAME_CLOCK:
                    found[index] = met[0] + base, met[1]
            elif relative and frames and any(other.start is not None for other in prints):
                raise MergeError(
                    f"{look.name} and {looks[0].name} do not count from one clock and share no frames that could tell: "
                    f"give --offset {PurePath(look.name).name}=+1.5s"
                )
        prints.append(seen)
    return found


def fingerprint(source: Source, stopped: Callable[[], bool]) -> tuple[Fingerprint, int]:
    """Return what makes the frames of a capture known again, and how many they are."""
    seen, frames = Fingerprint(), 0
    try:
        for batch in rows(source.chunks()):
            if stopped():
                break
            if not isinstance(batch, bytes):
                seen.add(batch)
                frames += batch.frames
    except CaptureError:
        pass  # the reading proper says so
    return seen, frames
