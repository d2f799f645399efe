"""The bytes of a file as they come: what is still needed of them, where it stood, and the checksum of all before."""

from __future__ import annotations

from analyzer._native import crc32


class FileWindow:
    """A window of the file.

    `data[at:]` is not read yet, and bytes from `kept` on stay. `at` may stand behind the end of `data`: those bytes are
    thrown away when they come.
    """

    def __init__(self) -> None:
        self.data = b""
        self.at = self.kept = 0
        self._base = self._size = self._wanted = self._crc = 0
        self._pending: list[bytes] = []

    @property
    def place(self) -> int:
        """The byte of the file where reading stands."""
        return self._base + self.at

    @property
    def size(self) -> int:
        """Bytes that have come so far."""
        return self._size

    def need(self, count: int) -> None:
        """There is nothing to do before `count` bytes from `at` on are there."""
        self._wanted = self.place + count

    def skip(self, count: int) -> None:
        """As many bytes are done with, those included that have not come yet."""
        self.at += count
        self.kept = self.at

    def push(self, piece: bytes) -> bool:
        """Take the next bytes; return whether all are there that were needed."""
        self._pending.append(piece)
        self._size += len(piece)
        if self._size < self._wanted and self.at <= len(self.data):
            return False
        keep = min(self.kept, self.at, len(self.data))
        self._crc = crc32(self.data, self._crc, 0, keep)
        rest = self.data[keep:]
        self.data = b"".join([rest, *self._pending]) if rest or len(self._pending) > 1 else piece
        self._pending.clear()
        self._base += keep
        self.at -= keep
        self.kept -= keep
        if self.at > len(self.data):
            self._drop()
        return self._size >= self._wanted

    def crc(self) -> int:
        """Return the checksum of all bytes in front of `at`."""
        return crc32(self.data, self._crc, 0, self.at)

    def _drop(self) -> None:
        self._crc = crc32(self.data, self._crc)
        self._base += len(self.data)
        self.at -= len(self.data)
        self.kept -= len(self.data)
        self.data = b""
