"""The line that is typed in: a filter with its completion and history, or an answer to a question."""

from __future__ import annotations

import re
from itertools import accumulate
from typing import TYPE_CHECKING

from textual.widgets import Input

from analyzer.stats.catalogue import STATISTICS
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_WORD = re.compile(r"[\w.]*$")
_MOST_SHOWN = 8
_MOST_KEPT = 100


def completed(text: str, names: Sequence[str]) -> tuple[str, list[str]]:
    """Return a filter with its last word completed as far as it goes, and the names that it may become."""
    found = _WORD.search(text)
    word = found[0] if found else ""
    if not word:
        return text, []
    lower = word.lower()
    fitting = [name for name in names if name.lower().startswith(lower)]
    if not fitting:
        fitting = [name for name in names if f".{lower}" in f".{name.lower()}"]
    if not fitting:
        return text, []
    begin = text[: len(text) - len(word)]
    shared = fitting[0]
    for name in fitting[1:]:
        while not name.lower().startswith(shared.lower()):
            shared = shared[:-1]
    return begin + (shared if len(shared) > len(word) else word), fitting


class Bar(Input):
    """A line to type in."""

    def __init__(self, names: Callable[[], Sequence[str]]) -> None:
        super().__init__(id="bar", compact=True, select_on_focus=False)
        self.cursor_blink = False  # over a slow line each blink costs
        self._names = names
        self._kept: dict[str, list[str]] = {}
        self._place = 0
        self.purpose = "filter"

    def validate_value(self, value: str) -> str:
        """Return what stands in the line: a comment of a capture, or what is pasted, may hold anything."""
        return escape(" ".join(value.split("\n")))

    def ask(self, purpose: str, value: str = "") -> None:
        """Begin to ask for something."""
        self.purpose, self._place = purpose, 0
        self.value = value
        self.cursor_position = len(value)

    def keep(self, text: str) -> None:
        """Keep what was typed, for `up`."""
        some = self._kept.setdefault(self.purpose, [])
        if text:
            some[:] = [*[one for one in some if one != text][-_MOST_KEPT:], text]

    def complete(self) -> str:
        """Complete the name in front of the cursor; return the names on offer in a line, empty for a single one."""
        if self.purpose not in ("filter", "find", "statistic"):
            return ""
        before, behind = self.value[: self.cursor_position], self.value[self.cursor_position :]
        first = self.purpose == "statistic" and "," not in before
        text, fitting = completed(before, sorted(STATISTICS) if first else self._names())
        self.value = text + behind
        self.cursor_position = len(text)
        if len(fitting) == 1:
            return ""
        more = f" ... {len(fitting)} in all"
        room = self.app.size.width - len(more) - 2
        ends = accumulate(len(name) + 2 for name in fitting[:_MOST_SHOWN])
        some = sum(end - 2 <= room for end in ends)
        shown = "  ".join(fitting[:some]) + (more if some < len(fitting) else "")
        return shown if fitting else "no name begins like that"

    def older(self, by: int) -> None:
        """Go through what was typed before."""
        some = self._kept.get(self.purpose, [])
        self._place = max(0, min(self._place + by, len(some)))
        self.value = some[-self._place] if self._place else ""
        self.cursor_position = len(self.value)
