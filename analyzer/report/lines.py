"""Lines of a width: what the formats for a terminal are laid out with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Iterable

NARROWEST = 40
GAP = "  "


def wrap(text: str, width: int, *, first: str = "", indent: str = "") -> list[str]:
    """Break `text` into lines of at most `width` columns, the first behind `first`, the others behind `indent`.

    A word that is wider than a line is cut; wide characters count two.
    """
    lines, line, used = list[str](), first, display_width(first)
    begun = False
    for word in text.split():
        size = display_width(word)
        if begun and used + 1 + size <= width:
            line, used = f"{line} {word}", used + 1 + size
            continue
        if begun:
            lines.append(line)
            line, used = indent, display_width(indent)
        *full, rest = _cut(word, width - used, width - display_width(indent)) if used + size > width else [word]
        for piece in full:
            lines.append(line + piece)
            line, used = indent, display_width(indent)
        line, used = line + rest, used + display_width(rest)
        begun = True
    return [*lines, line]


def _cut(word: str, first: int, width: int) -> list[str]:
    """Cut a word into pieces of at most `first` and then `width` columns, none of them empty."""
    pieces, start, used, room = list[str](), 0, 0, first
    for at, c in enumerate(word):
        size = display_width(c)
        if used + size > room and at > start:
            pieces.append(word[start:at])
            start, used, room = at, 0, width
        used += size
    return [*pieces, word[start:]]


def pack(pieces: Iterable[str], width: int, indent: str, *, whole: str = "") -> list[str]:
    """Join pieces as far as they fit, then `whole`; only a piece that fits in no line is wrapped, `whole` never."""
    lines, line = list[str](), ""
    for piece, cuttable in [*((piece, True) for piece in pieces), (whole, False)]:
        if not piece:
            continue
        joined = f"{line}{GAP}{piece}" if line else indent + piece
        if display_width(joined) <= width:
            line = joined
            continue
        if line:
            lines.append(line)
        *full, line = wrap(piece, width, first=indent, indent=indent) if cuttable else [indent + piece]
        lines += full
    return [*lines, line] if line else lines


def right(lines: list[str], end: str, width: int) -> list[str]:
    """Return `lines` with `end` at the right margin of the last one, or of one more."""
    room = width - display_width(end)
    if display_width(lines[-1]) + len(GAP) > room:
        lines = [*lines, ""]
    return [*lines[:-1], columns(lines[-1], room) + end]


def columns(text: str, width: int) -> str:
    """Return `text` with blanks behind it up to `width` columns."""
    return text + " " * (width - display_width(text))
