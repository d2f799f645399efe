"""Readers and writers for python-can: its tools, `LogReader` and `Logger` know .mcap, .pcapng and .pcap by them.

python-can imports this module on each look-up of a format, so that it imports little itself.
"""

from __future__ import annotations

import logging
import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Lock, Timer
from typing import TYPE_CHECKING, Any, BinaryIO, ClassVar

from can import Message
from can.io.generic import BinaryIOMessageReader, BinaryIOMessageWriter

from analyzer._native import Rows
from analyzer.sources.can_rows import BRS, DLC_SHIFT, ESI, EXTENDED, FD, REMOTE, TX, Unreadable, add, from_float

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator
    from io import BufferedIOBase

    from can.typechecking import StringPathLike

    from analyzer._native import FrameBatch

# Messages that wait at most, and for how many seconds at most: what a killed process loses.
_MOST = 4096
_PATIENCE = 1.0
_ERROR_FRAME = 0  # in the column `kind` of events
_log = logging.getLogger("tailbyte")


class CaptureReader(BinaryIOMessageReader):
    """Any capture that tailbyte reads, as messages.

    `channel` is the name of the bus, `arbitration_id` of an error frame its class bits, and the time of a frame that
    has none is 0. What cannot be read is told by the log "tailbyte" behind all the rest; a file of which nothing can be
    read raises `analyzer.CaptureError`.
    """

    def __init__(self, file: StringPathLike | BinaryIO | BufferedIOBase, **_: Any) -> None:
        super().__init__(file)
        self._named = _Named(self.file, _name(file))

    def __iter__(self) -> Generator[Message, None, None]:
        """Yield the messages in the order of the capture; close the file behind the last one."""
        from analyzer.app.request import Request  # noqa: PLC0415 - only when something is read
        from analyzer.app.run import Run  # noqa: PLC0415
        from analyzer.sources.origin import given  # noqa: PLC0415

        run = Run(Request((given(self._named),)), partial(_log.warning, "%s"))
        for batch in run.frame_batches():
            yield from _messages(batch)
        self.stop()


def _name(file: object) -> str:
    return os.fspath(file) if isinstance(file, str | os.PathLike) else str(getattr(file, "name", "capture"))


@dataclass(frozen=True, slots=True)
class _Named:
    """A file object, with the name that python-can knows it by."""

    file: BinaryIO | BufferedIOBase
    name: str

    def __getattr__(self, what: str) -> Any:
        return getattr(self.file, what)


def _messages(piece: FrameBatch) -> Iterator[Message]:
    """Frames and error frames by their record numbers."""
    frames, events = (_Columns(columns, piece.buses) for columns in piece.columns())
    errors = (row for row, kind in enumerate(events.cells["kind"]) if kind == _ERROR_FRAME)
    error = next(errors, None)
    for row, line in enumerate(frames.line):
        while error is not None and events.line[error] < line:
            yield _error_frame(events, error)
            error = next(errors, None)
        yield _frame(frames, row)
    while error is not None:
        yield _error_frame(events, error)
        error = next(errors, None)


class _Columns:
    """The columns of a table, by row."""

    def __init__(self, cells: dict[str, Any], buses: list[str]) -> None:
        self.cells, self._buses = cells, buses
        self.line = memoryview(cells["line"]).cast("I")
        self._t = memoryview(cells["t"]).cast("q")
        self._offset = memoryview(cells["data_offset"]).cast("i")
        self.id = memoryview(cells["id" if "id" in cells else "class"]).cast("I")
        self.flags = memoryview(cells["flags"]).cast("H")

    def common(self, row: int) -> dict[str, Any]:
        """Return what frames and error frames both have."""
        valid = self.cells["t_valid"]
        return {
            "timestamp": self._t[row] / 10**9 if valid is None or valid[row >> 3] >> (row & 7) & 1 else 0.0,
            "channel": self._buses[self.cells["bus"][row]],
            "data": bytearray(self.cells["data"][self._offset[row] : self._offset[row + 1]]),
        }


