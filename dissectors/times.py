"""Units of time in nanoseconds, and the value that stands for no time."""

from __future__ import annotations

MICROSECOND = 1_000
MILLISECOND = 1_000_000
SECOND = 1_000_000_000

# In place of a time that a capture does not have: the lowest number of 64 bits.
NO_TIME = -(1 << 63)
