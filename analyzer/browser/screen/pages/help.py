"""Pages of text before the panes: what keys mean, what a rule is about."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.browser.screen.keys import help_lines
from analyzer.browser.screen.pages.page import ScreenPage
from analyzer.browser.screen.styles import NAMED
from analyzer.report.lines import wrap
from analyzer.views.terminal import fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events

    from analyzer.browser.screen.lines import Spans

_SIGNS = (
    ("m c * e", "in front of a row: a mark, a comment, a rule names it, an event or a flight's begin or end"),
    ("> 1-6", "it is selected; of which coloured conversation it is"),
    ("! ?", "at the right end: rules of findings (error, warning) that name the row; none: a note"),
    ("! ? o 1", "in the strip: findings (error, warning), marks, where a flight begins; coloured: in flight"),
)  # fmt: skip
_KEY = 11


class TextPage(ScreenPage):
    """A page of lines; arrows scroll, any other key goes back."""

    def __init__(self, title: str, lines: Sequence[Spans]) -> None:
        super().__init__()
        self._title, self._rows = title, lines
        self._top = 0

    def shown(self, width: int, height: int) -> list[Spans]:
        """Return the lines that fit."""
        room = height - 2
        self._top = max(0, min(self._top, len(self._rows) - room))
        more = "up, down: more; " if len(self._rows) > room else ""
        foot = f" {more}any other key goes back"
        title = ((fit(f" {self._title}", width), NAMED["title"]),)
        shown: list[Spans] = [title, *self._rows[self._top : self._top + room]]
        shown += [((" ", NAMED[""]),)] * (height - 1 - len(shown))
        return [*shown, ((foot, NAMED["dim"]),)]

    def move(self, by: int) -> None:
        """Scroll."""
        self._top += by
        self.draw()

    def pressed(self, _: events.Key) -> None:
        """Go back."""
        self.leave()

    def on_mouse_down(self) -> None:
        """Go back."""
        self.leave()


def help_page() -> TextPage:
    """Return the page of all keys."""
    rows = [*help_lines(), ("", "Signs"), *_SIGNS]
    return TextPage("Keys of tailbyte view", [_row(key, words) for key, words in rows])


def rule_page(text: str) -> TextPage:
    """Return the page of a rule."""
    first, *rest = text.splitlines()
    return TextPage(first, [((f" {line}", NAMED[""]),) for line in rest])


def line_page(text: str, width: int) -> TextPage:
    """Return the page of a detail that does not fit into its line."""
    return TextPage("The line in full", [((f" {line}", NAMED[""]),) for line in wrap(text, max(8, width - 2))])


def _row(key: str, words: str) -> Spans:
    if not key:
        return (((f" {words}"), NAMED["head"]),)
    return (f" {key:<{_KEY}}", NAMED["bold"]), (words, NAMED[""])
