"""MDF 4: python-can reads it with asammdf, an extra."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from io import IOBase
from pathlib import Path
from tempfile import NamedTemporaryFile, gettempdir
from typing import TYPE_CHECKING, Any

from can.io import mf4 as library

from analyzer._native import Rows
from analyzer.sources.can_rows import ABSOLUTE, MICROSECONDS, RX, TX, Unreadable, from_float, store, store_error
from analyzer.sources.errors import CaptureError, UnavailableError
from analyzer.sources.python_can.messages import channel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from can import Message

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

_PIECE = 10_000
# Bytes of a capture, which take as much room on disk once more.
_LARGEST = 4 << 30
_MISSING = "reading MDF 4 needs asammdf: pip install 'tailbyte[mf4]'"
# What asammdf itself says is no help: it trips over damage wherever that leads it.
_NOT_READ = "damaged, or not of the kinds of MDF 4 that asammdf reads"


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of an MDF 4 capture, by way of a temporary file: asammdf needs all of it.

    Raises `CaptureError` when asammdf is missing or cannot make anything of the file, when there is no room for the
    temporary file, or when that would be larger than 4 GiB.
    """
    if library.asammdf is None:  # type: ignore[attr-defined]  # what python-can itself asks
        raise CaptureError(source.name, "", _MISSING)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)
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
        try:
            reader = library.MF4Reader(file.name)
        except Exception as error:  # noqa: BLE001 - of any type: asammdf checks little
            _release(error)
            raise source.damage or CaptureError(source.name, "", _NOT_READ) from None
        with reader:
            yield from _batches(source, iter(reader))


@contextmanager
def _room(source: Source, name: str) -> Iterator[None]:
    """Around what may fail for want of room on disk, or of a right to it: the capture is not to blame."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise UnavailableError(source.name, "", f"temporary file {name}: {reason}") from None


def _release(error: BaseException) -> None:
    """Close what a failed opening left behind: asammdf itself would fail once more, and show it on the terminal."""
    trace = error.__traceback__
    while trace is not None:
        here = trace.tb_frame
        made: Any = here.f_locals.get("self")
        if here.f_globals.get("__name__", "").startswith("asammdf"):
            for held in (*here.f_locals.values(), *getattr(made, "__dict__", {}).values()):
                if isinstance(held, IOBase):
                    held.close()
        if type(made).__name__ == "MDF4" and not made._closed:  # noqa: SLF001 - no public way
            made._closed = True  # noqa: SLF001
            made._tempfile.close()  # noqa: SLF001
            if made._delete_on_close:  # noqa: SLF001
                Path(made.name).unlink(missing_ok=True)
        elif isinstance(made, library.MF4Reader):
            made.file.close()
        trace = trace.tb_next


def _batches(source: Source, messages: Iterator[Message]) -> Iterator[FrameBatch]:
    rows = Rows()
    count = 0
    while True:
        try:
            message = next(messages)
        except StopIteration:
            break
        except Exception:  # noqa: BLE001 - of any type: asammdf checks little
            source.damaged(f"message {count + 1}", _NOT_READ)
            break
        count += 1
        try:
            _add(rows, message)
        except Unreadable as error:
            rows.unreadable(str(error))
        if count % _PIECE == 0:
            yield rows.take()
    yield rows.take()


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
