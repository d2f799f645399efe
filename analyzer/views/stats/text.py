"""Statistics for a terminal: columns side by side, bars where there is room."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

from analyzer.views.info.stay import StayFormat
from analyzer.views.stats.odd import NAME, odd_lines
from analyzer.views.terminal import PLAIN, display_width, escape, fit, fit_name
from analyzer.views.times import TimeFormat
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.stats.table import StatColumn, StatTable
    from analyzer.views.stats.head import StatHead
    from analyzer.views.terminal import Palette

WIDTH = 80
_WORDS = ("text", "stay", "mark")  # kinds that stand to the left
_INDENT = "  "
_SHORT = 6  # a text column is not cut to less
_BAR, _MOST_BAR = 8, 60  # columns of a bar, at least and at most
_BLOCKS = " ▏▎▍▌▋▊▉"
_DAY = 86_400 * SECOND
_YEAR_2000 = 946_684_800 * SECOND
_LEAST, _NANOSECONDS = 3, 9  # decimals of a moment
_LARGE = 100_000  # numbers from here on need no decimals


class StatText:
    """Writes tables with at most `width` columns. Times are of day, or count from `start` if they have no date."""

    def __init__(
        self, width: int, start: int | None, end: int | None, palette: Palette = PLAIN, *, timed: bool = True
    ) -> None:
        self._width, self._palette = max(width, 40), palette
        self._start = start or 0
        dated = start is not None and start >= _YEAR_2000
        whole_day = end is not None and start is not None and end - start >= _DAY
        self._stays = StayFormat(start, end, dated, timed)
        self._clock = TimeFormat("ad" if whole_day else "a", digits=_NANOSECONDS) if dated else None

    def head(self, head: StatHead) -> Iterator[str]:
        """Write what stands above the tables."""
        for line in head.lines():
            yield from wrap(line, self._width, subsequent_indent=_INDENT, break_on_hyphens=False)

    def table(self, table: StatTable, *, buses: int) -> Iterator[str]:
        """Write a table, a line each: its title, the columns, the sum, the notes."""
        first, *more = self._wrapped(f"{table.name}  {table.about}")
        yield self._palette.paint("head", table.name) + first.removeprefix(table.name)
        yield from more
        if table.name == NAME:
            palette, moment = self._palette, self._since
            yield from odd_lines(table, width=self._width, buses=buses, palette=palette, moment=moment)
            yield from self._notes(table)
            return
        if not table.rows:
            yield "  nothing"
            yield from self._notes(table)
            return
        shown = range(len(table.rows)) if table.shown is None else table.shown
        columns = [k for k, c in enumerate(table.columns) if c.rank >= 0 and not (c.name == "bus" and buses < 2)]
        columns = [k for k in columns if self._says(table, k)]
        cells = {k: self._cells(table, k, shown) for k in columns}
        widths = {k: max(map(display_width, (table.columns[k].title, *cells[k]))) for k in columns}
        left_out = []
        while self._together(widths) > self._width and (rank := max(table.columns[k].rank for k in widths)):
            k = next(k for k in reversed(widths) if table.columns[k].rank == rank)
            left_out.append(table.columns[k].title)
            del widths[k]
        self._squeeze(table, widths)
        bars = self._bars(table, widths, shown)
        head, *lines = self._lines(table, cells, widths, bars)
        yield self._palette.paint("dim", head)
        for number, line in enumerate(lines):
            if table.gaps and 0 < number < len(shown) and (missing := shown[number] - shown[number - 1] - 1):
                yield fit(f"  ... {missing} {table.gaps}", self._width)
            yield line
        yield from self._notes(table)
        if left_out:
            yield from self._wrapped(f"a wider terminal shows more columns: {', '.join(reversed(left_out))}", _INDENT)

    def _notes(self, table: StatTable) -> Iterator[str]:
        for note in table.notes:
            yield from self._wrapped(note, _INDENT)

    def _wrapped(self, text: str, indent: str = "") -> list[str]:
        lines = wrap(escape(text), self._width - len(indent), subsequent_indent=_INDENT, break_on_hyphens=False)
        return [indent + line for line in lines or [""]]

    def _says(self, table: StatTable, k: int) -> bool:
        """Return whether a column has anything to say."""
        return table.columns[k].kind not in ("text", "mark") or any(row[k] for row in table.rows)

    def _cells(self, table: StatTable, k: int, shown: Sequence[int]) -> list[str]:
        column = table.columns[k]
        blank = "" if column.kind == "mark" else "-"
        texts = [self._text(column, table.rows[row][k], blank) for row in shown]
        if k == 0 and table.indent:
            texts = ["  " * table.indent[row] + text for row, text in zip(shown, texts, strict=True)]
        if table.total is not None:
            texts.append(self._text(column, table.total[k], blank=""))
        return texts

    def _text(self, column: StatColumn, value: Any, blank: str = "-") -> str:
        if value is None or value == "":
            return blank
        if column.kind == "stay":
            return self._stays.stay(*value)
        if column.kind == "time":
            return self._moment(value, max(column.digits, _LEAST))
        if column.kind == "span":
            return f"{value // 3600}:{value // 60 % 60:02}:{value % 60:02}"
        if column.kind in ("number", "since"):
            digits = 0 if abs(value) >= _LARGE and column.kind == "number" else column.digits
            return f"{round(value, digits) + 0.0:.{digits}f}"  # not -0.0
        return escape(str(value))

    def _since(self, t: int) -> str:
        return self._moment(t, _LEAST)

    def _moment(self, t: int, digits: int) -> str:
        if self._clock is None:
            seconds, rest = divmod(abs(t - self._start), SECOND)
            return f"{'-' * (t < self._start)}{seconds}.{f'{rest:09}'[:digits]} s"
        return self._clock.text(t)[: digits - _NANOSECONDS or None]

    def _together(self, widths: dict[int, int]) -> int:
        return sum(widths.values()) + 2 * (len(widths) - 1)

    def _squeeze(self, table: StatTable, widths: dict[int, int]) -> None:
        """Make the widest texts narrower, as far as that helps."""
        while self._together(widths) > self._width:
            texts = [k for k in widths if table.columns[k].kind == "text" and widths[k] > _SHORT]
            if not texts:
                return
            widths[max(texts, key=lambda k: widths[k])] -= 1

    def _bars(self, table: StatTable, widths: dict[int, int], shown: Sequence[int]) -> list[str]:
        of = next((k for k in widths if table.columns[k].bar), None)
        room = min(self._width - self._together(widths) - 2, _MOST_BAR)
        values = [] if of is None else [table.rows[row][of] or 0 for row in shown]
        most = max(values, default=0)
        if of is None or room < _BAR or most <= 0 or len(values) < 2:  # one has nothing beside it
            return [""] * len(shown)
        return [_bar(max(value, 0) / most, room) for value in values]

    def _lines(
        self, table: StatTable, cells: dict[int, list[str]], widths: dict[int, int], bars: list[str]
    ) -> Iterator[str]:
        drawn = next((table.columns[k].title for k in widths if table.columns[k].bar), "") if any(bars) else ""
        yield self._line(table, widths, {k: table.columns[k].title for k in widths}, drawn)
        for row, bar in enumerate([*bars, *[""] * (table.total is not None)]):
            yield self._line(table, widths, {k: cells[k][row] for k in widths}, bar)

    def _line(self, table: StatTable, widths: dict[int, int], texts: dict[int, str], bar: str) -> str:
        parts = []
        for k, width in widths.items():
            text = (fit_name if table.columns[k].name == "bus" else fit)(texts[k], width)
            blank = " " * (width - display_width(text))
            parts.append(text + blank if table.columns[k].kind in _WORDS else blank + text)
        return fit("  ".join([*parts, bar]).rstrip(), self._width)


def _bar(share: float, room: int) -> str:
    eighths = round(share * room * 8)
    full, rest = divmod(eighths, 8)
    text = "█" * full + (_BLOCKS[rest] if rest else "")
    return text or ("▏" if share else "")
