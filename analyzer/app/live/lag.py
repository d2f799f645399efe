"""Lag that is told: when judging is slower than the bus, what is shown is old."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Seconds from which on it is told, and below which it is over.
BEHIND, OVER = 2.0, 0.5


class Delay:
    """Says how far something is behind: when that begins, each time it has doubled, and when it is over.

    Args:
        subject: stands in front.
        why: what makes it so.
    """

    def __init__(self, subject: str, why: str) -> None:
        self._subject, self._why = subject, why
        self._next = BEHIND

    def line(self, behind: float) -> str:
        """Return what there is to say, so many seconds behind; mostly nothing."""
        if behind >= self._next:
            self._next = 2 * behind
            return f"{self._subject}behind by {behind:.1f} s: {self._why}"
        if behind < OVER and self._next > BEHIND:
            self._next = BEHIND
            return f"{self._subject}no longer behind"
        return ""


class Lag:
    """Tells how far a session is behind.

    Args:
        tell: takes a line.
    """

    def __init__(self, tell: Callable[..., None]) -> None:
        self.failed = False
        self._tell = tell
        self._delay = Delay("", "frames come faster than they are judged")

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def look(self, session: LiveSession) -> None:
        """Tell what there is to tell."""
        if line := self._delay.line(session.loop.behind):
            self._tell(line)
