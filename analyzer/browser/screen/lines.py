"""A widget of lines that sends only those to the terminal that differ from what is there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.segment import Segment
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from analyzer.browser.screen.styles import PLAIN
from analyzer.views.terminal import ELLIPSIS, display_width

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.style import Style

    Spans = tuple[tuple[str, Style], ...]


RIGHT = 3  # button of the mouse


class Lines(Widget):
    """Lines of styled spans, as many as it is high."""

    def __init__(self, name: str) -> None:
        super().__init__(id=name)
        self._drawn: list[Spans] = []

    def put(self, lines: Sequence[Spans]) -> None:
        """Draw what differs."""
        before, self._drawn = self._drawn, list(lines)
        rows = range(max(len(before), len(self._drawn)))
        differ = [y for y in rows if (before[y : y + 1] or [()]) != (self._drawn[y : y + 1] or [()])]
        if differ:
            self.refresh(*(Region(0, y, self.size.width, 1) for y in differ))

    def render_line(self, y: int) -> Strip:
        """Return a line of the widget."""
        width = self.size.width
        if y >= len(self._drawn):
            return Strip.blank(width, PLAIN)
        told = _told_plainly if getattr(self.app, "plain", False) else str
        strip = Strip(Segment(told(text), style) for text, style in _joined(self._drawn[y]))
        return strip.adjust_cell_length(width, PLAIN)

    @property
    def text(self) -> str:
        """The drawn text, for tests."""
        return "\n".join("".join(text for text, _ in line) for line in self._drawn)


def _joined(spans: Spans) -> Iterator[tuple[str, Style]]:
    """Yield spans, those of one style as one; blanks need none that only colours letters: each change costs bytes."""
    text, style = "", PLAIN
    for more, own in spans:
        if own != style and more.isspace() and not (_seen(own) or _seen(style)):
            own = style  # noqa: PLW2901 - as good
        if own != style:
            if text:
                yield text, style
            text, style = "", own
        text += more
    if text:
        yield text, style


def _told_plainly(text: str) -> str:
    """Return text for a terminal that takes ASCII alone."""
    return text.replace(ELLIPSIS, "~").encode("ascii", "replace").decode("ascii")


def _seen(style: Style) -> bool:
    """Return whether a style shows on a blank."""
    return bool(style.reverse or style.underline or style.bgcolor)


def padded(text: str, width: int) -> str:
    """Return text as wide as the terminal, so that its style goes through."""
    return text + " " * max(0, width - display_width(text))


class Pane(Lines):
    """Lines that keys may go to; drawn anew for another size, and to show whether they do."""

    def draw(self) -> None:
        """Draw what there is to be seen."""
        raise NotImplementedError

    def on_resize(self) -> None:
        """Draw as large as it is now."""
        self.draw()

    def on_focus(self) -> None:
        """Show that keys go here."""
        self.draw()

    def on_blur(self) -> None:
        """Show that keys go elsewhere."""
        self.draw()
