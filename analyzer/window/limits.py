"""The limits of a window as people write them: `--from --to --last --around --frames`."""

from __future__ import annotations

import re
from datetime import UTC, datetime, time, timedelta
from typing import Literal

from dissectors.records import dataclass
from dissectors.times import SECOND

AROUND = SECOND
_UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": SECOND, "min": 60 * SECOND, "h": 3600 * SECOND}
# A time of day that was over longer than this when the capture starts is the next day's.
_ROUNDED = 3600 * SECOND
# A bare number below this counts seconds from the first frame, above it seconds since 1970.
_EPOCH_FROM = 100_000_000


def duration(text: str) -> int:
    """Return `10`, `10s`, `250ms` or `1.5min` in nanoseconds. Raises ValueError."""
    match = re.fullmatch(r"(\d{1,30}(?:\.\d+)?)\s*([a-z]*)", text.strip())
    unit = _UNITS.get(match[2] or "s") if match else None
    if match is None or unit is None:
        raise ValueError(f"{text!r} is not a duration (10s, 250ms, 1.5min)")
    return _scaled(match[1], unit)


def _scaled(text: str, unit: int) -> int:
    whole, _, fraction = text.partition(".")
    digits = (fraction or "0")[:12]
    return int(whole) * unit + int(digits) * unit // int("1" + "0" * len(digits))


@dataclass(frozen=True, slots=True)
class Moment:
    """A time as a person writes it; nanoseconds once the first frame's time is known."""

    kind: Literal["since start", "absolute", "of day"]
    ns: int

    @classmethod
    def parse(cls, text: str) -> Moment:
        """Read seconds from the first frame or since 1970, `12:49:54.89` (local) or `2026-03-14T12:49:54Z`.

        Raises ValueError.
        """
        text = text.strip()
        if re.fullmatch(r"\d+(\.\d+)?(s|ms|us|min|h)?", text):
            ns = duration(text)
            return cls("absolute" if ns >= _EPOCH_FROM * SECOND else "since start", ns)
        clock, fraction = _NUMBER_TAIL.sub("", text), _NUMBER_TAIL.search(text)
        extra = _scaled("0" + fraction[0], SECOND) if fraction else 0
        try:
            if "-" not in text:
                day = time.fromisoformat(_NO_ZONE.sub("?", clock))
                return cls("of day", ((day.hour * 60 + day.minute) * 60 + day.second) * SECOND + extra)
            stamp = datetime.fromisoformat(clock).astimezone(UTC)
            return cls("absolute", int(stamp.timestamp()) * SECOND + extra)
        except (ValueError, OverflowError):
            raise ValueError(f"{text!r} is not a time (12.5, 12:49:54.890 or 2026-03-14T12:49:54)") from None

    def at(self, start: int) -> int:
        """Return nanoseconds since 1970 in a capture whose first frame has the time `start`."""
        if self.kind == "absolute":
            return self.ns
        if self.kind == "since start":
            return start + self.ns
        day = datetime.fromtimestamp(start // SECOND)  # noqa: DTZ006 - a person's time of day is local
        for date in (day.date(), day.date() + timedelta(days=1)):
            clock = datetime.combine(date, time()) + timedelta(seconds=self.ns // SECOND)
            moment = int(clock.timestamp()) * SECOND + self.ns % SECOND
            if moment >= start - _ROUNDED:
                break
        return moment

    def fits(self, start: int) -> bool:
        """Return whether a capture that starts at `start` has such times: relative ones have no date."""
        return self.kind == "since start" or start >= _EPOCH_FROM * SECOND


_NUMBER_TAIL = re.compile(r"\.\d+")
_NO_ZONE = re.compile(r"[Zz+]")  # a time of day is local; of another zone it would need a date


@dataclass(frozen=True, slots=True)
class Window:
    """The limits asked for; all that are given must hold.

    `frames` are frame numbers from 1, both included. `around` is a frame number or a moment, `margin` the time to each
    side of it.
    """

    start: Moment | None = None
    stop: Moment | None = None
    last: int | None = None
    around: int | Moment | None = None
    margin: int = AROUND
    frames: tuple[int, int] | None = None

    def __bool__(self) -> bool:
        """Return whether anything at all is left out."""
        return self != Window()

    @property
    def leaves_off(self) -> bool:
        """True if the end of the capture may be outside."""
        return any(limit is not None for limit in (self.stop, self.around, self.frames))

    @property
    def cuts_in(self) -> bool:
        """True if the beginning of the capture may be outside."""
        later = any(limit is not None for limit in (self.start, self.last, self.around))
        return later or (self.frames is not None and self.frames[0] > 1)

    @property
    def timed(self) -> bool:
        """True if times are asked for, which not every capture has."""
        return any(isinstance(limit, Moment) for limit in (self.start, self.stop, self.around)) or self.last is not None
