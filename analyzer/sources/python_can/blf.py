"""Vector BLF: containers, mostly compressed, and in them objects; python-can says what the objects mean."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from itertools import chain
from typing import TYPE_CHECKING

from can.io import blf as library
from can.util import len2dlc

from analyzer._native import Rows
from analyzer.sources.can_rows import (
    ABSOLUTE,
    BUS_ERROR,
    DATE,
    FROM_START,
    MICROSECONDS,
    NANOSECONDS,
    Unreadable,
    in_range,
    rounded,
    store,
    store_error,
)
from analyzer.sources.errors import CaptureError
from analyzer.sources.python_can.lines import Sort
from analyzer.sources.python_can.messages import bus_name, channel, words
from analyzer.sources.python_can.objects import SIGNATURE, Object, Objects, StrayBytes
from analyzer.sources.python_can.requests import Requests, Way

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from can import Message

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

_EARLY = "BLF data ends early"
_LARGEST_HEADER = 4096
# Most bytes that one step unpacks: the memory of a container that is a bomb.
_STEP = 1 << 20
# Objects have a byte for it, a bus four bits.
_LARGEST_CODE = 15
_SALVAGE = 64
# Objects that python-can is given at once.
_RUN = 256
# The head that all objects have, and that of a container behind it.
_BODY = library.OBJ_HEADER_BASE_STRUCT.size
_CONTAINER_HEADER = library.LOG_CONTAINER_STRUCT.size
# Flags and time by the version of the header; how long that header is.
_TIMES = {1: (struct.Struct("<LHHQ"), 32), 2: (struct.Struct("<LBxHQ8x"), 40)}
_TEN_MICROSECONDS = 1
# What python-can makes messages of, and the bytes it needs behind the header.
_CLASSIC = (library.CAN_MESSAGE, library.CAN_MESSAGE2)
_NEEDS = {
    **dict.fromkeys(_CLASSIC, library.CAN_MSG_STRUCT.size),
    library.CAN_ERROR_EXT: library.CAN_ERROR_EXT_STRUCT.size,
    library.CAN_FD_MESSAGE: library.CAN_FD_MSG_STRUCT.size,
    library.CAN_FD_MESSAGE_64: library.CAN_FD_MSG_64_STRUCT.size,
}
# Those that are never longer.
_SIZES = {kind: _NEEDS[kind] for kind in (library.CAN_MESSAGE, library.CAN_ERROR_EXT, library.CAN_FD_MESSAGE)}
# Error frames without more than a channel, which python-can leaves out.
_ERRORS = {2: struct.Struct("<H"), 104: struct.Struct("<B")}
# Where an object says the direction. A frame that was only asked for is a received one to python-can.
_DIRECTION = {**dict.fromkeys((*_CLASSIC, library.CAN_FD_MESSAGE), 2), library.CAN_FD_MESSAGE_64: 34}
_WAYS = {1: Way.SENT, 2: Way.REQUEST}
# Application and format as python-can's writer states them. The class of an error frame is in its identifier there.
_WRITER = (5, 0, 0, 0, 2, 6, 8, 1)


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return a batch of rows for each chunk. Raises `CaptureError` when the header of the file is not whole."""
    head = b""
    for chunk in chunks:
        head += chunk
        if len(head) >= _header_size(head):
            break
        if not chunk:
            yield b""
    size = _header_size(head)
    if len(head) < library.FILE_HEADER_STRUCT.size:
        raise CaptureError(source.name, f"byte {len(head)}", _EARLY)
    yield from _Blf(source, head[:size]).read(head[size:], chunks)


def _header_size(head: bytes) -> int:
    least = library.FILE_HEADER_STRUCT.size
    size = int.from_bytes(head[4:8], "little") if len(head) >= least else least
    return size if least <= size <= _LARGEST_HEADER else library.FILE_HEADER_SIZE


