"""What a receiver gives, as lines of text, with a clock that goes on when somebody waits."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from command import START

from analyzer._native import Writer

if TYPE_CHECKING:
    from analyzer._native import Piece
    from analyzer.live.receiver import Receiver

SECOND = 10**9


class Clock:
    """Goes on when somebody waits."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def ns(self) -> int:
        return START + round(self.seconds * SECOND)

    def now(self) -> float:
        return self.seconds

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.seconds += seconds


def text(piece: Piece | None) -> list[str]:
    """Its rows as lines, with times in seconds from the start of the test; remarks and drops without theirs."""
    assert piece is not None
    found = Writer("candump").write(piece).decode()
    found = re.sub(r"^(# )\(\S+\) |^(DROPCOUNT.*\)) \(\S+\)$", r"\1\2", found, flags=re.MULTILINE)
    return re.sub(r"\((\d+)\.", lambda stamp: f"({int(stamp[1]) - START // SECOND:02}.", found).splitlines()


def everything(receiver: Receiver, clock: Clock, seconds: float = 1.0) -> list[str]:
    """What it gives in this time, which passes when there is nothing."""
    found: list[str] = []
    end = clock.seconds + seconds
    while clock.seconds < end:
        piece = receiver.receive(0.01)
        if piece is None:
            clock.seconds += 0.01
        else:
            found += text(piece)
    return found
