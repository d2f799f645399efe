"""Why a capture cannot be read, or not to its end."""

from __future__ import annotations


class CaptureError(Exception):
    """A capture that cannot be read, or not to its end; says which, where and why.

    Attributes:
        name: the capture.
        place: where in it, empty if nowhere.
        reason: why.
    """

    def __init__(self, name: str, place: str, reason: str) -> None:
        super().__init__(f"{name}: {place}: {reason}" if place else f"{name}: {reason}")
        self.name, self.place, self.reason = name, place, reason

    def __reduce__(self) -> tuple[type[CaptureError], tuple[str, str, str]]:
        """Pickle it with its three parts, not with its text."""
        return type(self), (self.name, self.place, self.reason)


class UnavailableError(CaptureError):
    """A capture that could not be read now: it is missing, not permitted, or its disk or network failed.

    Nothing is known of what it holds; another time it may be read.
    """


class MergeError(ValueError):
    """Captures that cannot be merged as asked; says what to give."""


class UnpackError(Exception):
    """Damage of compressed data: the number of stored bytes in front of it, and what it is."""

    def __init__(self, place: int, reason: str) -> None:
        super().__init__(place, reason)
        self.place, self.reason = place, reason


class StopReading(BaseException):
    """Raised into a source that waits, by a signal handler: the capture ends with what has come so far."""
