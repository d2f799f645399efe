"""A capture on buses once more: its frames at their times, faster, slower, or without long silences."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from analyzer.tables import BRS, ESI, EXTENDED, FD, REMOTE
from dissectors.kit.cells import numbers
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from fractions import Fraction

    import pyarrow as pa

    from analyzer.live.replay.outlet import Outlet
    from analyzer.live.replay.sender import Pacer

# A time that is before the one in front of it by no more than this is out of order; by more, a clock was set back.
_DISORDER = SECOND // 100
# Flags hold the length that a remote frame asks for from this bit on.
_LENGTH = 8


class RouteError(Exception):
    """It is not clear where frames are to go."""


@dataclass(slots=True, eq=False)
class ReplayFrame:
    """A frame with its time (ns) from the start of the replay; `bus` is the number of the outlet it is for."""

    t: int
    bus: int
    id: int
    data: bytes
    extended: bool
    remote: bool
    fd: bool
    brs: bool
    esi: bool
    dlc: int


@dataclass(frozen=True, slots=True)
class ReplayBatch:
    """Some frames of a capture in their order (columns of `FRAMES`), with the names of its buses.

    `error_frames` and `lost` (frames that the recording says it has lost) stand among them.
    """

    frames: pa.RecordBatch
    buses: Sequence[str]
    error_frames: int = 0
    lost: int = 0


class Timeline:
    """Times of a capture as times of its replay.

    A frame without a time, or with one before that of the frame in front of it, comes right behind that; both are
    counted. If the clock of the recording was set back, times go on from there.

    Args:
        speed: how many times faster than the capture.
        longest: silences of the capture are shortened to this many ns; None keeps them.
    """

    def __init__(self, speed: Fraction, longest: int | None) -> None:
        self.backwards = self.timeless = 0
        self._speed, self._longest = speed, longest
        self._length = 0
        self._newest: int | None = None

    def restart(self) -> None:
        """Begin anew: the next frame comes right behind the last one, whatever its time."""
        self._newest = None

    def at(self, t: int | None) -> int:
        """Return when (ns) a frame comes that has the time `t` in the capture."""
        if t is None:
            self.timeless += 1
        elif self._newest is None:
            self._newest = t
        elif t < self._newest:
            self.backwards += 1
            if self._newest - t > _DISORDER:
                self._newest = t
        else:
            silence = t - self._newest
            self._length += silence if self._longest is None else min(silence, self._longest)
            self._newest = t
        return self._length * self._speed.denominator // self._speed.numerator

    def recorded(self, t: int) -> int:
        """Return how much of the capture (ns) has been played at a time of the replay."""
        return t * self._speed.numerator // self._speed.denominator


class Routes:
    """Which outlets (by number) the frames of a bus go to.

    `maps` names the outlets of each bus. None as a name is the capture's only bus, whatever it is called.
    """

    def __init__(self, maps: Mapping[str | None, Sequence[int]]) -> None:
        self._maps = dict(maps)
        self._only: str | None = None

    def check(self, buses: Sequence[str]) -> None:
        """Raise `RouteError` unless these buses, all that the capture has, are what the maps are about."""
        for bus in buses:
            self.of(bus)
        if unknown := next((name for name in self._maps if name is not None and name not in buses), None):
            raise RouteError(f"no frames of {unknown} (there is {', '.join(sorted(buses))})")

    def of(self, bus: str) -> Sequence[int]:
        """Return the outlets for the frames of this bus. Raises `RouteError` for a second bus without maps."""
        if None not in self._maps:
            return self._maps.get(bus, ())
        if self._only not in (None, bus):
            raise RouteError(
                f"several buses ({self._only}, {bus}, ...): name what goes where, as in vcan0={self._only}"
            )
        self._only = bus
        return self._maps[None]


class Player:
    """Sends the frames of a capture on their outlets.

    `sent` counts frames, `left_out` those that go nowhere, in words, `position` is the time (ns) of the last one sent.
    After `most` frames it ends.
    """

    def __init__(
        self, outlets: Sequence[Outlet], routes: Routes, timeline: Timeline, pace: Pacer, most: int | None = None
    ) -> None:
        self.sent = self.position = 0
        self.left_out: Counter[str] = Counter()
        self._outlets, self._routes, self._timeline, self._pace = outlets, routes, timeline, pace
        self._most = most

    def play(self, rounds: Iterable[Iterable[ReplayBatch]]) -> None:
        """Send what there is, round after round. Raises `RouteError`, `ActuationError` and `InterfaceError`."""
        for frame in self._pace.over(self._frames(rounds)):
            if self._outlets[frame.bus].send(frame, esi=frame.esi):
                self.sent += 1
                self.position = frame.t
            if self.sent == self._most:
                return

    def _frames(self, rounds: Iterable[Iterable[ReplayBatch]]) -> Iterator[ReplayFrame]:
        for parts in rounds:
            self._timeline.restart()
            frames = 0
            for part in parts:
                frames += len(part.frames)
                self.left_out["error frames, which only a controller makes"] += part.error_frames
                self.left_out["frames that the recording has lost"] += part.lost
                yield from self._played(part)
            if not frames:  # nor would there be any in the next round
                return

    def _played(self, part: ReplayBatch) -> Iterator[ReplayFrame]:
        frames = part.frames
        times = frames.column("t").cast("int64").to_pylist()
        columns = (numbers(frames.column(name)).tolist() for name in ("bus", "id", "flags"))
        routes: dict[int, Sequence[int]] = {}
        for t, bus, number, flags, data in zip(times, *columns, frames.column("data").to_pylist(), strict=True):
            to = routes.get(bus)
            if to is None:
                to = routes[bus] = self._routes.of(part.buses[bus])
            if not to:
                self.left_out[f"frames of {part.buses[bus]}, which no map names"] += 1
                continue
            at = self._timeline.at(t)
            for outlet in to:
                yield ReplayFrame(
                    at,
                    outlet,
                    number,
                    data,
                    extended=bool(flags & EXTENDED),
                    remote=bool(flags & REMOTE),
                    fd=bool(flags & FD),
                    brs=bool(flags & BRS),
                    esi=bool(flags & ESI),
                    dlc=flags >> _LENGTH & 0xF if flags & REMOTE else len(data),
                )
