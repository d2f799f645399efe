"""The session, which runs in another thread, as the monitor needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from analyzer.board.snapshot import Snapshot


class Feed(Protocol):
    """Called from the thread of the monitor; every method returns at once.

    An action gives the line that tells the user of it, empty for none.
    """

    @property
    def ended(self) -> bool:
        """True if the session is over, so that the monitor has to go."""

    def snapshot(self) -> Snapshot | None:
        """Return the newest state; None until there is one."""

    def mark(self) -> str:
        """Set a mark in the recording; what is latched begins anew."""

    def clear(self) -> str:
        """Forget findings, what is latched, and rows of what is gone."""

    def save(self) -> str:
        """Write down what there is to report now."""

    def browse(self) -> str:
        """Have what comes from now on looked through, as soon as the monitor has gone."""

    def stop(self) -> None:
        """End the session, as the user has quit. Called once."""
