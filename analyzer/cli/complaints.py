"""Complaints on standard error, held back while something else owns the terminal."""

from __future__ import annotations

from analyzer.app.process import streams


class Complaints:
    """Takes lines; calling it with one says it, or keeps it until `release`; a `mute` one never says anything."""

    def __init__(self, *, mute: bool = False) -> None:
        self._held: list[str] | None = None
        self._mute = mute

    def __call__(self, text: str) -> None:
        """Say a line, at once or later."""
        if self._mute:
            return
        if self._held is None:
            streams.complain(text)
        else:
            self._held.append(text)

    def hold(self, wanted: bool = True) -> None:
        """Keep what comes from now on, if that is wanted."""
        self._held = [] if wanted else None

    def release(self) -> None:
        """Say what was held back, and everything at once from now on."""
        held, self._held = self._held, None
        for text in held or ():
            streams.complain(text)
