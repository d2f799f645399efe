"""Time columns as tshark's `-t` has them, from exact integer nanoseconds."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import raw_times
from dissectors.kit.cells import numbers, valid
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    Time = int | None


MODES = {
    "a": "time of day, local",
    "ad": "date and time of day, local",
    "d": "seconds since the previous transfer",
    "dd": "seconds since the previous transfer shown",
    "e": "seconds since 1970-01-01 00:00 UTC",
    "r": "seconds since the first frame",
    "u": "time of day, UTC",
    "ud": "date and time of day, UTC",
}
_DAY = {"a": "%H:%M:%S", "u": "%H:%M:%S", "ad": "%Y-%m-%d %H:%M:%S", "ud": "%Y-%m-%d %H:%M:%S"}
_HEADS = {"a": "Time", "u": "UTC", "ad": "Date, time", "ud": "Date, time UTC", "d": "Delta [s]", "dd": "Delta [s]"}


class TimeFormat:
    """Writes times in one of `MODES`; keeps what the next batch needs.

    Args:
        mode: a key of `MODES`.
        zero: nanoseconds that count as 0 in mode `r`; the first time seen if not given. Given, signs are always shown.
        digits: decimals, 6 or 9; if not given, 9 when the first batch has times between microseconds.
    """

    def __init__(self, mode: str = "r", zero: Time = None, digits: int | None = None) -> None:
        if mode not in MODES:
            raise ValueError(f"no time format {mode!r} (one of: {', '.join(MODES)})")
        self.mode = mode
        self.zero = zero
        self.digits = digits
        self.signed = zero is not None
        self._before: Time = None
        self._shown: Time = None

    @property
    def head(self) -> str:
        """Title of the column."""
        return _HEADS.get(self.mode, "Time [s]")

    def start(self, frames: pa.RecordBatch) -> None:
        """Settle the zero and the decimals by the first frames of a capture; later calls change nothing."""
        if self.zero is not None and self.digits is not None:
            return
        times = [t for t in raw_times(frames.column("t")) if t is not None]
        if not times:
            return
        if self.zero is None:
            self.zero = times[0]
        if self.digits is None:
            self.digits = 9 if any(t % 1000 for t in times) else 6

    def column(self, times: Sequence[Time], picked: Sequence[int] | None = None) -> list[str]:
        """Return texts of the `picked` rows (all if not given) among the `times` of a batch's rows; "" if unknown."""
        rows = range(len(times)) if picked is None else picked
        if self.mode == "d":
            return self._since_previous(times, rows)
        if self.mode == "dd":
            return [self._since_shown(times[row]) for row in rows]
        return [self.text(times[row]) for row in rows]

    def text(self, t: Time) -> str:
        """Write one time; a delta mode gives the seconds of `t` itself."""
        if t is None:
            return ""
        if self.mode in _DAY:
            second, ns = divmod(t, SECOND)
            return f"{_day(second, _DAY[self.mode], self.mode[0] == 'u')}.{self._decimals(ns)}"
        if self.mode == "r":
            return self.seconds(t - (self.zero or 0), signed=self.signed)
        return self.seconds(t)

    def elapsed(self, times: pa.Array) -> pa.Array:
        """Return nanoseconds that `seconds` writes, in a mode of seconds since something, of all rows of a batch."""
        known, ns = valid(times), numbers(times)
        if self.mode == "d":
            ns = np.zeros(len(times), np.int64)
            ns[known] = np.diff(numbers(times)[known], prepend=self._before or 0)
            first = np.flatnonzero(known)[:1]
            if self._before is None:
                ns[first] = 0
            if first.size:
                self._before = int(numbers(times)[known][-1])
        elif self.mode == "r":
            ns = ns - (self.zero or 0)
        return pa.array(ns, pa.int64(), mask=None if known.all() else ~known)

    def between(self, t: Time) -> str:
        """Write the time of what stands between the rows: nothing in a delta mode, whose deltas are those of rows."""
        return "" if self.mode in ("d", "dd") else self.text(t)

    def seconds(self, ns: int, *, signed: bool = False) -> str:
        """Write nanoseconds as decimal seconds, cut (never rounded up into the future) to the decimals in use."""
        second, rest = divmod(abs(ns), SECOND)
        sign = "-" if ns < 0 else "+" if signed else ""
        return f"{sign}{second}.{self._decimals(rest)}"

    def _decimals(self, ns: int) -> str:
        return f"{ns:09d}" if self.digits == 9 else f"{ns // 1000:06d}"

    def _since_previous(self, times: Sequence[Time], rows: Sequence[int]) -> list[str]:
        gaps = list[int | None]()
        for t in times:
            gaps.append(None if t is None else 0 if self._before is None else t - self._before)
            if t is not None:
                self._before = t
        return ["" if (gap := gaps[row]) is None else self.seconds(gap) for row in rows]

    def _since_shown(self, t: Time) -> str:
        if t is None:
            return ""
        before, self._shown = self._shown, t
        return self.seconds(0 if before is None else t - before)


@lru_cache(maxsize=256)
def _day(second: int, form: str, utc: bool) -> str:
    """Write whole seconds as day and time; neighbouring rows share them."""
    moment = datetime.fromtimestamp(second, UTC)
    return (moment if utc else moment.astimezone()).strftime(form)
