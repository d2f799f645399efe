"""Styled text in lines of a width: a word is a run of fragments without a blank, each in a style of the palette."""

from __future__ import annotations

from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

from analyzer.views.terminal import display_width, escape

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.views.terminal import Palette


class Fragment(NamedTuple):
    """A part of a word in one style; the empty style is plain text."""

    style: str
    text: str


Word = tuple[Fragment, ...]


def words(fragments: Iterable[Fragment]) -> list[Word]:
    """Return the words of running text; a word may change its style inside, as in `TRF`-010."""
    found: list[Word] = []
    word: list[Fragment] = []
    for style, text in fragments:
        for at, part in enumerate(text.split(" ")):
            if at and word:
                found.append(tuple(word))
                word = []
            if part:
                word.append(Fragment(style, escape(part)))
    return [*found, tuple(word)] if word else found


def width_of(line: Iterable[Word]) -> int:
    """Return the terminal columns that the words take with a blank between two of them."""
    sizes = [sum(display_width(fragment.text) for fragment in word) for word in line]
    return sum(sizes) + max(0, len(sizes) - 1)


def wrap(text: Iterable[Word], width: int) -> list[list[Word]]:
    """Return lines of at most `width` columns, at least one; a word that is wider than that is cut."""
    lines: list[list[Word]] = [[]]
    for whole in text:
        for word in _cut(whole, max(1, width)):
            if lines[-1] and width_of([*lines[-1], word]) > width:
                lines.append([])
            lines[-1].append(word)
    return lines


def paint(line: Iterable[Word], palette: Palette) -> str:
    """Return a line as text; words of one style side by side are painted as one."""
    fragments: list[Fragment] = []
    for word in line:
        if fragments:
            fragments.append(Fragment(word[0].style if word[0].style == fragments[-1].style else "", " "))
        fragments += word
    runs = ((style, "".join(part.text for part in run)) for style, run in groupby(fragments, key=attrgetter("style")))
    return "".join(palette.paint(style, text) if style else text for style, text in runs)


def _cut(word: Word, width: int) -> list[Word]:
    if width_of([word]) <= width:
        return [word]
    pieces: list[list[Fragment]] = [[]]
    used = 0
    for style, text in word:
        for character in text:
            size = display_width(character)
            if used + size > width and used:
                pieces.append([])
                used = 0
            pieces[-1].append(Fragment(style, character))
            used += size
    return [tuple(piece) for piece in pieces]
