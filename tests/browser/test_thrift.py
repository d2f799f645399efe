"""What is on the terminal already is not sent again."""

from __future__ import annotations

import io
import re

from rich.console import Console
from rich.segment import Segment
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Region
from textual.strip import Strip

from analyzer.browser.screen.thrift import DrawnLines

CONSOLE = Console(file=io.StringIO(), force_terminal=True, width=10)
WIDTH = 10


class Terminal:
    """A terminal that shows what is sent to it, line by line."""

    def __init__(self) -> None:
        self.drawn, self.lines = DrawnLines(), {}
        self.sent = 0

    def take(self, update: CompositorUpdate) -> None:
        shown = self.drawn.update(update)
        assert isinstance(shown, CompositorUpdate)
        text = shown.render_segments(CONSOLE)
        self.sent = len(text)
        for row, column, part in re.findall(r"\x1b\[(\d+);(\d+)H([^\x1b\n]*)", text):
            before, at = self.lines.get(int(row) - 1, " " * WIDTH), int(column) - 1
            self.lines[int(row) - 1] = f"{before[:at]}{part}{before[at + len(part) :]}"


def strip(text: str) -> Strip:
    return Strip([Segment(text)])


def whole(*texts: str) -> LayoutUpdate:
    return LayoutUpdate([[strip(f"{text:<{WIDTH}}")] for text in texts], Region(0, 0, WIDTH, len(texts)))


def part(row: int, left: int, text: str, rows: int = 3) -> ChopsUpdate:
    right = left + len(text)
    chops: list[dict[int, Strip | None]] = [{} for _ in range(rows)]
    chops[row] = {0: None, left: strip(text), right: None} if left else {0: strip(text)}
    ends = [[left, right, WIDTH] if left else [right] for _ in range(rows)]
    return ChopsUpdate(chops, [(row, left, right)], ends)


def test_only_lines_that_differ_are_sent() -> None:
    terminal = Terminal()
    terminal.take(whole("one", "two", "three"))
    first = terminal.sent
    terminal.take(whole("one", "two", "three"))
    assert terminal.sent == 0
    terminal.take(whole("one", "zwei", "three"))
    assert 0 < terminal.sent < first / 2
    assert [terminal.lines[row].strip() for row in range(3)] == ["one", "zwei", "three"]


def test_lines_that_were_changed_in_part_are_sent() -> None:
    terminal = Terminal()
    terminal.take(whole("one", "two", "three"))
    terminal.take(part(1, 4, "2"))
    assert terminal.lines[1] == "two 2     "
    terminal.take(whole("one", "two", "three"))
    assert terminal.lines[1].strip() == "two"


def test_a_line_that_is_drawn_from_end_to_end_is_known() -> None:
    terminal = Terminal()
    terminal.take(whole("one", "two", "three"))
    terminal.take(part(1, 0, f"{'zwei':<{WIDTH}}"))
    assert terminal.lines[1].strip() == "zwei"
    terminal.take(whole("one", "zwei", "three"))
    assert terminal.sent == 0
    terminal.take(part(1, 0, f"{'zwei':<{WIDTH}}"))
    assert terminal.sent == 0


def test_everything_is_sent_where_nothing_is_known() -> None:
    terminal = Terminal()
    terminal.take(whole("one", "two"))
    first = terminal.sent
    terminal.drawn.forget()
    terminal.take(whole("one", "two"))
    assert terminal.sent == first
    terminal.take(whole("one", "two", ""))  # a terminal of another height
    assert terminal.sent > first
    terminal.drawn.update("text of somebody else")
    terminal.take(whole("one", "two", ""))
    assert terminal.sent > first
