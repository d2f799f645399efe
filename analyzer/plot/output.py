"""The targets of a recording. A file is written by us: Rerun writes into a pipe, and waits when we do.

Rerun itself takes no notice of a full disk but waits for ever. So whoever writes the file here goes on reading after a
failure, throws the rest away, and says so at the end.
"""

from __future__ import annotations

import os
import threading
from contextlib import AbstractContextManager, suppress
from typing import TYPE_CHECKING, BinaryIO, Protocol, Self

import rerun as rr

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

    from rerun.blueprint import Blueprint
    from rerun.chunk import Chunk

APPLICATION = "tailbyte"
_PIECE = 1 << 20
_PIPE = 1 << 20
_SET_PIPE_SIZE = 1031  # F_SETPIPE_SZ of Linux
# Rows that may wait to be encoded before `send` waits, too.
_MOST_WAITING = 1_000_000
_PATIENCE = 600.0  # seconds; a disk that takes longer for what waits is dead


class Output(Protocol):
    """Takes the recording."""

    def send(self, chunks: Sequence[Chunk]) -> None:
        """Send the next chunks."""

    def layout(self, blueprint: Blueprint) -> None:
        """Say how a viewer is to show it, unless its user has other plans."""


class FileOutput(AbstractContextManager["FileOutput"]):
    """A recording as a file.

    Args:
        file: takes the bytes; what its `write` raises is raised when the block ends.
        name: of the recording, for people.
        recording_id: tells recordings apart; random if not given.
        application: whose layouts a viewer keeps for it.
    """

    def __init__(
        self, file: BinaryIO, name: str, recording_id: str | None = None, *, application: str = APPLICATION
    ) -> None:
        self._file = file
        self._error: BaseException | None = None
        self._waiting = 0
        self._recording = rr.RecordingStream(application, recording_id=recording_id, send_properties=False)
        self._name = name

    def __enter__(self) -> Self:
        """Start writing."""
        source, target = os.pipe()
        with suppress(ImportError, OSError):
            import fcntl  # noqa: PLC0415 - not everywhere

            fcntl.fcntl(target, _SET_PIPE_SIZE, _PIPE)
        self._writer = threading.Thread(target=self._write, args=(source,), name="rrd", daemon=True)
        self._writer.start()
        try:
            self._recording.save(f"/dev/fd/{target}")
        finally:
            os.close(target)
        self._recording.send_recording_name(self._name)
        return self

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        """Wait until everything is written. Raises what the file raised."""
        with suppress(Exception):
            self._recording.flush(timeout_sec=_PATIENCE)
        self._recording.disconnect()
        self._writer.join(_PATIENCE)
        if kind is None and self._error is not None:
            raise self._error

    def send(self, chunks: Sequence[Chunk]) -> None:
        """Send the next chunks; wait when too many are not written yet. Raises what the file raised."""
        if self._error is not None:
            raise self._error
        if chunks:
            rr.send_chunks(chunks, recording=self._recording)
            self._waiting += sum(chunk.num_rows for chunk in chunks)
            if self._waiting > _MOST_WAITING:
                self._recording.flush(timeout_sec=_PATIENCE)
                self._waiting = 0

    def layout(self, blueprint: Blueprint) -> None:
        """Say how a viewer is to show it."""
        self._recording.send_blueprint(blueprint, make_active=False, make_default=True)

    def _write(self, source: int) -> None:
        room = memoryview(bytearray(_PIECE))
        try:
            while size := os.readv(source, [room]):
                if self._error is None:
                    try:
                        self._file.write(room[:size])
                    except BaseException as error:  # noqa: BLE001 - it is raised where it can be dealt with
                        self._error = error
        finally:
            os.close(source)
