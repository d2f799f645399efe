"""MDF 4: python-can reads it with asammdf, an extra."""

from __future__ import annotations

import logging
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Any

from can.io import mf4 as library

from analyzer._native import Rows
from analyzer.sources.errors import CaptureError
from analyzer.sources.python_can.messages import (
    ABSOLUTE,
    MICROSECONDS,
    RX,
    TX,
    Unreadable,
    channel,
    from_float,
    store,
    store_error,
    words,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from can import Message

    from analyzer._native import Piece
    from analyzer.sources import Source

_PIECE = 10_000
_MISSING = "reading MDF 4 needs asammdf: pip install 'tailbyte[mf4]'"


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | Piece]:
    """The pieces of an MDF 4 capture, by way of a temporary file: asammdf needs all of it.

    Raises `CaptureError` when asammdf is missing or cannot make anything of the file.
    """
    if library.asammdf is None:  # type: ignore[attr-defined]  # what python-can itself asks
        raise CaptureError(source.name, "", _MISSING)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)
    source.notes.append(
        "MDF 4 keeps no bus names (channel 0 is can0), times to the microsecond, no kinds of error frames"
    )
    with NamedTemporaryFile(suffix=".mf4") as file:
        for chunk in chunks:
            file.write(chunk)
            if not chunk:
                yield b""
        file.flush()
        try:
            reader = library.MF4Reader(file.name)
        except Exception as error:  # noqa: BLE001 - of any type: asammdf checks little
            _release(error)
            reason = words(error).replace(file.name, source.name)
            raise CaptureError(source.name, "", f"not read by asammdf ({reason})") from None
        with reader:
            yield from _pieces(source, iter(reader))


def _release(error: BaseException) -> None:
    """Closes what a failed opening left behind: asammdf itself would fail once more, and show it on the terminal."""
    trace = error.__traceback__
    while trace is not None:
        made: Any = trace.tb_frame.f_locals.get("self")
        if type(made).__name__ == "MDF4" and not made._closed:  # noqa: SLF001 - no public way
            made._closed = True  # noqa: SLF001
            made._tempfile.close()  # noqa: SLF001
            if made._delete_on_close:  # noqa: SLF001
                Path(made.name).unlink(missing_ok=True)
        elif isinstance(made, library.MF4Reader):
            made.file.close()
        trace = trace.tb_next


def _pieces(source: Source, messages: Iterator[Message]) -> Iterator[Piece]:
    rows = Rows()
    count = 0
    while True:
        try:
            message = next(messages)
        except StopIteration:
            break
        except Exception as error:  # noqa: BLE001 - of any type: asammdf checks little
            source.damaged(f"message {count + 1}", f"not read by asammdf ({words(error)})")
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
