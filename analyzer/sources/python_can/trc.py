"""PEAK TRC: text, one message a line, in the columns of its version."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

from can.io.trc import TRCReader
from can.util import dlc2len, len2dlc

from analyzer._native import Rows
from analyzer.sources.can_rows import (
    DATE,
    FROM_START,
    MICROSECONDS,
    NANOSECONDS,
    RX,
    TX,
    Unreadable,
    store,
    store_error,
)
from analyzer.sources.errors import CaptureError
from analyzer.sources.python_can import lines
from analyzer.sources.python_can.lines import Sort
from analyzer.sources.python_can.messages import bus_name, channel, nanoseconds, quoted
from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from can import Message

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

# The columns of the versions that do not state theirs, in the letters of those that do.
_COLUMNS = {"1.0": "N,O,I,L,D", "1.1": "N,O,T,I,L,D", "1.2": "N,O,B,T,I,L,D", "1.3": "N,O,B,T,I,R,L,D"}
_STATED = ("2.0", "2.1")
_FRAMES = {"Rx", "Tx", "DT", "FD", "FB", "FE", "BI", "RR"}
_ERRORS = {"Error", "ER"}
_OTHER = {"Warng", "ST", "EC", "EV"}
_BUS_STATE = "FFFFFFFF"
_EPOCH_DAY = 25569
_DAY_US = 86_400 * 10**6


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of a TRC capture. Raises `CaptureError` for a version that python-can does not read."""
    source.notes.append("TRC keeps no bus names (bus 1 is can0) and no kinds of error frames")
    grammar = _Trc(source)
    yield from lines.read(grammar, chunks, grammar.is_whole)


class _Trc:
    """`Grammar` of TRC."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._version = "1.0"
        self._start: int | None = None
        self._columns = _COLUMNS["1.0"].split(",")
        self.header: tuple[str, ...] = ()

    def reader(self, file: lines.NumberedText) -> Iterable[Message]:
        text = _with_reserved_cells(file) if self._version == "1.2" else file
        return TRCReader(text)  # type: ignore[arg-type]  # iterating is all it does

    def sort(self, line: str) -> tuple[Sort, int]:
        if not line:
            return Sort.BLANK, 0
        if line.startswith(";"):
            self._read_header(line)
            return Sort.COMMENT, 0
        cells = self._cells(line)
        kind = cells.get("T", "Error" if cells.get("D", "").startswith("ERROR") else "Rx")
        if kind in _OTHER or (self._version == "1.0" and cells["I"] == _BUS_STATE):
            return Sort.OTHER, 0
        if kind not in _FRAMES | _ERRORS:
            raise Unreadable("unknown type of message")
        t = nanoseconds(cells["O"], MILLISECOND, self._start or 0)
        return Sort.ERROR_FRAME if kind in _ERRORS else Sort.MESSAGE, t

    def store(self, rows: Rows, line: str, message: Message, t: int) -> None:
        cells = self._cells(line)
        digits = len(cells["O"].partition(".")[2])
        rows.stamp((FROM_START if self._start is None else DATE) | (NANOSECONDS if digits > 3 else MICROSECONDS))
        if message.is_error_frame:
            number = cells.get("B", "1")
            flags = {"Rx": RX, "Tx": TX}.get(cells.get("d", ""), 0)
            store_error(rows, t, bus_name(int(number) if number.isdigit() else 1), flags=flags)
            return
        data = cells.get("D", "").split()
        code = message.dlc
        if message.is_fd and code == len(data) <= 64 and dlc2len(len2dlc(code)) == code:
            code = len2dlc(code)  # some write the length where the code belongs
        size = dlc2len(code) if message.is_fd else min(8, code)
        if not message.is_remote_frame and any(len(byte) != 2 for byte in data[:size]):
            raise Unreadable("a data byte is not two digits")
        bus = bus_name(channel(message, 1))
        store(rows, message, t, bus, code=code, size=size, directed=self._version != "1.0")

    def is_whole(self, line: str) -> bool:
        """Return whether a line without an end has all the bytes that it states; a remote request needs its length."""
        rows = Rows()
        try:
            sort, t = self.sort(line)
            if sort is not Sort.MESSAGE:
                return False
            (message,) = self.reader(lines.NumberedText(self.header, [line], 0))
            self.store(rows, line, message, t)
        except Exception:  # noqa: BLE001 - of any type: python-can checks little
            return False
        self._source.take_last_line()
        return True

    def _cells(self, line: str) -> dict[str, str]:
        """Return the cells by the letters of their columns; the data of all versions but 1.0 to 1.3 is one cell."""
        if not self._columns:
            raise Unreadable("the columns are not stated")
        cells = dict(zip(self._columns, line.split(maxsplit=len(self._columns) - 1), strict=False))
        if not cells.keys() >= {"O", "I", "T"} & {*self._columns}:
            raise Unreadable("cells are missing")
        return cells

    def _read_header(self, line: str) -> None:
        name, _, value = line.partition("=")
        if name == ";$FILEVERSION":
            self._set_version(value.strip())
        elif name == ";$COLUMNS" and self._version in _STATED:
            letters = value.strip().split(",")
            if len({*letters}) == len(letters) and {"O", "I", "T", "d"} <= {*letters} and letters[-1] == "D":
                self._columns = letters
        elif name == ";$STARTTIME":
            self._start = _start(value.strip())
        else:
            return
        stated = (f";$COLUMNS={','.join(self._columns)}",) if self._version in _STATED else ()
        known = "1.3" if self._version == "1.2" else self._version  # python-can does not know 1.2
        self.header = (f";$FILEVERSION={known}", *stated)

    def _set_version(self, version: str) -> None:
        if version not in _COLUMNS and version not in _STATED:
            known = ", ".join((*_COLUMNS, *_STATED))
            raise CaptureError(self._source.name, "", f"TRC of version {quoted(version, 20)}, only {known} can be read")
        self._version = version
        self._columns = _COLUMNS.get(version, "").split(",") if version in _COLUMNS else []


def _with_reserved_cells(file: Iterable[str]) -> Iterator[str]:
    """Yield lines of version 1.2 as those of 1.3, which have one column more."""
    for line in file:
        cells = line.split(maxsplit=5)
        yield line if line.startswith(";") else " ".join([*cells[:5], "-", *cells[5:]])


def _start(days: str) -> int | None:
    """Days since 1899-12-30 as nanoseconds since 1970, to the microsecond, as the field has no more digits."""
    try:
        value = Decimal(days) - _EPOCH_DAY
    except InvalidOperation:
        return None
    if not value.is_finite() or value.adjusted() > 6:
        return None
    return int((value * _DAY_US).to_integral_value()) * 1000
