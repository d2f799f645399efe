"""A filter that cannot be meant: the reason, and under it the place."""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_SHOWN = 72  # columns of a long filter around the place
_ABOVE = ("Mn", "Me")  # characters above or around the one before
_MOST_REASON = 1000  # characters
_MOST_NAMED = 12  # values or names that a reason lists


class FilterError(ValueError):
    """Says why a filter is wrong; as text the reason, the filter and a caret under the place.

    Attributes:
        reason: one line.
        text: the filter.
        start, end: the place, characters from 0.
        candidates: names or values that may be meant.
    """

    def __init__(self, reason: str, text: str, start: int, end: int, candidates: Sequence[str] = ()) -> None:
        reason = reason if len(reason) <= _MOST_REASON else f"{reason[:_MOST_REASON]}..."
        self.reason, self.text, self.candidates = reason, text, tuple(candidates)
        self.start = max(0, min(start, len(text)))
        self.end = max(self.start + 1, min(end, len(text)))
        super().__init__(reason)

    def __str__(self) -> str:
        """Return three lines: the reason, and the place."""
        return f"{_plain(self.reason)}\n{self.place}"

    @property
    def place(self) -> str:
        """The filter, as much of it as a line holds, and a line with a caret under the place."""
        start = self.text.rfind("\n", 0, self.start) + 1
        end = self.text.find("\n", self.start)
        end = len(self.text) if end < 0 else end
        first, last = _shown(self.text, start, self.start, end)
        head, tail = ("..." if first > start else ""), ("..." if last < end else "")
        before = head + _plain(self.text[first : self.start])
        inside = _plain(self.text[self.start : min(self.end, last)])
        line = before + inside + _plain(self.text[min(self.end, last) : last]) + tail
        return f"  {line}\n  {' ' * _width(before)}{'^' * max(1, _width(inside))}"


def listed(names: Sequence[str]) -> str:
    """Return names joined by commas, the first ones of many."""
    shown = ", ".join(names[:_MOST_NAMED])
    return f"{shown}, ... ({len(names)} in all)" if len(names) > _MOST_NAMED else shown


def near(word: str, names: Sequence[str], most: int = 3) -> list[str]:
    """Return names that somebody who mistyped one may have meant."""
    from difflib import get_close_matches  # noqa: PLC0415 - only mistakes need it

    lower = {name.lower(): name for name in reversed(names)}
    return [lower[found] for found in get_close_matches(word.lower()[:80], lower, n=most, cutoff=0.6)]


def _plain(text: str) -> str:
    """Return text that a terminal shows as it is, on one line."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _shown(text: str, start: int, place: int, end: int) -> tuple[int, int]:
    """Return from where to where a line of text is shown, around a place, so that a terminal holds it."""
    first = last = place
    free = _SHOWN / 2
    while first > start and (free := free - _room(text[first - 1])) >= 0:
        first -= 1
    free = _SHOWN - sum(map(_room, text[first:place]))
    while last < end and (free := free - _room(text[last])) >= 0:
        last += 1
    if last == end:
        while first > start and (free := free - _room(text[first - 1])) >= 0:
            first -= 1
    return first, last


def _room(character: str) -> float:
    """Return the columns of a character; marks above others take some, too, so that there are not too many."""
    return _width(_plain(character)) or 0.5


def _width(text: str) -> int:
    """Return the columns of a terminal that a text takes."""
    wide = unicodedata.east_asian_width
    return sum(0 if unicodedata.category(c) in _ABOVE else 1 + (wide(c) in "WF") for c in text)
