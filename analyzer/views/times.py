"""Time columns as tshark's `-t` has them, from exact integer nanoseconds."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import raw_times
from analyzer.views.members import PLAIN
from dissectors.kit.cells import numbers, valid
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.kit import Array

    Time = int | None


_NINE = 9  # digits of nanoseconds
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

    @property
    def head(self) -> str:
        """Title of the column."""
        return _HEADS.get(self.mode, "Time [s]")

    @property
    def follows_all(self) -> bool:
        """True if what is written of a row depends on the one before, whether that is shown or not."""
        return self.mode == "d"

    @property
    def nine(self) -> bool:
        """Whole nanoseconds are written."""
        return self.digits == _NINE

    def start(self, frames: pa.RecordBatch) -> None:
        """Settle the zero and the decimals by the first frames of a capture; later calls change nothing."""
        if self.zero is not None and self.digits is not None:
            return
        column = frames.column("t")
        times = numbers(column)[valid(column)]
        if not len(times):
            return
        if self.zero is None:
            self.zero = int(times[0])
        if self.digits is None:
            self.digits = 9 if (times % 1000).any() else 6

    def next(self, t: Time) -> str:
        """Write the time of the next row, all rows told one after the other; "" if unknown."""
        if self.mode not in ("d", "dd"):
            return self.text(t)
        if t is None:
            return ""
        before, self._before = self._before, t
        return self.seconds(0 if before is None else t - before)

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

    def elapsed(self, times: pa.Array, order: Array | None = None) -> pa.Array:
        """Return nanoseconds that `seconds` writes of all rows of a batch; of a time of day those of its second.

        `order` are the rows in the order in which a delta mode goes through them: all as they stand if not given.
        """
        known, ns = valid(times), numbers(times)
        if self.mode in ("d", "dd"):
            ns = self._since(ns, np.flatnonzero(known) if order is None else order[known[order]])
        elif self.mode == "r":
            ns = ns - (self.zero or 0)
        elif self.mode in _DAY:
            ns = ns % SECOND
        return pa.array(ns, pa.int64(), mask=None if known.all() else ~known)

    def days(self, times: pa.Array) -> tuple[pa.Array, list[str]]:
        """Return for each row the place of its second among the texts of seconds; none but for times of day."""
        if self.mode not in _DAY:
            return pa.array(np.zeros(len(times), np.uint32)), []
        seconds, places = np.unique(numbers(times)[valid(times)] // SECOND, return_inverse=True)
        found = np.zeros(len(times), np.uint32)
        found[valid(times)] = places
        form, utc = _DAY[self.mode], self.mode[0] == "u"
        return pa.array(found), [_day(second, form, utc) for second in seconds.tolist()]

    def dates(self, times: pa.Array) -> pa.Array:
        """Return the text of each time of a column, null for none; not for modes that count from another row."""
        known: dict[Time, str | None] = {t: None if t is None else self.text(t) for t in set(raw_times(times))}
        return pa.array([known[t] for t in raw_times(times)], pa.string())

    def written(self, elapsed: pa.Array, days: pa.Array, seconds: list[str], row: int) -> str:
        """Return what `template` writes of a row, from what `elapsed` and `days` gave."""
        ns = elapsed[row].as_py()
        if ns is None:
            return ""
        if self.mode in _DAY:
            return f"{seconds[days[row].as_py()]}.{self._decimals(ns)}"
        return self.seconds(ns, signed=self.signed and self.mode == "r")

    def template(self, columns: SheetColumns, words: int) -> Template:
        """Return the template of a time, from the columns `elapsed` and `days`; `words` is the list of seconds."""
        if self.mode not in _DAY:
            signed = self.signed and self.mode == "r"
            return columns.of("elapsed", ("number", PLAIN, ("seconds", signed, self.nine)))
        decimals = columns.of("elapsed", ("number", PLAIN, ("decimals", self.nine)))
        day: Template = ("all", [columns.of("days", ("word", words)), ("text", "."), decimals])
        return ("given", columns.place("elapsed"), day, ("text", ""))

    def between(self, t: Time) -> str:
        """Write the time of what stands between the rows: nothing in a delta mode, whose deltas are those of rows."""
        return "" if self.mode in ("d", "dd") else self.text(t)

    def seconds(self, ns: int, *, signed: bool = False) -> str:
        """Write nanoseconds as decimal seconds, cut (never rounded up into the future) to the decimals in use."""
        second, rest = divmod(abs(ns), SECOND)
        sign = "-" if ns < 0 else "+" if signed else ""
        return f"{sign}{second}.{self._decimals(rest)}"

    def _decimals(self, ns: int) -> str:
        return f"{ns:09d}" if self.nine else f"{ns // 1000:06d}"

    def _since(self, times: Array, rows: Array) -> Array:
        """Return for these rows the nanoseconds since the one before, 0 for the first and for other rows."""
        ns = np.zeros(len(times), np.int64)
        if len(rows):
            ns[rows] = np.diff(times[rows], prepend=times[rows[0]] if self._before is None else self._before)
            self._before = int(times[rows[-1]])
        return ns


@lru_cache(maxsize=256)
def _day(second: int, form: str, utc: bool) -> str:
    """Write whole seconds as day and time; neighbouring rows share them."""
    moment = datetime.fromtimestamp(second, UTC)
    return (moment if utc else moment.astimezone()).strftime(form)
