"""The objects of a BLF file, one after another: in the file itself, and in what its containers unpack to."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SIGNATURE = b"LOBJ"
# Signature, size of the header, its version, size of the object, type.
_BASE = struct.Struct("<4sHHLL")
# Writers fill up with at most this many bytes behind an object.
_PADDING = 8
_NEXT = _PADDING + len(SIGNATURE)
# Larger than a container of any writer; a size beyond it is damage.
_LARGEST = 1 << 24
_LARGEST_HEADER = 256
# There are 1 and 2.
_LARGEST_VERSION = 15


class Object(NamedTuple):
    """One object: where it begins, its type, the version of its header, all of its bytes."""

    at: int
    kind: int
    version: int
    data: bytes


class StrayBytes(NamedTuple):
    """Bytes that are no object begin here."""

    at: int


class Objects:
    """Cuts a stream into objects. After damage it goes on at the next signature.

    A damaged size hides none of the objects behind it: it counts only if another object or the end follows, and if it
    is the one that `sizes` has for the type, which is what must stand behind the header.
    """

    def __init__(self, sizes: Mapping[int, int]) -> None:
        self._sizes = sizes
        self._held = bytearray()
        self._at = 0
        self._lost = False

    def feed(self, data: bytes) -> Iterator[Object | StrayBytes]:
        """Return the objects that are whole by now."""
        self._held += data
        yield from self._cut(final=False)

    def finish(self) -> Iterator[Object | StrayBytes]:
        """Return the objects that waited for one behind them."""
        yield from self._cut(final=True)

    @property
    def unfinished(self) -> tuple[int, bytes] | None:
        """After `finish`: where an object begins that has no end, and what there is of it."""
        rest = bytes(self._held).lstrip(b"\0")
        if not rest or (self._lost and not rest.startswith(SIGNATURE)):
            return None
        return self._at + len(self._held) - len(rest), rest

    def _cut(self, *, final: bool) -> Iterator[Object | StrayBytes]:
        at = 0
        while (step := self._step(at, final=final)) is not None:
            found, at = step
            if found is not None:
                yield found
        del self._held[:at]
        self._at += at

    def _step(self, at: int, *, final: bool) -> tuple[Object | StrayBytes | None, int] | None:
        """Return what stands next and where to go on; None when more bytes are needed."""
        start = self._held.find(SIGNATURE, at, at + _NEXT)
        if start < 0:
            return self._search(at)
        left = len(self._held) - start
        if left < _BASE.size:
            return None
        _, _, version, size, kind = _BASE.unpack_from(self._held, start)
        if not self._sane(start):
            return self._gap(start, start + len(SIGNATURE))
        end = start + size
        if left < size + (0 if final else _NEXT):
            inner = self._inner(start, len(self._held)) if final else -1
            return self._gap(start, inner) if inner >= 0 else None
        inner = self._swallowed(start, end)
        if inner >= 0:
            return self._gap(start, inner)
        self._lost = False
        return Object(self._at + start, kind, version, bytes(self._held[start:end])), end

    def _search(self, at: int) -> tuple[StrayBytes | None, int] | None:
        """No signature is near: the next one there is, if what is here cannot be padding."""
        left = len(self._held) - at
        if left < _NEXT and not self._lost:
            return None
        after = self._held.find(SIGNATURE, at)
        if after < 0:
            after = max(at, len(self._held) - len(SIGNATURE) + 1)
        return None if self._lost and after == at else self._gap(at, after)

    def _gap(self, start: int, after: int) -> tuple[StrayBytes | None, int]:
        """One gap is told once, however many bytes are passed over one after another."""
        found = None if self._lost else StrayBytes(self._at + start)
        self._lost = True
        return found, after

    def _swallowed(self, start: int, end: int) -> int:
        """Where another object begins inside this one, if its size is not to be trusted; else -1.

        Bytes like a signature in the data of a frame are none: no header follows them.
        """
        _, header, _, size, kind = _BASE.unpack_from(self._held, start)
        follows = self._held.find(SIGNATURE, end, end + _NEXT) >= 0 or len(self._held) - end < _NEXT
        if follows and self._sizes.get(kind, size - header) == size - header:
            return -1
        return self._inner(start, end + len(SIGNATURE) - 1)

    def _inner(self, start: int, end: int) -> int:
        inner = start
        while (inner := self._held.find(SIGNATURE, inner + 1, end)) >= 0:
            if len(self._held) - inner >= _BASE.size and self._sane(inner):
                return inner
        return -1

    def _sane(self, start: int) -> bool:
        _, header, version, size, _ = _BASE.unpack_from(self._held, start)
        known = version <= _LARGEST_VERSION and size <= _LARGEST
        return bool(known and _BASE.size <= header <= min(size, _LARGEST_HEADER))
