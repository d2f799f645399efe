"""Other commands, run for the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence


class Tools(Protocol):
    """Other commands, and what is kept for the user; `said` are lines about what has ended meanwhile."""

    said: list[str]

    def write(self, path: str, filter_text: str) -> str:
        """Write what a filter selects to a file; return what was done. Raises `ValueError` with the reason why not."""

    def plot(self, frame: int) -> str:
        """Open the picture around a frame, from 0; return what was done. Raises `ValueError`."""

    def keep_filter(self, text: str) -> None:
        """Keep a filter for the next time."""

    def keep_columns(self, names: Sequence[str]) -> None:
        """Keep columns for the next time."""
