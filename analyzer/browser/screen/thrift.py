"""Screens that are drawn as a whole send only the lines that differ: over a slow line every byte costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.control import Control
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Size

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
    from textual.strip import Strip


class DrawnLines:
    """Remembers the lines of the terminal that were drawn as a whole."""

    def __init__(self) -> None:
        self._lines: dict[int, str] = {}
        self._size = Size(0, 0)

    def forget(self) -> None:
        """Know nothing of the terminal, which may show something else by now."""
        self._lines.clear()

    def update(self, drawn: RenderableType | None) -> RenderableType | None:
        """Return what is to be drawn in place of an update of the screen."""
        if isinstance(drawn, LayoutUpdate | ChopsUpdate):
            return _Thrifty(self, drawn)
        if drawn is not None:
            self.forget()
        return drawn

    def whole(self, update: LayoutUpdate, console: Console) -> str:
        """Return what draws the lines of a screen that differ; all of them on a terminal of another size."""
        if update.region.size != self._size:
            self.forget()
            self._size = update.region.size
        return "".join(self._line(y, strips, console) for y, strips in enumerate(update.strips, update.region.y))

    def parts(self, update: ChopsUpdate, console: Console) -> str:
        """Return what draws parts of lines; a line of which only a part is drawn is not known any more."""
        lines = [self._strips(update, *span) for span in update.spans]
        if None not in lines:
            some = zip(update.spans, lines, strict=True)
            return "".join(self._line(y, strips, console) for (y, _, _), strips in some if strips is not None)
        for y, _, _ in update.spans:
            self._lines.pop(y, None)
        return update.render_segments(console)

    @staticmethod
    def _strips(update: ChopsUpdate, y: int, left: int, right: int) -> list[Strip] | None:
        """Return the strips of a line that is drawn from end to end, None for one that is not."""
        strips = [strip for _, strip in sorted(update.chops[y].items())]
        if left > 0 or right < update.chop_ends[y][-1]:
            return None
        return None if None in strips else strips  # type: ignore[return-value]  # just looked for

    def _line(self, y: int, strips: Iterable[Strip], console: Console) -> str:
        line = "".join(strip.render(console) for strip in strips)
        if self._lines.get(y) == line:
            return ""
        self._lines[y] = line
        return f"{Control.move_to(0, y).segment.text}{line}"


class _Thrifty(CompositorUpdate):
    """An update that looks at what is drawn already, at the moment when it is drawn itself."""

    def __init__(self, lines: DrawnLines, update: LayoutUpdate | ChopsUpdate) -> None:
        self._lines, self._update = lines, update

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw it without looking."""
        return self._update.__rich_console__(console, options)

    def render_segments(self, console: Console) -> str:
        """Return what is sent to the terminal."""
        if isinstance(self._update, LayoutUpdate):
            return self._lines.whole(self._update, console)
        return self._lines.parts(self._update, console)
