"""Tables as lines of text: which columns fit, how wide they are, what is cut. Nothing here knows a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from analyzer.views.terminal import display_width, escape, fit
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Style = Literal["", "bold", "dim", "good", "warn", "bad", "alarm", "head", "focus", "sorted", "sorted focus"]
Span = tuple[str, Style]
Line = tuple[Span, ...]
_GAP = 1  # columns of the terminal between two of a table


@dataclass(frozen=True, slots=True)
class Cell:
    """A text, and what it is sorted by."""

    text: str = ""
    style: Style = ""
    value: float | str | None = None


@dataclass(frozen=True, slots=True)
class TableColumn:
    """A column of a table.

    Columns of a higher `rank` give way first where it is narrow. One that may `grow` takes what is left; before others
    of its rank and higher ones it is given what it needs, up to `most` and a quarter of the width. `long` is the head
    where there is room.
    """

    head: str
    right: bool = True
    rank: int = 1
    least: int = 0
    grow: bool = False
    most: int = 0
    long: str = ""
    sortable: bool = True


@dataclass(frozen=True, slots=True)
class TextTable:
    """Columns and rows of cells; `empty` stands in place of rows if there are none, a `title` in place of heads."""

    columns: tuple[TableColumn, ...] = ()
    rows: tuple[tuple[Cell, ...], ...] = ()
    empty: str = ""
    title: str = ""


@dataclass(slots=True)
class Sorting:
    """By which column a table is sorted, by its head; empty for its own order."""

    column: str = ""
    down: bool = False

    def next(self, sheet: TextTable) -> None:
        """Go to the next column that can be sorted by, and after the last one to the table's own order."""
        heads = ["", *(column.head for column in sheet.columns if column.sortable)]
        self.column = heads[(heads.index(self.column) + 1) % len(heads)] if self.column in heads else ""

    def sorted(self, sheet: TextTable) -> TextTable:
        """Return the rows in order; those without a value are the last ones."""
        place = next((k for k, column in enumerate(sheet.columns) if column.head == self.column), None)
        if place is None:
            return replace(sheet, rows=tuple(reversed(sheet.rows))) if self.down else sheet

        def key(row: tuple[Cell, ...]) -> tuple[bool, float, str]:
            value = row[place].value
            return isinstance(value, str), 0 if isinstance(value, str) else float(value or 0), str(value)

        known = [row for row in sheet.rows if row[place].value is not None]
        others = tuple(row for row in sheet.rows if row[place].value is None)
        return replace(sheet, rows=(*sorted(known, key=key, reverse=self.down), *others))


@dataclass(slots=True)
class Fitting:
    """The widths of columns: those that were needed once are kept, so that nothing moves while numbers change."""

    widths: dict[str, int] = field(default_factory=dict)
    width: int = 0

    def fit(self, sheet: TextTable, width: int) -> list[tuple[int, int]]:
        """Return the columns that are shown, each with its width."""
        if width != self.width:
            self.widths.clear()
            self.width = width
        needs = [self._need(column, [row[k] for row in sheet.rows]) for k, column in enumerate(sheet.columns)]
        asked = [
            max(column.least, min(need, column.most, width // 4)) if column.grow else need
            for column, need in zip(sheet.columns, needs, strict=True)
        ]
        shown: list[int] = []
        left = width + _GAP
        for k in sorted(range(len(asked)), key=lambda k: (sheet.columns[k].rank, k)):
            if asked[k] + _GAP > left and shown:
                continue
            shown.append(k)
            left -= asked[k] + _GAP
        shown.sort()
        for k in shown:
            if sheet.columns[k].grow:
                more = max(0, min(left, needs[k] - asked[k]))
                asked[k] += more
                left -= more
        longer = {k: max(0, display_width(sheet.columns[k].long) - asked[k]) for k in shown}
        if sum(longer.values()) <= left:
            asked = [wide + longer.get(k, 0) for k, wide in enumerate(asked)]
        return [(k, min(asked[k], width)) for k in shown]

    def _need(self, column: TableColumn, cells: Iterable[Cell]) -> int:
        need = max([display_width(column.head), column.least, *(display_width(cell.text) for cell in cells)])
        if not column.grow or column.most:
            need = self.widths[column.head] = max(need, self.widths.get(column.head, 0))
        return need


def head(sheet: TextTable, fitted: Sequence[tuple[int, int]], width: int, sorting: Sorting, style: Style) -> Line:
    """Return the title, or the names of the columns, as wide as the terminal."""
    if sheet.title:
        title = fit(sheet.title, width)
        return (title, style), (" " * (width - display_width(title)), style)
    spare = width - sum(wide + _GAP for _, wide in fitted) + _GAP
    spans: list[Span] = []
    for at, (k, wide) in enumerate(fitted):
        column = sheet.columns[k]
        last = at == len(fitted) - 1
        room = wide + (max(0, spare) if last and not column.right else 0)
        name = column.long if column.long and display_width(column.long) <= room else column.head
        chosen = column.head == sorting.column
        if chosen:
            name = name[: room - 1] + ("v" if sorting.down else "^")
        own: Style = ("sorted focus" if style == "focus" else "sorted") if chosen else style
        spans.append((_padded(fit(name, room), room, right=column.right), own))
        if not last:
            spans.append((" " * _GAP, style))
    used = sum(display_width(text) for text, _ in spans)
    return (*spans, (" " * max(0, width - used), style))


def lines(
    sheet: TextTable, fitted: Sequence[tuple[int, int]], rows: Iterable[tuple[Cell, ...]], width: int
) -> list[Line]:
    """Return rows as lines, each as wide as the terminal."""
    found: list[Line] = []
    for row in rows:
        spans: list[Span] = []
        for k, wide in fitted:
            text = _padded(fit(row[k].text, wide), wide, right=sheet.columns[k].right)
            spans += [(text, row[k].style), (" ", "")]
        used = sum(display_width(text) for text, _ in spans)
        if used > width:
            spans.pop()
            used -= 1
        found.append((*spans, (" " * max(0, width - used), "")))
    return found


def text_cell(text: str, style: Style = "", *, value: float | str | None = None) -> Cell:
    """Make a cell of text that came from the bus: what could fool a terminal is escaped."""
    safe = escape(text)
    return Cell(safe, style, value if value is not None else safe)


def _padded(text: str, width: int, *, right: bool) -> str:
    blanks = " " * max(0, width - display_width(text))
    return blanks + text if right else text + blanks
