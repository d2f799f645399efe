"""Meaning of keys and colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.screen import ModalScreen

from analyzer.terminal.pane import TextLines

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.events import Key

    from analyzer.terminal.sheet import Line, Style

_TEXT: tuple[tuple[str, str, Style], ...] = (
    ("space", "pause the display; recording and judging go on", ""),
    ("s  S", "sort the pane by its next column; the other way round", ""),
    ("x", "values now, lowest or highest since the mark", ""),
    ("m", "set a mark: min, max, gaps and what happened begin anew", ""),
    ("w", "save a report now", ""),
    ("v", "view: look through what comes from now on, row by row; q there: back", ""),
    ("c", "clear findings, what happened, and rows that are gone", ""),
    ("e n b f l", "devices (again: their next kind), nodes, buses,", ""),
    ("", "findings, what happened since the mark", ""),
    ("tab", "the next pane; the pane in use gets the room it needs", ""),
    ("up down", "and page up, page down, home, end: scroll the pane", ""),
    ("ctrl+l", "draw everything anew", ""),
    ("q", "quit: the session ends, its files are finished", ""),
    ("", "", ""),
    ("red", "an error, a flag that is set, a row that stays away", "bad"),
    ("yellow", "a warning, or not as usual", "warn"),
    ("reversed", "frames were lost, the bus is off, the display is paused", "alarm"),
    ("1Mbit/s?", "a bit rate that nobody gave: the load is a guess", "dim"),
    ("gap", "the longest pause since the mark", "head"),
)
_WIDTH = 11


class Help(ModalScreen[None]):
    """A page that any key closes."""

    CSS: ClassVar[str] = "Help { background: ansi_default; } #help { height: 100%; }"

    def compose(self) -> ComposeResult:
        """Lay out one widget."""
        yield TextLines("help")

    def on_mount(self) -> None:
        """Show the text."""
        rows: list[Line] = [((f" {key:<{_WIDTH}}", style or "bold"), (text, "")) for key, text, style in _TEXT]
        self.query_one(TextLines).show(
            [((" Keys and colours", "head"),), (), *rows, (), ((" any key goes back", "dim"),)]
        )

    def on_key(self, event: Key) -> None:
        """Go back to the monitor, once, however many keys come at once."""
        event.stop()
        if self.app.screen is self:
            self.dismiss()
