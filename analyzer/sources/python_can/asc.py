"""Vector ASC: text, one event a line, times counted from the start of the recording."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from can.io.asc import ASCReader
from can.util import len2dlc

from analyzer.sources.can_rows import (
    DELTA,
    FROM_START,
    MICROSECONDS,
    NANOSECONDS,
    RX,
    TX,
    Unreadable,
    in_range,
    store,
    store_error,
)
from analyzer.sources.python_can import lines
from analyzer.sources.python_can.lines import Sort
from analyzer.sources.python_can.messages import bus_name, channel, nanoseconds, quoted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from can import Message

    from analyzer._native import FrameBatch, Rows
    from analyzer.sources import Source

_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_STRUCTURE = re.compile(r"(date\s|(begin|end)\s+triggerblock|(no\s+)?internal\s+events\s+logged)", re.IGNORECASE)
_BEGIN = re.compile(r"begin\s+triggerblock\s+(\S.*)", re.IGNORECASE)
_EVENT = re.compile(r"(\d+\.\d+)\s+(.*)", re.ASCII)
_MESSAGE = re.compile(
    r"\d+\s+(errorframe\b|[0-9a-f]+x?\s+(?P<classic>rx|tx|txrq)\s+[dr]\b)|canfd\s+\d+\s+(?P<fd>rx|tx|txrq)\s",
    re.IGNORECASE,
)
# Events that are no frames. Anything else is a damaged frame rather than one more kind of event.
_OTHER = re.compile(
    r"start of measurement|\d+\s+(statistic|overloadframe|j1939tp)|can\s+\d+\s+status|sv:|l\d+\s|li\s|lin|eth\s|fr|"
    r"log\s|logging|tfs|trigger|comment|gps|\S+\s*:=",
    re.IGNORECASE,
)
# How python-can is told that the header is over.
_HEADER_END = "internal events logged"


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of an ASC capture."""
    source.notes.append("ASC keeps no bus names (channel 1 is can0) and no kinds of error frames")
    grammar = _Asc(source.notes)
    yield from lines.read(grammar, chunks)
    if grammar.requests:
        source.notes.append(f"requests of frames left out (TxRq): {grammar.requests}")


class _Asc:
    """`Grammar` of ASC."""

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self.header: tuple[str, ...] = ("base hex", _HEADER_END)
        self._relative = self._dated = False
        self._now = self.requests = 0

    def reader(self, file: lines.NumberedText) -> Iterable[Message]:
        return ASCReader(file)  # type: ignore[arg-type]  # iterating is all it does

    def sort(self, line: str) -> tuple[Sort, int]:
        if not line:
            return Sort.BLANK, 0
        event = _EVENT.match(line)
        if event is None:
            return self._sort_header(line), 0
        self._now = in_range(nanoseconds(event[1], start=self._now if self._relative else 0))
        message = _MESSAGE.match(event[2])
        if message is None:
            if _OTHER.match(event[2]):
                return Sort.OTHER, 0
            raise Unreadable("not a frame of a known form")
        if "txrq" in (str(message["classic"]).lower(), str(message["fd"]).lower()):
            self.requests += 1  # asked for, not on the bus
            return Sort.OTHER, 0
        return Sort.MESSAGE, self._now

    def _sort_header(self, line: str) -> Sort:
        if line.startswith("//"):
            return Sort.COMMENT
        if base := _BASE.match(line):
            self.header = (f"base {base[1].lower()}", _HEADER_END)
            self._relative = str(base[2]).lower() == "relative"
        elif not _STRUCTURE.match(line):
            raise Unreadable("no time in front")
        elif (begin := _BEGIN.match(line)) and not self._dated:
            self._dated = True
            self._notes.append(f"times count from the start of the recording ({quoted(begin[1], 40)}, zone unknown)")
        return Sort.COMMENT

    def store(self, rows: Rows, line: str, message: Message, t: int) -> None:
        digits = len(line.partition(".")[2].partition(" ")[0])
        rows.stamp((DELTA if self._relative else FROM_START) | (NANOSECONDS if digits > 6 else MICROSECONDS))
        bus = bus_name(channel(message, 0) + 1)
        cells = line.split()
        if message.is_error_frame:
            directed = cells[1].upper() == "CANFD"
            store_error(rows, t, bus, flags=(RX if message.is_rx else TX) if directed else 0)
            return
        message.is_fd, message.is_remote_frame = _kind(message)
        size = message.dlc if message.is_fd else min(8, message.dlc)
        digits_tell = "dec" not in self.header[0] and not message.is_remote_frame
        if digits_tell and any(len(byte) != 2 for byte in _data(cells)[:size]):
            raise Unreadable("a data byte is not two digits")
        store(rows, message, t, bus, code=len2dlc(message.dlc), size=size, directed=True)


def _kind(message: Message) -> tuple[bool, bool]:
    """Return whether it is CAN FD, and a remote frame; to python-can an empty CAN FD frame is a remote one, too.

    A length of 0 behind another length code is that of a remote frame.
    """
    return message.is_fd, message.is_remote_frame and not (message.is_fd and message.dlc == 0)


def _data(cells: list[str]) -> list[str]:
    """Return the cells from the first data byte on."""
    if cells[1].upper() != "CANFD":
        return cells[6:]
    return cells[9 if cells[5].isdigit() else 10 :]
