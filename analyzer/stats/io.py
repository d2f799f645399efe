"""`io,INTERVAL[,FILTER...]`: frames, bytes and load per interval, and what is to be counted or measured beside them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.facts.traffic import times
from analyzer.stats.chosen import Chooser
from analyzer.stats.intervals import Intervals, Spread
from analyzer.stats.order import is_type
from analyzer.stats.statistic import Statistic, percent
from analyzer.stats.table import StatColumn, StatTable
from analyzer.window.limits import duration
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.filter.compiled import Expression
    from analyzer.stats.chosen import ChosenBatch, ChosenFrames
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors.kit import Array

_FIRST = (
    StatColumn("frames", "Frames", bar=True),
    StatColumn("bytes", "Bytes"),
    StatColumn("load_pct", "Load %", "number", 1),
)
_UNITS = ((SECOND, "s"), (1_000_000, "ms"), (1000, "us"), (1, "ns"))
_MEASURES = ("COUNT", "SUM", "MIN", "MAX", "AVG")
MOST_COLUMNS = 32
_FULL = 100  # percent


@dataclass(slots=True)
class _Wish:
    """A column that was asked for: the frames of a filter, what becomes of an expression, or the transfers of a type.

    What has a measure and no expression counts the transfers that its chooser lets through.
    """

    text: str
    measure: str = ""
    expression: Expression | None = None
    chooser: Chooser | None = None


class IntervalTable(Statistic):
    """A row an interval, counted from the first frame.

    Args:
        order: its arguments are the interval, and filters or `SUM(FIELD)`, which may have a filter behind it.

    Raises `ValueError` for what makes no sense (`FilterError` is one).
    """

    def __init__(self, order: StatOrder) -> None:
        given, *wishes = order.arguments or ("1",)
        self._step = duration(given or "1")
        if len(wishes) > MOST_COLUMNS:
            raise ValueError(f"io takes at most {MOST_COLUMNS} filters")
        self._wishes = [_wish(text, order) for text in wishes]
        self._frames, self._size, self._bits = (Intervals(self._step) for _ in range(3))
        self._columns = [(Intervals(self._step), Spread(self._step)) for _ in self._wishes]
        self._untimed: list[int] = [0, 0]
        self._first: int | None = None
        self._last: int | None = None

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch. Raises `TooManyIntervalsError`."""
        every = batch.frames
        if every.timed.any():
            t = every.t if every.timed.all() else every.t[every.timed]
            if self._first is None:
                self._first = int(t[0])
                for one in (self._frames, self._size, self._bits, *(part for pair in self._columns for part in pair)):
                    one.origin = self._first
            self._last = max(int(t.max()), self._first if self._last is None else self._last)
        for rows, sign in batch.changes:
            timed = self._timed(rows, sign)
            self._frames.feed(timed.t, None, sign)
            self._size.feed(timed.t, timed.size, sign)
            self._bits.feed(timed.t, timed.bits, sign)
        self._frames.check()
        for wish, (counts, spread) in zip(self._wishes, self._columns, strict=True):
            if wish.expression is not None:
                spread.feed(*_measured(wish, batch))
            elif wish.chooser is not None and wish.measure:
                counts.feed(_starts(wish.chooser.feed(batch.batch, every), batch), None, 1)
            elif wish.chooser is not None:
                for rows, sign in wish.chooser.feed(batch.batch, every).changes:
                    counts.feed(rows.t[rows.timed], None, sign)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the intervals from the first frame to the last, those without a frame too if they are not too many."""
        whole = 0 if self._first is None or self._last is None else self._last - self._first
        step = self._step or max(whole, 1)
        rows = list(self._rows(step, end.bit_rate)) if self._first is not None and end.timed else []
        notes = [f"{k}  {wish.text}" for k, wish in enumerate(self._wishes, 1)]
        frames, size = self._frames.total + self._untimed[0], self._size.total + self._untimed[1]
        untimed = self._untimed[0] if end.timed else frames
        if untimed:
            notes.append(f"{untimed} frames have no time that can be compared: they are in the sum alone")
        load = percent(self._bits.total * SECOND, whole * end.bit_rate) if end.timed else None
        if any(row[4] > _FULL for row in rows):
            notes.append("a frame counts as a whole where its time is: a short interval can be above 100 %")
        marks = [self._mark(k, counts, spread) for k, (counts, spread) in enumerate(self._columns)]
        total = (None, None, frames, size, load if whole else None, *marks)
        some = [k for k, row in enumerate(rows) if row[2] or k in (0, len(rows) - 1)]
        length = f"intervals of {_length(step)} from the first frame on" if self._step else "one interval over all"
        about = f"{length}; bytes are data bytes"
        shown = some if len(some) < len(rows) else None
        columns = (*_labels(self._step), *_FIRST, *self._heads())
        return (StatTable("io", about, columns, rows, notes, shown, total, gaps="without a frame"),)

    def _rows(self, step: int, bit_rate: int) -> Iterator[tuple[Any, ...]]:
        first = self._first or 0
        columns = [self._frames, self._size, self._bits]
        for number in self._frames.numbers(self._last or first):
            frames, size, bits = (one.at(number) for one in columns)
            yield (
                number * step / SECOND, first + number * step, frames, size, percent(bits * SECOND, step * bit_rate),
                *(self._cell(k, number, *pair) for k, pair in enumerate(self._columns)),
            )  # fmt: skip

    def _cell(self, k: int, number: int, counts: Intervals, spread: Spread) -> float | None:
        wish = self._wishes[k]
        return counts.at(number) if wish.expression is None else spread.at(number, wish.measure)

    def _mark(self, k: int, counts: Intervals, spread: Spread) -> float | None:
        wish = self._wishes[k]
        return counts.total if wish.expression is None else spread.whole(wish.measure)

    def _heads(self) -> Iterator[StatColumn]:
        for k, wish in enumerate(self._wishes, 1):
            whole = wish.measure in ("", "COUNT")
            title = wish.measure or "Frames"
            yield StatColumn(wish.text, f"{k} {title}", "count" if whole else "number", 0 if whole else 3)

    def _timed(self, rows: ChosenFrames, sign: int) -> ChosenFrames:
        if rows.timed.all():
            return rows
        self._untimed[0] += sign * int((~rows.timed).sum())
        self._untimed[1] += sign * int(rows.size[~rows.timed].sum())
        return rows.take(np.flatnonzero(rows.timed))


def _wish(text: str, order: StatOrder) -> _Wish:
    from analyzer.filter import compile_expression, compile_filter  # noqa: PLC0415 - most have no filter

    text = text.strip()
    found = re.match(rf"({'|'.join(_MEASURES)})\(", text)
    if found is None:
        if re.match(rf"({'|'.join(_MEASURES)})\b", text):
            raise ValueError(f"{text!r}: the field stands in brackets, as in AVG(FIELD)")
        return _of_frames(text, order)
    depth, at = 1, found.end()
    while at < len(text) and depth:
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        at += 1
    if depth:
        raise ValueError(f"{text!r} has no closing bracket")
    rest = text[at:].strip()
    if rest:
        compile_filter(rest, order.registry)
    inner = text[found.end() : at - 1].strip()
    if not inner:
        raise ValueError(f"{text!r} needs a field, as in AVG(FIELD)")
    typed = is_type(inner, order.registry)
    if typed and found[1] != "COUNT":
        raise ValueError(f"{inner} is a type: {found[1]} needs a field (tailbyte fields {inner} lists them)")
    expression = None if typed else compile_expression(inner, order.registry)
    if expression is None or (expression.flag and found[1] == "COUNT"):
        there = f"({inner}) && ({rest})" if rest else inner
        compile_filter(there, order.registry)
        return _Wish(text, found[1], chooser=Chooser(order.matcher(there)))
    # Without a filter of its own it counts what the command lets through.
    return _Wish(text, found[1], expression, Chooser(order.matcher(rest)) if rest else None)


def _of_frames(text: str, order: StatOrder) -> _Wish:
    """Return a column of the frames that a filter lets through."""
    from analyzer.filter import FilterError, compile_filter  # noqa: PLC0415 - as above
    from analyzer.filter.operands import FUNCTIONS, TESTS  # noqa: PLC0415 - as above

    try:
        compile_filter(text, order.registry)
    except FilterError:
        alone = re.fullmatch(r"(\w+)\([^()]*\)", text)
        if alone and (alone[1].upper() in _MEASURES or alone[1] not in (*FUNCTIONS, *TESTS)):
            measures = f"{', '.join(_MEASURES[:-1])} and {_MEASURES[-1]}"
            raise ValueError(f"{text!r}: there are {measures}, as in AVG(FIELD), in capitals") from None
        raise
    return _Wish(text, chooser=Chooser(order.matcher(text)))


def _measured(wish: _Wish, batch: ChosenBatch) -> tuple[Array, Array]:
    """Return the times and values of an expression in what was chosen."""
    assert wish.expression is not None  # noqa: S101 - the caller has looked
    measured = wish.expression.feed(batch.batch)
    chosen = batch.rows if wish.chooser is None else wish.chooser.feed(batch.batch, batch.frames).rows
    rows, values = measured.rows, measured.every
    if chosen is not None:
        mask = np.zeros(len(measured.valid), bool)
        mask[chosen] = True
        rows, values = rows[mask[rows]], values[mask[rows]]
    if not len(rows):
        return np.zeros(0, np.int64), np.zeros(0)
    t, timed = times(batch.batch.transfers)
    rows, values = rows[timed[rows]], values[timed[rows]]
    return t[rows], values


def _starts(chosen: ChosenBatch, batch: ChosenBatch) -> Array:
    """Return the times of the transfers that are chosen."""
    t, timed = times(batch.batch.transfers)
    return t[timed] if chosen.rows is None else t[chosen.rows[timed[chosen.rows]]]


def _labels(step: int) -> tuple[StatColumn, StatColumn]:
    """Return the columns that say when an interval begins, with the decimals that its length needs."""
    digits = max(3, len(f"{step % SECOND:09}".rstrip("0")))
    return StatColumn("start_s", "Start s", "since", digits), StatColumn("start_ns", "Time", "time", digits, rank=1)


def _length(ns: int) -> str:
    unit, name = next(one for one in _UNITS if ns >= one[0])
    return f"{ns / unit:.12g} {name}"
