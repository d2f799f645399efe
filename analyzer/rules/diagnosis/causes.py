"""Causes of broken transfers, as the core finds them, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.frame_text import FrameNumber, FrameText, listed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

WRONG_BIT = "wrong toggle bit at the sender"
EITHER = "frames swapped or wrong toggle bits"  # of two that are equal otherwise, which nobody can tell
END_BIT, START_BIT = "wrong end bit at the sender", "wrong start bit at the sender"
EVERY_START, EVERY_END = "start bit in every frame at the sender", "end bit in every frame at the sender"
EVERY_ID = "transfer ID counted for every frame at the sender"
SWAPPED = "frames swapped"
REPEATED = "a frame repeated later"
OTHER_SENDER = "frames of another sender in between"
OTHER_ID = "wrong transfer ID"
LATE_COPY = "a late copy"
UNPROVEN = "a frame lost or out of order"  # nothing is known that the CRC could be checked with
LOST, LOST_SEVERAL = "one frame lost", "several frames lost"
LOST_ODD = "an odd number of frames lost"  # one, most likely; the toggles cannot tell
FIRST, FIRSTS = "first frame lost", "first frames lost"
LAST, LASTS = "last frame lost", "last frames lost"
NO_ORDER = "its frames fit in no order"
TOO_MANY = "more frames than the type has"
SHORT_FRAME = "a frame inside not full"
NOT_SEARCHED = "further ones, cause not sought"


class Cause(NamedTuple):
    """`what` is the same for all transfers that the same thing happened to, `detail` is of this one."""

    what: str
    detail: str = ""

    def behind(self, text: str) -> str:
        """Return all of it behind a text."""
        text += self.what
        return FrameText(text, self.detail) if isinstance(self.detail, FrameText) else text + self.detail


def ordinal(number: int) -> str:
    """Return `1st`, `2nd`, `3rd`, `4th`, and so on."""
    ending = "th" if number % 100 in {11, 12, 13} else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def late_copy(frames: Sequence[int]) -> Cause:
    """Return the cause of frames that came before with these numbers, from 0."""
    return Cause(LATE_COPY, FrameText(f" of {'frame' if len(frames) == 1 else 'frames'} ", listed(frames)))


def wrong_id(frames: Sequence[int]) -> Cause:
    """Return the cause of a frame with another transfer ID; of several nobody knows which."""
    return Cause(OTHER_ID, FrameText(" in frame ", listed(frames, " or ")))


def _bit(what: str) -> Callable[..., Cause]:
    return lambda frame: Cause(what, FrameText(" (frame ", FrameNumber.at(frame), ")"))


def _too_much(what: str) -> Callable[..., Cause]:
    return lambda *frames: Cause(what, FrameText(" (too much: ", listed(frames), ")"))


def _from(what: str) -> Callable[..., Cause]:
    return lambda place: Cause(what, f" (from the {ordinal(place)} on)")


def _plain(what: str) -> Callable[..., Cause]:
    return lambda: Cause(what)


class CauseForm(NamedTuple):
    """A finding of the core: the cause, and what makes it of the numbers that were found with it."""

    what: str
    cause: Callable[..., Cause]


def _form(make: Callable[[str], Callable[..., Cause]], what: str) -> CauseForm:
    return CauseForm(what, make(what))


# In the order of the core's; those that are of frames inside other transfers have no words here.
FORMS = (
    _form(_plain, ""),
    _form(_plain, NOT_SEARCHED),
    _form(_plain, WRONG_BIT),
    _form(_plain, EITHER),
    _form(_bit, END_BIT),
    _form(_bit, START_BIT),
    CauseForm(OTHER_ID, lambda *frames: wrong_id(frames)),
    CauseForm(SWAPPED, lambda *frames: Cause(SWAPPED, FrameText(" (right order: ", listed(frames), ")"))),
    _form(_too_much, REPEATED),
    _form(_too_much, OTHER_SENDER),
    CauseForm(LATE_COPY, lambda *frames: late_copy(frames)),
    _form(_plain, EVERY_START),
    _form(_plain, EVERY_END),
    _form(_plain, EVERY_ID),
    CauseForm(TOO_MANY, lambda came, total: Cause(TOO_MANY, f" ({came} instead of {total})")),
    _form(_plain, NO_ORDER),
    _form(_plain, UNPROVEN),
    _form(_from, LOST_SEVERAL),
    CauseForm(
        LOST_SEVERAL, lambda least, place: Cause(LOST_SEVERAL, f" (at least {least}, from the {ordinal(place)} on)")
    ),
    _form(_from, LOST_ODD),
    CauseForm(
        LOST_SEVERAL,
        lambda gone, total, place: Cause(LOST_SEVERAL, f" ({gone} of {total}, from the {ordinal(place)} on)"),
    ),
    CauseForm(LOST, lambda place, total: Cause(LOST, f" (the {ordinal(place)} of {total})")),
    CauseForm(LOST_SEVERAL, lambda gone, total: Cause(LOST_SEVERAL, f" ({gone} of {total})")),
    CauseForm(LOST_SEVERAL, lambda: Cause(LOST_SEVERAL, ", the first one too")),
    _form(_from, LASTS),
    CauseForm(LAST, lambda total: Cause(LAST, f" (the {ordinal(total)} of {total})")),
    CauseForm(LASTS, lambda place, total: Cause(LASTS, f" (the {ordinal(place)} to {ordinal(total)} of {total})")),
    _form(_plain, FIRST),
    _form(_plain, FIRSTS),
    CauseForm(FIRST, lambda total: Cause(FIRST, f" (of {total})")),
    CauseForm(FIRSTS, lambda gone, total: Cause(FIRSTS, f" ({gone} of {total})")),
    CauseForm(
        SHORT_FRAME,
        lambda size, frame: Cause(
            SHORT_FRAME, FrameText(f" ({size} bytes in frame ", FrameNumber.at(frame), ", TRF-012)")
        ),
    ),
    *(_form(_plain, "") for _ in range(4)),
)
NOTHING, GONE, OTHER_ID_FORM, EVERY_ID_FORM, SHORT = 0, 1, 6, 13, 31
NOTED = {EVERY_ID, OTHER_ID}  # TRF-009 names the frames
FOREIGN_RIGHT, FOREIGN, BELONGS, INSIDE = range(32, 36)
