"""Why a capture cannot be read, or not to its end."""

from __future__ import annotations


class CaptureError(Exception):
    """A capture that cannot be read, or not to its end; says which, where and why."""

    def __init__(self, name: str, place: str, reason: str) -> None:
        super().__init__(f"{name}: {place}: {reason}" if place else f"{name}: {reason}")


class MergeError(ValueError):
    """Captures that cannot be merged as asked; says what to give."""


class UnpackError(Exception):
    """Damage of compressed data: the number of stored bytes in front of it, and what it is."""

    def __init__(self, place: int, reason: str) -> None:
        super().__init__(reason)
        self.place, self.reason = place, reason


class StopReading(BaseException):
    """Raised into a source that waits, by a signal handler: the capture ends with what has come so far."""
