"""How much work a file is worth: neither damage nor malice keeps the reader busy for long."""

from __future__ import annotations

from analyzer.sources.mcap.records import LIMIT

# Unpacked bytes that any file may have (one chunk of the largest size), and those for each byte of the file. The index
# of messages that writers store beside chunks keeps real files far below, however alike their messages are.
_RATIO = 1000
# Steps of about a microsecond that any file may cost, and those for each byte: more than bytes that are not compressed
# can ask for.
_STEPS, _PER_BYTE = 1 << 19, 0.5


class Effort:
    """The work spent on chunks and definitions so far; `read` are the bytes of the file up to the record at hand."""

    def __init__(self) -> None:
        self.read = 0
        self._unpacked = self._spent = 0

    def unpack(self, size: int) -> bool:
        """Return whether so many more bytes may be unpacked."""
        if self._unpacked + size > LIMIT + _RATIO * self.read:
            return False
        self._unpacked += size
        return True

    def spend(self, steps: int) -> bool:
        """Count steps; return whether there may be so many."""
        self._spent += steps
        return self._spent <= _STEPS + _PER_BYTE * self.read