def _frame(frames: _Columns, row: int) -> Message:
    flags = frames.flags[row]
    message = Message(
        arbitration_id=frames.id[row],
        is_extended_id=bool(flags & EXTENDED),
        is_remote_frame=bool(flags & REMOTE),
        is_fd=bool(flags & FD),
        is_rx=not flags & TX,
        bitrate_switch=bool(flags & BRS),
        error_state_indicator=bool(flags & ESI),
        **frames.common(row),
    )
    if message.is_remote_frame:
        message.dlc = flags >> DLC_SHIFT
    return message


def _error_frame(events: _Columns, row: int) -> Message:
    return Message(
        arbitration_id=events.id[row],
        is_extended_id=False,
        is_error_frame=True,
        is_rx=not events.flags[row] & TX,
        **events.common(row),
    )


class _Writer(BinaryIOMessageWriter):
    """Writes what it is given within a second, so that a recording that is killed has nearly everything.

    What the format cannot hold is told by the log "tailbyte" at the end.
    """

    form: ClassVar[str]

    def __init__(self, file: StringPathLike | BinaryIO | BufferedIOBase, append: bool = False, **_: Any) -> None:
        self._check(file, append=append)
        super().__init__(file, mode="ab" if append else "wb")
        from analyzer.sinks import open_sink  # noqa: PLC0415 - only when something is written

        self._sink = open_sink(self.form, self.file)  # type: ignore[arg-type]  # writing is all it does
        self._name = _name(file)
        self._rows = Rows()
        self._lock = Lock()
        self._timer: Timer | None = None
        self._failed: OSError | None = None

    def _check(self, file: object, *, append: bool) -> None:
        """Raise `ValueError` if the format cannot be appended to."""

    def on_message_received(self, msg: Message) -> None:
        """Take a message. Raises `ValueError` for one that no bus can carry, `OSError` if writing failed."""
        with self._lock:
            if self._failed is not None:
                raise self._failed
            _add(self._rows, msg)
            if self._rows.waiting >= _MOST:
                self._sink.write(self._rows.take())
            if self._timer is None:
                self._timer = Timer(_PATIENCE, self._flush)
                self._timer.daemon = True
                self._timer.start()

    def _flush(self) -> None:
        with self._lock:
            self._timer = None
            if self.file.closed:
                return
            try:
                self._sink.write(self._rows.take())
                self._sink.flush()
            except OSError as error:
                self._failed = error

    def stop(self) -> None:
        """Write the rest and the end of the capture, and close the file."""
        from analyzer.sinks import losses  # noqa: PLC0415 - only when something is written

        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            if self.file.closed:
                return
            try:
                self._sink.write(self._rows.take())
                self._sink.close()
            finally:
                super().stop()
            if lost := losses(self._sink.lost):
                _log.warning("%s: the format cannot hold: %s", self._name, lost)


class McapWriter(_Writer):
    """MCAP as ROS 2 records it. It cannot be appended to."""

    form = "mcap"

    def _check(self, file: object, *, append: bool) -> None:
        if append and not (isinstance(file, str | os.PathLike) and _is_new(Path(file))):
            raise ValueError("MCAP cannot be appended to: its end is a summary of all of it")


class PcapngWriter(_Writer):
    """pcapng; appending adds a section."""

    form = "pcapng"


def _is_new(path: Path) -> bool:
    return not path.exists() or path.stat().st_size == 0


def _add(rows: Rows, message: Message) -> None:
    """Add the row of a message; numbers of channels count from 0, as python-can has them."""
    named = isinstance(message.channel, str)
    bus = str(message.channel) if named else f"can{message.channel if isinstance(message.channel, int) else 0}"
    try:
        add(rows, message, from_float(message.timestamp), bus)
    except Unreadable as error:
        raise ValueError(f"{message}: {error}") from None
