"""Texts that name frames: the numbers in them are known as such, so that they can be those of another capture."""

from __future__ import annotations

from functools import lru_cache
from string import Formatter
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    Piece = str | int


class FrameNumber(int):
    """The number of a frame as texts name it, from 1."""

    __slots__ = ()

    @classmethod
    def at(cls, place: int) -> FrameNumber:
        """Return that of the frame at a place, from 0."""
        return cls(place + 1)


class FrameText(str):
    """A text that knows its `pieces`: plain ones, and numbers of frames."""

    __slots__ = ("pieces",)
    pieces: Sequence[Piece]

    def __new__(cls, *pieces: Piece) -> Self:
        """Join pieces; of texts that know theirs, these."""
        flat: list[Piece] = []
        for piece in pieces:
            if isinstance(piece, FrameText):
                flat += piece.pieces
            else:
                flat.append(piece)
        made = super().__new__(cls, "".join(map(str, flat)))
        made.pieces = flat
        return made

    def moved(self, place: Callable[[int], int]) -> FrameText:
        """Return it with other numbers: `place` gives that of each frame, both from 0."""
        return FrameText(
            *(FrameNumber.at(place(one - 1)) if isinstance(one, FrameNumber) else one for one in self.pieces)
        )


_KNOWING = FrameNumber, FrameText


def listed(places: Sequence[int], between: str = ", ") -> FrameText:
    """Return the numbers of frames at some places, from 0."""
    numbers = [one for place in places for one in (between, FrameNumber.at(place))]
    return FrameText(*numbers[1:])


@lru_cache(maxsize=512)
def _parsed(text: str) -> Sequence[tuple[str, str | None, bool, str]]:
    """Return the pieces of a text that `str.format_map` takes: a text is filled many times.

    Each is plain, and then names a value, or None, as it is or not; the last one is what fills in that value.
    """
    found = []
    for plain, name, spec, conversion in Formatter().parse(text):
        found.append((plain, name, not spec, f"{{{name}{f'!{conversion}' if conversion else ''}:{spec}}}"))
    return found


def filled(text: str, values: Mapping[str, Any]) -> str:
    """Return what `str.format_map` does; it knows its numbers of frames if it has some."""
    for value in values.values():
        if isinstance(value, _KNOWING):
            break
    else:
        return text.format_map(values)
    pieces: list[Piece] = []
    for plain, name, whole, form in _parsed(text):
        pieces.append(plain)
        value = values.get(name) if name else None
        if whole and isinstance(value, _KNOWING):
            pieces.append(value)
        elif name is not None:
            pieces.append(form.format_map(values))
    return FrameText(*pieces)
