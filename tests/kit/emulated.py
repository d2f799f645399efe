"""A terminal that is not there: it shows what a program sends to one, as far as full screens need it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rich.cells import cell_len
from textual._compositor import CompositorUpdate
from textual.app import App

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

_PART = re.compile(r"\x1b\[(?P<given>[?<>=0-9;]*)[ $]?(?P<final>[@-~])|\x1b[^\[]|(?P<text>[^\x1b]+)", re.DOTALL)


class EmulatedTerminal:
    """Lines of letters; a wide letter has an empty cell behind it."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._cells = [[" "] * width for _ in range(height)]
        self._x = self._y = 0

    def resize(self, width: int, height: int) -> None:
        """Take another size: what stands there is not what was drawn any more."""
        self.__init__(width, height)  # type: ignore[misc]
        self._cells = [["?"] * width for _ in range(height)]

    @property
    def screen(self) -> str:
        """All lines, without blanks at their ends."""
        return "\n".join("".join(line).rstrip() for line in self._cells)

    def feed(self, text: str) -> None:
        """Take what a program sends. Raises `ValueError` for what a full screen has no need of."""
        for part in _PART.finditer(text):
            if part["text"]:
                self._write(part["text"])
            elif part["final"] == "H":
                row, column = (int(one or 1) for one in (part["given"] or "1;1").split(";"))
                self._y, self._x = row - 1, column - 1
            elif part["final"] not in ("m", "h", "l"):
                raise ValueError(f"{part[0]!r} is not expected")

    def _write(self, text: str) -> None:
        for letter in text:
            size = cell_len(letter)
            if letter in "\r\n":  # a line feed leads to where a cursor is placed next
                self._x = 0
            elif not size:
                self._cells[self._y][self._x - 1] += letter
            elif self._x + size <= self.width and self._y < self.height:
                line = self._cells[self._y]
                for at in (self._x, self._x + size - 1):  # half of a wide letter is none
                    if line[at] == "":
                        line[at - 1] = " "
                    elif cell_len(line[at]) > 1:
                        line[at + 1] = " "
                line[self._x : self._x + size] = [letter, *[""] * (size - 1)]
                self._x += size


def sends_to(taken: Callable[[str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    """Have what applications draw handed on: Textual itself draws nothing without a terminal."""

    def display(app: App[None], _: object, update: object) -> None:
        if isinstance(update, CompositorUpdate):
            taken(update.render_segments(app.console))

    monkeypatch.setattr(App, "_display", display)
