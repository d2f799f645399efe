"""A capture in a folder or in a storage, as a stream that is never in memory as a whole."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, BinaryIO, cast

from analyzer.sources import UnavailableError

if TYPE_CHECKING:
    from collections.abc import Iterator

_BLOCK = 4 << 20  # bytes that are asked for at once: as much as a source reads


class Stream:
    """A binary file object with a name, which any source takes."""

    def __init__(self, name: str, file: BinaryIO) -> None:
        self.name, self._file = name, file
        self.read, self.seek, self.tell, self.seekable = file.read, file.seek, file.tell, file.seekable


@contextmanager
def opened(url: str) -> Iterator[Stream]:
    """Open it. Raises `UnavailableError` for whatever a storage says against it."""
    import fsspec  # noqa: PLC0415 - of the extra

    try:
        files, path = fsspec.core.url_to_fs(url)
        file = cast("BinaryIO", files.open(path, "rb", block_size=_BLOCK, cache_type="readahead"))
    except Exception as error:  # noqa: BLE001 - whatever a storage raises
        reason = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        raise UnavailableError(url, "", reason) from None
    with file:
        yield Stream(url, file)
