"""Widgets that draw lines, and of a new picture only what differs from the one before: nothing flickers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.segment import Segment
from rich.style import Style as RichStyle
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from analyzer.terminal.sheet import Fitting, Sorting, TextTable, head, lines
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.terminal.sheet import Line, Style

# Only the 16 colours that every terminal has, on its own background; without colours the rest is enough to read.
_STYLES: dict[Style, RichStyle] = {
    "": RichStyle(),
    "bold": RichStyle(bold=True),
    "dim": RichStyle(dim=True),
    "good": RichStyle(color="green"),
    "warn": RichStyle(color="yellow"),
    "bad": RichStyle(color="red", bold=True),
    "alarm": RichStyle(color="red", bold=True, reverse=True),
    "head": RichStyle(color="cyan", bold=True),
    "focus": RichStyle(color="cyan", bold=True, reverse=True),
    "sorted": RichStyle(color="cyan", bold=True, underline=True),
    "sorted focus": RichStyle(color="cyan", bold=True, reverse=True, underline=True),
}


class TextLines(Widget):
    """A number of lines as they are given."""

    def __init__(self, name: str) -> None:
        super().__init__(id=name)
        self._shown: list[Line] = []

    def show(self, shown: Sequence[Line]) -> None:
        """Draw what differs."""
        before, self._shown = self._shown, list(shown)
        regions = []
        for y in range(max(len(before), len(self._shown))):
            old = before[y] if y < len(before) else ()
            new = self._shown[y] if y < len(self._shown) else ()
            if old != new:
                regions.append(_changed(y, old, new, self.size.width))
        if regions:
            self.refresh(*regions)

    def render_line(self, y: int) -> Strip:
        """Return a line of the widget."""
        if y >= len(self._shown):
            return Strip.blank(self.size.width, _STYLES[""])
        strip = Strip(Segment(text, _STYLES[style]) for text, style in self._shown[y])
        return strip.adjust_cell_length(self.size.width, _STYLES[""])


class TablePane(TextLines, can_focus=True):
    """A table with its head, sorted and scrolled by keys."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.sorting = Sorting()
        self.rows = 0
        self._sheet = TextTable()
        self._fitting = Fitting()
        self._top = 0

    def take(self, sheet: TextTable) -> None:
        """Take a new state of the table."""
        self._sheet = sheet
        self.rows = max(1, len(sheet.rows))
        self.draw()

    def draw(self) -> None:
        """Draw the part of the table that is seen."""
        width, height = self.size
        if not width or not height:
            return
        sheet = self.sorting.sorted(self._sheet)
        self._top = max(0, min(self._top, len(sheet.rows) - (height - 1)))
        place = self._place(len(sheet.rows), height - 1)
        fitted = self._fitting.fit(sheet, width if sheet.title else max(1, width - len(place)))
        style: Style = "focus" if self.has_focus else "head"
        shown = [_more(head(sheet, fitted, width, self.sorting, style), place, style)]
        if sheet.rows:
            shown += lines(sheet, fitted, sheet.rows[self._top : self._top + height - 1], width)
        else:
            shown.append(((f" {sheet.empty}".ljust(width)[:width], "dim"),))
        self.show(shown)

    def scroll_rows(self, by: int) -> None:
        """Show other rows."""
        self._top = max(0, self._top + by)
        self.draw()

    def sort(self, *, reverse: bool) -> None:
        """Sort the other way round, or by the next column."""
        if reverse:
            self.sorting.down = not self.sorting.down
        else:
            self.sorting.next(self._sheet)
        self.draw()

    def on_resize(self) -> None:
        """Draw as wide as the terminal now is."""
        self.draw()

    def on_focus(self) -> None:
        """Show in the head that the keys go here."""
        self.draw()

    def on_blur(self) -> None:
        """Show in the head that the keys go elsewhere."""
        self.draw()

    def _place(self, total: int, seen: int) -> str:
        """Return which rows are seen, if that is not all of them; always as wide."""
        if total <= seen:
            return ""
        rows = f"{self._top + 1}-{self._top + seen}" if seen > 0 else "0"
        return f"{rows}/{total}".rjust(3 * len(str(total)) + 3)


def _more(line: Line, text: str, style: Style) -> Line:
    """Write over the blanks at the end of a line, if they are enough."""
    last, _ = line[-1]
    if not text or len(last) < len(text):
        return line
    return (*line[:-1], (last[: len(last) - len(text)] + text, style))


def _changed(y: int, old: Line, new: Line, width: int) -> Region:
    """Return where two lines differ."""
    widths = [[display_width(text) for text, _ in line] for line in (old, new)]
    if widths[0] != widths[1]:
        return Region(0, y, width, 1)
    differ = [k for k, (one, other) in enumerate(zip(old, new, strict=True)) if one != other]
    start = sum(widths[0][: differ[0]])
    return Region(start, y, sum(widths[0][: differ[-1] + 1]) - start, 1)
