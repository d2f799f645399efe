"""Tables on a terminal: columns as wide as their cells, narrowed and wrapped where the line ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.views.page.prose import Fragment, Word, paint, width_of, wrap

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.views.terminal import Palette

    Cell = Sequence[Word]
    Row = Sequence[Cell]

_GAP = 2
# A column that has to be narrower than its cells keeps this much, or its longest word.
_NARROW = 16


def grid(head: Row, rows: Sequence[Row], width: int, palette: Palette, right: Sequence[bool] = ()) -> Iterator[str]:
    """Yield the lines of a table that is at most `width` columns wide.

    Args:
        head: the cells of the header; it is left out if all are empty.
        rows: as many cells each as `head`.
        width: columns of the terminal.
        palette: colours of the header and of styled words.
        right: which columns are numbers, to be set flush right; none if not given.
    """
    sizes = _sizes([head, *rows], width)
    flush = [*right, *[False] * (len(head) - len(right))]
    if any(head):
        bold = [[tuple(Fragment("head", part.text) for part in word) for word in cell] for cell in head]
        yield from _row(bold, sizes, flush, palette)
        yield (" " * _GAP).join("-" * size for size in sizes)
    for row in rows:
        yield from _row(row, sizes, flush, palette)


def _sizes(rows: Sequence[Row], width: int) -> list[int]:
    """Return the widths of the columns: those that need less than their share leave the rest to the others."""
    wanted = [max(map(width_of, column)) for column in zip(*rows, strict=True)]
    room = width - _GAP * (len(wanted) - 1)
    sizes = dict[int, int]()
    for left, at in zip(range(len(wanted), 0, -1), sorted(range(len(wanted)), key=wanted.__getitem__), strict=True):
        least = min(wanted[at], _NARROW)
        sizes[at] = max(least, min(wanted[at], (room - sum(sizes.values())) // left))
    return [max(1, sizes[at]) for at in range(len(wanted))]


def _row(cells: Row, sizes: Sequence[int], right: Sequence[bool], palette: Palette) -> Iterator[str]:
    columns = [wrap(cell, size) for cell, size in zip(cells, sizes, strict=True)]
    for at in range(max(map(len, columns))):
        line = ""
        for lines, size, flush in zip(columns, sizes, right, strict=True):
            text = lines[at] if at < len(lines) else []
            blanks = " " * (size - width_of(text))
            line += (blanks + paint(text, palette) if flush else paint(text, palette) + blanks) + " " * _GAP
        yield line.rstrip()
