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


class Lag:
    """Tells how far a session is behind: when that begins, each time it has doubled, and when it is over.

    Args:
        tell: takes a line.
    """

    def __init__(self, tell: Callable[..., None]) -> None:
        self.failed = False
        self._tell = tell
        self._next = BEHIND

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def look(self, session: LiveSession) -> None:
        """Tell what there is to tell."""
        behind = session.loop.behind
        if behind >= self._next:
            self._tell(f"behind by {behind:.1f} s: frames come faster than they are judged")
            self._next = 2 * behind
        elif behind < OVER and self._next > BEHIND:
            self._tell("no longer behind")
            self._next = BEHIND
