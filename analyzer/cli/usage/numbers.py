"""Numbers of frames and flights as people write them."""

from __future__ import annotations

import re
import sys


def flight_number(text: str) -> int:
    """Return the number of a flight, -1 for the last. Raises `ValueError`."""
    if text.strip() == "last":
        return -1
    if not text.isdecimal() or not whole(text):
        raise ValueError(f"{text!r} is no flight (1, 2, ... or last)")
    return whole(text)


def frame_range(text: str) -> tuple[int, int]:
    """Return the first and the last number of `100-200`, `100-`, `-200` or `100`. Raises `ValueError`."""
    match = re.fullmatch(r"(\d*)(-?)(\d*)", text.strip())
    if match is None or not (match[1] or match[3]):
        raise ValueError(f"{text!r} is not a range of frame numbers (100-200, 100-, -200, 100)")
    first = whole(match[1] or "1")
    last = whole(match[3]) if match[3] else (sys.maxsize if match[2] else first)
    if first < 1:
        raise ValueError("frame numbers start at 1")
    if first > last:
        raise ValueError(f"{text!r} ends before it starts")
    return first, last


def whole(digits: str) -> int:
    """Return a number as large as anybody can count frames, however many digits it is given with."""
    digits = digits.strip().lstrip("0") or "0"
    return min(int(digits[:20]), sys.maxsize)
