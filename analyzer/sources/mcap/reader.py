"""From the bytes of a file to its records, and on behind damage."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from analyzer.sources.mcap.chunks import Chunk
from analyzer.sources.mcap.contents import Contents
from analyzer.sources.mcap.records import BROKEN, DEFINITIONS, HEAD, LIMIT, LONGER, MAGIC, PREFIX, fit, goes_on
from analyzer.sources.mcap.search import Result, find
from analyzer.sources.mcap.stream import FileWindow
from analyzer.sources.mcap.summary import counts

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

# Opcodes that the format does not define yet, and those that it leaves to applications.
_UNDEFINED, _PRIVATE = 0x10, 0x80
_KEPT = {*DEFINITIONS, Opcode.MESSAGE, Opcode.CHUNK, Opcode.DATA_END}
_SOUND = "no message is missing"


class _Part(Enum):
    """Where in the file the reading stands."""

    MAGIC = 1
    DATA = 2
    SUMMARY = 3
    END_MAGIC = 4
    OVER = 5


class Reader:
    """Records one after the other; every message and every damaged thing is one record of the capture."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._contents = Contents(source)
        self._stream = FileWindow()
        self._stream.need(len(MAGIC))
        self._part = _Part.MAGIC
        # Where the search for the next record began, while it lasts.
        self._lost: int | None = None
        self._private = 0

    def feed(self, batch: bytes) -> Iterator[FrameBatch]:
        """Take the next bytes."""
        if self._stream.push(batch):
            yield from self._run(final=False)
            if self._contents.walk.waiting:
                yield self._contents.take()

    def finish(self) -> Iterator[FrameBatch]:
        """End the input."""
        self._stream.need(0)
        self._stream.push(b"")
        yield from self._run(final=True)
        self._contents.walk.finish()
        yield self._contents.take()

    def notes(self) -> list[str]:
        """Return what is to be said of the file, in short clauses."""
        return self._contents.notes() + ([f"private records skipped: {self._private}"] if self._private else [])

    def _run(self, *, final: bool) -> Iterator[FrameBatch]:
        stream, going = self._stream, True
        while going and self._part is not _Part.OVER and not self._contents.ended:
            if stream.at > len(stream.data):  # inside a record that is skipped
                going = self._wait(0, final=final)
            elif self._lost is not None:
                going = self._search(final=final)
            elif self._part in {_Part.MAGIC, _Part.END_MAGIC}:
                going = self._magic(final=final)
            else:
                if self._part is _Part.DATA:
                    at, last, _ = yield from self._contents.messages(stream.data, stream.at)
                    if at > stream.at:
                        stream.at, stream.kept = at, last
                going = yield from self._record(final=final)
        if self._part is _Part.OVER:
            stream.at = stream.kept = len(stream.data)

    def _over(self, place: int, reason: str) -> bool:
        """End the reading here, early."""
        unpacked = " of the unpacked data" if self._source.packing else ""
        self._source.damaged(f"byte {place}{unpacked}", reason)
        self._part = _Part.OVER
        return False

    def _wait(self, count: int, *, final: bool) -> bool:
        """There is nothing to do before as many bytes are there; if they never come, the file ends early."""
        if not final:
            self._stream.need(count)
            return False
        behind = self._part in {_Part.SUMMARY, _Part.END_MAGIC}
        return self._over(self._stream.size, f"MCAP data ends early{f', {_SOUND}' if behind else ''}")

    def _magic(self, *, final: bool) -> bool:
        """Read the mark at the start and at the end of the file."""
        stream = self._stream
        left = len(stream.data) - stream.at
        if left < len(MAGIC):
            return self._wait(len(MAGIC), final=final)
        if self._part is _Part.END_MAGIC:
            if not stream.data.startswith(MAGIC, stream.at):
                return self._over(stream.place, f"MCAP data without its end mark, {_SOUND}")
            if left > len(MAGIC):
                return self._over(stream.place + len(MAGIC), "data behind the end of the MCAP data")
            if not final:
                return self._wait(len(MAGIC) + 1, final=False)
        self._part = _Part.DATA if self._part is _Part.MAGIC else _Part.OVER
        stream.skip(len(MAGIC))
        return True

    def _record(self, *, final: bool) -> Generator[FrameBatch, None, bool]:
        """One record that is no message, or a message that is not there as a whole; whether there is more to do."""
        stream = self._stream
        left = len(stream.data) - stream.at
        if left < PREFIX:
            return self._wait(PREFIX, final=final) if left == 0 or not final else self._cut()
        opcode, length = HEAD.unpack_from(stream.data, stream.at)
        end = PREFIX + length
        found = fit(stream.data, stream.at)
        if found == LONGER:  # as may be, if others follow
            sound = goes_on(stream.data, stream.at, final=final)
            found = left + 1 if sound is None else LONGER if sound else BROKEN
        if found == BROKEN or (opcode == Opcode.HEADER and stream.place != len(MAGIC)):
            return self._broken()
        needed = found if found > 0 else end if opcode in _KEPT and length <= LIMIT else 0
        chunk = opcode == Opcode.CHUNK and needed == end and self._part is _Part.DATA
        self._contents.effort.read = min(stream.place + end, stream.size)
        if left < needed:
            if final and chunk:
                yield from self._chunk(end, unfinished=True)
            return self._wait(needed, final=final) if chunk or not final else self._cut()
        if chunk:
            yield from self._chunk(end)
        elif opcode == Opcode.STATISTICS and self._part is _Part.SUMMARY:
            yield self._contents.take()
            self._count()
        else:
            self._take(opcode, end)
        stream.skip(end)
        return True

    def _count(self) -> None:
        """Compare what was found with what the file says of itself."""
        stream = self._stream
        differs = counts(stream.data, stream.at + PREFIX).differs(self._contents.counts)
        if differs and not self._contents.hurt:
            self._source.damaged(f"byte {stream.place}", differs)

    def _take(self, opcode: int, end: int) -> None:
        """Take a record that is no chunk."""
        stream = self._stream
        place, body = stream.place, stream.at + PREFIX
        if self._part is _Part.SUMMARY and opcode != Opcode.FOOTER:
            return
        if opcode in DEFINITIONS:
            self._contents.define(f"record at byte {place}", opcode, stream.data[body : stream.at + end])
        elif opcode == Opcode.DATA_END:
            self._part = _Part.SUMMARY
            self._contents.walk.finish()
            stated = int.from_bytes(stream.data[body : body + 4], "little")
            if stated not in {0, stream.crc()} and not self._contents.hurt:
                self._source.damaged(f"byte {place}", "checksum of the MCAP data is wrong")
        elif opcode == Opcode.FOOTER:
            self._part = _Part.END_MAGIC
        elif opcode >= _PRIVATE:
            self._private += 1
        elif opcode >= _UNDEFINED or opcode == Opcode.CHUNK:
            what = "a chunk too long" if opcode == Opcode.CHUNK else f"kind {opcode:#04x} not known"
            self._contents.unreadable(f"record at byte {place}, {end} bytes: {what}, skipped")

    def _chunk(self, end: int, *, unfinished: bool = False) -> Iterator[FrameBatch]:
        stream = self._stream
        name = f"chunk at byte {stream.place}, {end} bytes"
        chunk = Chunk.read(stream.data, stream.at + PREFIX)
        stored = stream.data[chunk.start : min(chunk.end, stream.at + end)]
        yield from self._contents.chunk(name, chunk, stored, unfinished=unfinished)

    def _broken(self) -> bool:
        """Begin to search, as no record stands here: inside the message before, whose length may be wrong."""
        stream = self._stream
        if self._part is _Part.SUMMARY:
            return self._over(stream.place, f"the MCAP summary is damaged, {_SOUND}")
        self._lost = stream.place
        stream.at = stream.kept = min(stream.kept, stream.at) + 1
        return True

    def _cut(self) -> bool:
        """End the reading at a record that is not whole: the file ends early, or the length is wrong."""
        stream = self._stream
        if self._part is _Part.DATA:
            at, result, known = min(stream.kept, stream.at) + 1, Result.ONWARD, self._contents.channels.known
            while result is Result.ONWARD and not self._contents.ended:
                at, result, _ = find(stream.data, at, known, final=True)
            if result is Result.FOUND:
                return self._broken()
        return self._wait(0, final=True)

    def _search(self, *, final: bool) -> bool:
        """Goes on towards the next record that can be trusted."""
        stream = self._stream
        at, result, _ = find(stream.data, stream.at, self._contents.channels.known, final=final)
        stream.at = stream.kept = at
        if result is Result.ONWARD:
            return True
        if result is Result.FOUND:
            behind = stream.place - (self._lost or 0)
            where = f"{behind} bytes skipped" if behind >= 0 else "the record before it is too long"
            self._contents.unreadable(f"no MCAP record at byte {self._lost}: {where}")
            self._lost = None
            return True
        if final:
            return self._over(self._lost or 0, "no MCAP record from here on")
        stream.need(len(stream.data) - at + 1)
        return False
