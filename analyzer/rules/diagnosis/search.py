"""The search for causes: the core looks around broken transfers, many at once, and rules judge what it finds."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from analyzer._native import diagnose
from analyzer.decode.sent import cells
from analyzer.rules.diagnosis.causes import FORMS, GONE, Cause

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array, View

BROKEN, CHECKSUM, REMAINDER, COPY, INSIDE = range(5)  # what may be asked: in the order of the core's questions
PROVEN, LATER, ELSEWHERE, MISNUMBERED, LENGTHS = (1 << bit for bit in range(5))  # bits of `Answers.flags`
BEFORE, AHEAD = 2048, 512  # frames before a transfer and behind it that may be looked at
_OF_FORM = np.array([[form.what for form in FORMS].index(form.what) for form in FORMS])


class FrameLists(NamedTuple):
    """Lists of frame numbers: list `k` is `numbers[offsets[k]:offsets[k + 1]]`; `fd` marks those of CAN FD."""

    numbers: Array
    offsets: Array
    code: Array
    fd: Array

    @classmethod
    def of(cls, lists: Sequence[Sequence[int]], code: Sequence[int], fd: Sequence[bool]) -> Self:
        """Return them in columns; each is of frames of one session and type."""
        numbers = np.array([number for some in lists for number in some], np.uint64)
        offsets = np.cumsum([0, *map(len, lists)], dtype=np.int64)
        return cls(numbers, offsets, np.array(code, np.int64), np.array(fd, bool))


class FrameSearch:
    """Answers about lists of frames.

    `form` says which of `FORMS`, `flags` what else is known, `value` depends on the question. `numbers` and `shown` are
    offsets and numbers: those of the form, and frames that show it.
    """

    def __init__(self, form: Array, flags: Array, value: Array, numbers: _Lists, shown: _Lists) -> None:
        self.form = form
        self.flags = flags
        self.value = value
        self._numbers = numbers
        self.shown = shown

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.form)

    @property
    def gone(self) -> Array:
        """A mask of those whose surroundings are gone."""
        found: Array = self.form == GONE
        return found

    @property
    def kinds(self) -> Array:
        """A form for each that is the same where the same thing happened."""
        found: Array = _OF_FORM[self.form]
        return found

    def cause(self, k: int) -> Cause:
        """Return the cause of one in words."""
        found: Cause = FORMS[self.form.item(k)].cause(*_list(self._numbers, k))
        return found

    def evidence(self, k: int) -> list[int]:
        """Return frames that show it, beside those that were asked about."""
        return _list(self.shown, k)


_Lists = tuple["Array", "Array"]
_NONE = np.zeros(1, np.int64), np.empty(0, np.uint64)
_NOTHING = FrameSearch(np.empty(0, np.uint8), np.empty(0, np.uint8), np.empty(0, np.int64), _NONE, _NONE)


def _list(lists: _Lists, k: int) -> list[int]:
    offsets, numbers = lists
    found: list[int] = numbers[offsets.item(k) : offsets.item(k + 1)].tolist()
    return found


def ask(view: View, question: int, lists: FrameLists) -> FrameSearch:
    """Return what the core finds out about lists of frames."""
    numbers, offsets, code, fd = lists
    if not len(code):
        return _NOTHING
    codes, which = np.unique(code, return_inverse=True)
    low, high = int(numbers.min()), int(numbers.max())
    types = [*map(view.types.framing, codes.tolist())]
    form, flags, value, numbers_of, shown = diagnose(
        question, [*view.indexes(low - BEFORE, high + 1 + AHEAD)], types,
        (numbers.astype(np.uint64), offsets.astype(np.int64), which.astype(np.uint32), fd.astype(np.uint8)),
    )  # fmt: skip
    return FrameSearch(
        cells(form, np.uint8), cells(flags, np.uint8), cells(value, np.int64),
        *((cells(ends, np.int64), cells(every, np.uint64)) for ends, every in (numbers_of, shown)),
    )  # fmt: skip