class _Blf:
    """One file. Containers cut objects anywhere, so what they unpack to is one stream."""

    def __init__(self, source: Source, head: bytes) -> None:
        self._source = source
        self._rows = Rows()
        self._objects = Objects(_SIZES)
        self._packed = Objects(_SIZES)
        self._requests: Requests[tuple[Object | StrayBytes, Sort | str]] = Requests()
        self._head = self._size = len(head)
        header = library.FILE_HEADER_STRUCT.unpack_from(head)
        self._by_python_can = header[2:10] == _WRITER
        self._stated = header[10]
        self._start = round(library.systemtime_to_timestamp(header[14:22]) * 1000) * 10**6
        self._stamp = FROM_START if not self._start else ABSOLUTE if self._by_python_can else DATE
        kinds = "" if self._by_python_can else " and no kinds of error frames"
        source.notes.append(f"BLF keeps no bus names (channel 1 is can0){kinds}")
        if self._by_python_can and self._start:
            source.notes.append("times rounded to the microsecond that python-can's floats hold")

    def read(self, rest: bytes, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
        """Return a batch of rows for each container, and for each step of one."""
        for chunk in chain([rest], chunks):
            self._size += len(chunk)
            for found in self._packed.feed(chunk):
                yield from self._unpack(found)
            yield self._rows.take()
            if not chunk:
                yield b""
        for found in self._packed.finish():
            yield from self._unpack(found)
        if (unfinished := self._packed.unfinished) is not None:
            at, part = unfinished
            if part[12:_BODY] == library.LOG_CONTAINER.to_bytes(4, "little"):
                yield from self._unpack(Object(at, library.LOG_CONTAINER, 1, part), cut=True)
        self._add(self._objects.finish(), last=True)
        self._source.notes += self._requests.notes()
        yield self._rows.take()
        if unfinished is not None or self._objects.unfinished is not None or self._size < self._stated:
            unpacked = " of the unpacked data" if self._source.packing else ""
            self._source.damaged(f"byte {self._size}{unpacked}", _EARLY)

    def _unpack(self, found: Object | StrayBytes, *, cut: bool = False) -> Iterator[FrameBatch]:
        """Add what a container holds, as far as it goes if the file ends in it; or the object itself."""
        if isinstance(found, StrayBytes) or found.kind != library.LOG_CONTAINER:
            self._add([found])
            return
        try:
            for data in _unpacked(found.data, cut=cut):
                self._add(self._objects.feed(data))
                yield self._rows.take()
        except Unreadable as error:
            self._rows.unreadable(f"container at byte {self._head + found.at}: {error}")

    def _add(self, found: Iterable[Object | StrayBytes], *, last: bool = False) -> None:
        known = ((item, _sort(item)) for item in found)
        ways = ((one, _way(*one), 0 if isinstance(one[0], StrayBytes) else len(one[0].data)) for one in known)
        sifted = chain(self._requests.sift(ways), self._requests.finish() if last else ())
        run = [(item, Sort.OTHER if left else sort) for (item, sort), left in sifted]
        messages = _messages([item.data for item, sort in run if sort is Sort.MESSAGE and isinstance(item, Object)])
        for item, sort in run:
            if sort is Sort.OTHER:
                self._rows.other(1)
                continue
            try:
                if isinstance(sort, str) or isinstance(item, StrayBytes):
                    raise Unreadable(str(sort))  # noqa: TRY301 - the reason is told in one place
                if sort is Sort.MESSAGE:
                    self._store(item, next(messages))
                else:
                    (number,) = _ERRORS[item.kind].unpack_from(item.data, _TIMES[item.version][1])
                    store_error(self._rows, self._time(item), bus_name(number))
            except Unreadable as error:
                self._rows.unreadable(str(error))

    def _store(self, item: Object, message: Message | str) -> None:
        if isinstance(message, str):
            raise Unreadable(message)
        t, bus = self._time(item), bus_name(channel(message, -1) + 1)
        if message.is_error_frame:
            known = self._by_python_can and message.arbitration_id
            store_error(self._rows, t, bus, known or BUS_ERROR, bytes(message.data) if known else b"")
            return
        classic = item.kind in _CLASSIC
        code = min(message.dlc, _LARGEST_CODE) if classic else len2dlc(message.dlc)
        size = min(8, code) if classic else len(message.data)
        directed = _way(item, Sort.MESSAGE) is not Way.REQUEST
        store(self._rows, message, t, bus, code=code, size=size, directed=directed, wide=True)

    def _time(self, item: Object) -> int:
        flags, *_, count = _TIMES[item.version][0].unpack_from(item.data, _BODY)
        t = self._start + count * (10_000 if flags == _TEN_MICROSECONDS else 1)
        if self._by_python_can and self._start:
            t = rounded(t, 1000)
        self._rows.stamp(self._stamp | (NANOSECONDS if t % 1000 else MICROSECONDS))
        return in_range(t)


def _unpacked(container: bytes, *, cut: bool) -> Iterator[bytes]:
    """Return what is in a container, in steps of at most 1 MiB. Raises `Unreadable` behind all that is sound."""
    method = int.from_bytes(container[_BODY : _BODY + 2], "little")
    packed = container[_BODY + _CONTAINER_HEADER :]
    if method == library.NO_COMPRESSION:
        yield packed
        return
    if method != library.ZLIB_DEFLATE:
        raise Unreadable(f"unknown compression {method}")
    unpack = zlib.decompressobj()
    try:
        while packed and not unpack.eof:
            saved = unpack.copy()
            out = unpack.decompress(packed, _STEP)
            packed = unpack.unconsumed_tail
            yield out
        if not unpack.eof:
            # A step that was full may have left more inside.
            while out := unpack.decompress(b"", _STEP):
                yield out
    except zlib.error as error:
        yield from _salvage(saved, packed)
        raise Unreadable(words(error).rpartition(": ")[2]) from None
    if not (unpack.eof or cut):
        raise Unreadable("compressed data ends early")


def _salvage(unpack: zlib._Decompress, packed: bytes) -> Iterator[bytes]:
    """Return what a step that failed would have given up to the bad byte, or nearly."""
    for at in range(0, len(packed), _SALVAGE):
        try:
            yield unpack.decompress(packed[at : at + _SALVAGE])
        except zlib.error:
            return


def _sort(item: Object | StrayBytes) -> Sort | str:
    """Return what an object is, or why it cannot be read."""
    if isinstance(item, StrayBytes):
        return f"no object at byte {item.at} of the data in the containers"
    need = _NEEDS.get(item.kind) or (_ERRORS[item.kind].size if item.kind in _ERRORS else None)
    if need is None:
        return Sort.OTHER
    place = f"object at byte {item.at} of the data in the containers"
    if item.version not in _TIMES:
        return f"{place}: unknown version {item.version} of the header"
    header = _TIMES[item.version][1]
    if int.from_bytes(item.data[4:6], "little") != header or len(item.data) < header + need:
        return f"{place}: does not have its size"
    if item.kind in _ERRORS:
        return Sort.ERROR_FRAME
    return Sort.MESSAGE


def _way(item: Object | StrayBytes, sort: Sort | str) -> Way:
    """Return whether a frame was sent, or only asked for."""
    if sort is not Sort.MESSAGE or isinstance(item, StrayBytes) or item.kind not in _DIRECTION:
        return Way.OTHER
    at = _TIMES[item.version][1] + _DIRECTION[item.kind]
    return _WAYS.get(item.data[at] & 0xF, Way.OTHER)


def _messages(objects: list[bytes]) -> Iterator[Message | str]:
    """For each object its message, or why there is none. A reader that fails is dead: a new one goes on behind it."""
    done = 0
    while done < len(objects):
        part = b"".join(objects[done : done + _RUN])
        count, last = 0, min(_RUN, len(objects) - done)
        reason = "python-can skips it"
        try:
            for message in library.BLFReader(BytesIO(_file(part))):
                count += 1
                yield message
        except Exception as error:  # noqa: BLE001 - of any type: python-can checks little
            reason = words(error)
        if count < last:
            count += 1
            yield reason
        done += count


def _file(objects: bytes) -> bytes:
    """Return a BLF file with one container that is not compressed. Its start time does not matter."""
    head = b"LOGG" + library.FILE_HEADER_STRUCT.size.to_bytes(4, "little")
    size = _BODY + _CONTAINER_HEADER + len(objects)
    container = library.OBJ_HEADER_BASE_STRUCT.pack(SIGNATURE, _BODY, 1, size, library.LOG_CONTAINER)
    method = library.LOG_CONTAINER_STRUCT.pack(library.NO_COMPRESSION, len(objects))
    return head.ljust(library.FILE_HEADER_STRUCT.size, b"\0") + container + method + objects
