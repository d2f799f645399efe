"""Compression around a whole output."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, BinaryIO, cast

if TYPE_CHECKING:
    from collections.abc import Iterator

_GZIP_LEVEL = 6


@contextmanager
def packed(file: BinaryIO, packing: str) -> Iterator[BinaryIO]:
    """Open what brings bytes to `file` as `gzip`, `zstd`, or as they are; only a block that ends well ends it."""
    if not packing:
        yield file
        return
    inner: BinaryIO
    if packing == "gzip":
        from gzip import GzipFile  # noqa: PLC0415 - only what is needed

        inner = cast("BinaryIO", GzipFile("", "wb", _GZIP_LEVEL, file, mtime=0))  # same input, same bytes
    else:
        import zstandard  # noqa: PLC0415

        inner = cast("BinaryIO", zstandard.ZstdCompressor().stream_writer(file, closefd=False))
    yield inner
    inner.close()
