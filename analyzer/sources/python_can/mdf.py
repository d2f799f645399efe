"""MDF 4: python-can reads it with asammdf, an extra, in a process of its own (`mdf_child`)."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from contextlib import contextmanager
from importlib.machinery import PathFinder
from tempfile import NamedTemporaryFile, TemporaryDirectory, gettempdir
from typing import TYPE_CHECKING

from can import Message

from analyzer._native import Rows
from analyzer.sources.can_rows import ABSOLUTE, MICROSECONDS, RX, TX, Unreadable, from_float, store, store_error
from analyzer.sources.errors import CaptureError, UnavailableError
from analyzer.sources.python_can.mdf_child import (
    BROKEN_OFF,
    FLAGS,
    NO_CHANNEL,
    NO_LIBRARY,
    NO_MEMORY,
    NOT_OPENED,
    ODD_CHANNEL,
    RECORD,
    WHOLE,
    bounds,
)
from analyzer.sources.python_can.messages import channel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

_PIECE = 10_000
# Bytes of a capture, which take as much room on disk once more.
_LARGEST = 4 << 30
_CHILD = ("-P", "-m", "analyzer.sources.python_can.mdf_child")
_PATIENCE = 0.2  # s, until it is looked whether to stop
_MISSING = "reading MDF 4 needs asammdf: pip install 'tailbyte[mf4]'"
# What asammdf itself says is no help: it trips over damage wherever that leads it.
_NOT_READ = "damaged, or not of the kinds of MDF 4 that asammdf reads"


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of an MDF 4 capture, by way of a temporary file: asammdf needs all of it.

    Raises `CaptureError` when asammdf is missing or cannot make anything of the file, when there is no room for the
    temporary file, or when that would be larger than 4 GiB.
    """
    if PathFinder.find_spec("asammdf") is None:
        raise CaptureError(source.name, "", _MISSING)
    source.notes.append(
        "MDF 4 keeps no bus names (channel 0 is can0), times to the microsecond, no kinds of error frames"
    )
    with _room(source, gettempdir()):
        file = NamedTemporaryFile(suffix=".mf4", buffering=0)  # noqa: SIM115 - closed below
    with file:
        size = 0
        for chunk in chunks:
            size += len(chunk)
            if size > _LARGEST:
                raise CaptureError(source.name, "", f"MDF 4 of more than {_LARGEST >> 30} GiB is not read")
            if not chunk:
                yield b""
            with _room(source, file.name):
                rest = memoryview(chunk)
                while rest:
                    rest = rest[file.write(rest) :]
        if source.stopped and not source.live:
            return
        yield from _frames(source, file.name, size)


def _frames(source: Source, path: str, size: int) -> Iterator[bytes | FrameBatch]:
    """Yield what another process reads, and say how that ended."""
    rows, count = Rows(), 0
    with _room(source, gettempdir()):
        folder = TemporaryDirectory()
    with folder, _child(path, folder.name) as child:
        for piece in _pieces(source, child):
            if piece:
                count += _add_all(rows, piece)
                yield rows.take()
            else:
                yield b""
        status = child.wait()
    if status == WHOLE or (source.stopped and not source.live):
        return
    reason = _reason(status, size)
    if not count:
        raise source.damage or CaptureError(source.name, "", reason)
    source.damaged(f"message {count + 1}", reason)


@contextmanager
def _child(path: str, folder: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start the process that reads a file, whose own temporary files go into a folder; end it in any case."""
    child = subprocess.Popen(  # noqa: S603 - this interpreter, and a file of ours
        [sys.executable, *_CHILD, path],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": folder},
    )
    with child:
        try:
            yield child
        finally:
            child.kill()


def _pieces(source: Source, child: subprocess.Popen[bytes]) -> Iterator[bytes]:
    """Yield whole records, and empty pieces while there are none, until there will be no more or the source stops."""
    assert child.stdout is not None  # noqa: S101 - it is a pipe
    output, rest = child.stdout.fileno(), b""
    while not source.stopped or source.live:
        if not select.select([output], [], [], _PATIENCE)[0]:
            yield b""
            continue
        data = os.read(output, _PIECE * RECORD.size)
        if not data:
            return
        rest += data
        whole = len(rest) - len(rest) % RECORD.size
        if whole:
            yield rest[:whole]
        rest = rest[whole:]


def _reason(status: int, size: int) -> str:
    """Return in words how the process ended."""
    memory, seconds = bounds(size)
    if status in (NOT_OPENED, BROKEN_OFF):
        return _NOT_READ
    if status == NO_LIBRARY:
        return _MISSING
    if status == NO_MEMORY:
        return f"asammdf needs more than {memory >> 20} MiB of memory for it"
    if status == -signal.SIGXCPU:
        return f"asammdf needs more than {seconds} s for it"
    if status < 0:
        return f"damaged: asammdf was ended by {signal.Signals(-status).name}"
    return f"asammdf could not be started, or failed (exit status {status})"


def _add_all(rows: Rows, records: bytes) -> int:
    """Add a row for each record; return how many there are."""
    count = 0
    for count, record in enumerate(RECORD.iter_unpack(records), 1):  # noqa: B007 - the last one counts
        try:
            _add(rows, _message(*record))
        except Unreadable as error:
            rows.unreadable(str(error))
    return count


def _message(t: float, identifier: int, number: int, flags: int, code: int, size: int, data: bytes) -> Message:
    """Return what python-can made of a record."""
    where = None if number == NO_CHANNEL else "?" if number == ODD_CHANNEL else number
    kinds = {name: bool(flags >> bit & 1) for bit, name in enumerate(FLAGS)}
    return Message(timestamp=t, arbitration_id=identifier, channel=where, dlc=code, data=data[:size], **kinds)


@contextmanager
def _room(source: Source, name: str) -> Iterator[None]:
    """Around what may fail for want of room on disk, or of a right to it: the capture is not to blame."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise UnavailableError(source.name, "", f"temporary file {name}: {reason}") from None


def _add(rows: Rows, message: Message) -> None:
    t = from_float(message.timestamp)
    rows.stamp(ABSOLUTE | MICROSECONDS)
    bus = f"can{channel(message, 0)}"
    if message.is_error_frame:
        store_error(rows, t, bus, flags=RX if message.is_rx else TX)
        return
    size = len(message.data)
    code = message.dlc if message.is_remote_frame else min(size, 8)
    store(rows, message, t, bus, code=code, size=size, directed=True)
