"""The way of an ESC without throttle: it holds the last one, then goes to zero (4.4.1 explanation 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.kit import MILLISECOND, NO_TIME, SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array, Occurrence

STILL = 60  # rpm: a motor that is slower stands
_VAGUE = 100 * MILLISECOND
_KEEPS = 0.9  # of its speed: a motor that is faster still has its throttle


class Sample(NamedTuple):
    """One report: time, rpm, throttle in %, A."""

    t: int
    rpm: int
    pct: float
    current: float


class Samples(NamedTuple):
    """Many of them, in order."""

    t: Array
    rpm: Array
    pct: Array
    current: Array

    def each(self, first: int, stop: int) -> list[Sample]:
        """Return some of them one by one."""
        return list(map(Sample._make, zip(*(column[first:stop].tolist() for column in self), strict=True)))

    def take(self, rows: Array) -> Samples:
        """Return some of them."""
        return Samples(*(column[rows] for column in self))


@dataclass(slots=True)
class Hold:
    """One loss of throttle of one ESC.

    `since` is the time of the last valid throttle, `base` the last report before. A silence of the bus that is longer
    than `spare` is none of the ESC's. What it had is `gone` with the first report of zero throttle (at a lower speed if
    it tells no throttle), `had` is the time of the report before; `still` is when it stands. `place` says
    where it is told, once: at a report of this batch, or as what it was in its own; None: it is told, or is not worth
    that.
    """

    since: int
    base: Sample
    spare: int
    place: int | Occurrence | None = None
    had: int = NO_TIME
    gone: int = NO_TIME
    still: int = NO_TIME
    last: Sample = field(init=False)
    over: bool = False  # it has lasted so long that no ESC may hold any more

    def __post_init__(self) -> None:
        """Begin with the report before the loss."""
        self.last = self.base

    @property
    def rests(self) -> bool:
        """There was nothing to hold: the motor stood, without throttle."""
        return abs(self.base.rpm) <= STILL and not self.base.pct

    def feed(self, some: Sequence[Sample]) -> None:
        """Add the next reports."""
        last = self.last
        for one in some if NO_TIME in (self.gone, self.still) else some[-1:]:
            speed = abs(one.rpm)
            if self.gone == NO_TIME:
                lost = one.pct == 0 if self.base.pct else speed < _KEEPS * abs(self.base.rpm)
                self.had, self.gone = (last.t, one.t) if lost else (one.t, NO_TIME)
            if self.still == NO_TIME and speed <= STILL:
                self.still = one.t
            last = one
        self.last = last

    def course(self, end: str, pwm: str) -> str:
        """Say what it did: how long it held what, whether it went to zero and stood.

        Args:
            end: what ended the loss.
            pwm: what took over, empty for nothing.
        """
        what = f"held {self.base.pct:.0f} %" if self.base.pct else f"kept {self.base.rpm} rpm"
        if pwm:
            return f"{what}, then {pwm}"
        if self.gone == NO_TIME:
            return f"{what} for {_seconds(self.last.t - self.since)}, {end}"
        long = _seconds(self.gone - self.since)
        if self.gone - self.had > _VAGUE:  # nobody knows when
            long = f"{_seconds(max(self.had - self.since, 0))} to {long}"
        gone = "went to zero" if self.base.pct else "slowed down"
        rest = f"still {self.last.rpm} rpm after {_seconds(self.last.t - self.since)}, {end}"
        if self.still != NO_TIME:
            rest = f"stood still after {_seconds(self.still - self.since)}"
        return f"{what} for {long}, then {gone}; {rest}"


def _seconds(ns: int) -> str:
    return f"{ns / MILLISECOND:.0f} ms" if ns < SECOND else f"{ns / SECOND:.1f} s"
