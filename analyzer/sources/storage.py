"""Captures at an address (s3://, gs://, https://, sftp:// ...), as streams that are never in memory as a whole."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, cast

from analyzer.sources.errors import UnavailableError

if TYPE_CHECKING:
    from typing import BinaryIO

_BLOCK = 4 << 20  # bytes that are asked for at once: as much as a source reads
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://")


def is_address(name: str) -> bool:
    """Return whether a name is the address of a storage, not a path."""
    return _ADDRESS.match(name) is not None


class Stream:
    """A binary file object with a name, which any source takes; whoever opened it closes it."""

    def __init__(self, name: str, file: BinaryIO) -> None:
        self.name, self.close, self._seek = name, file.close, file.seek
        self.read, self.tell, self.seekable = file.read, file.tell, file.seekable

    def seek(self, place: int, whence: int = 0) -> int:
        """Go to a place and return it, which a file of SSH does not."""
        self._seek(place, whence)
        return self.tell()


def open_stream(url: str) -> Stream:
    """Open a path or an address. Raises `UnavailableError` for whatever a storage says against it."""
    try:
        import fsspec  # noqa: PLC0415 - of the extra
    except ImportError:
        raise UnavailableError(url, "", "addresses need fsspec: pip install 'tailbyte[fleet]'") from None
    try:
        files, path = fsspec.core.url_to_fs(url)
        file = cast("BinaryIO", files.open(path, "rb", block_size=_BLOCK, cache_type="readahead"))
    except Exception as error:  # noqa: BLE001 - whatever a storage raises
        reason = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        raise UnavailableError(url, "", reason) from None
    return Stream(url, file)
