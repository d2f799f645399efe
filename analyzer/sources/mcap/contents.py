"""What the records of an MCAP file hold: definitions, messages, and chunks of both."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from analyzer._native import McapWalk
from analyzer.sources.mcap import summary
from analyzer.sources.mcap.channels import Channels
from analyzer.sources.mcap.records import (
    DEFINITIONS,
    HEAD,
    MESSAGE_HEADER,
    PREFIX,
    definition,
    definitions,
    find,
    whole,
)

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from analyzer._native import Piece
    from analyzer.sources import Source
    from analyzer.sources.mcap.chunks import Chunk

# Rows that make a piece.
_ROWS = 1 << 17
# Why the native walk stopped.
_END, _FULL, _UNKNOWN = 0, 4, 5


class Contents:
    """Rows of the messages, one record each; whatever is damaged is one record, too."""

    def __init__(self, source: Source) -> None:
        self.walk = McapWalk()
        self.channels = Channels(self.walk)
        # Whether anything was damaged.
        self.hurt = False
        self._source = source
        self._recalled = False

    def unreadable(self, text: str) -> None:
        """Something damaged, in short words."""
        self.hurt = True
        self.walk.unreadable(text)

    def define(self, name: str, opcode: int, body: bytes) -> None:
        """Takes a schema or a channel."""
        if (found := definition(opcode, body)) is None:
            self.unreadable(f"{name}: damaged {'schema' if opcode == Opcode.SCHEMA else 'channel'}, skipped")
        else:
            self.channels.take([found])

    def messages(self, data: bytes, at: int) -> Generator[Piece, None, tuple[int, int, int]]:
        """Takes messages up to something else. Gives where that stands, the last message, why it stopped."""
        last = at
        while True:
            start = at
            at, stop = self.walk.walk(data, at, _ROWS)
            if at > start:
                last = self.walk.last
            if stop == _FULL:
                yield self.walk.take()
            elif stop == _UNKNOWN:
                at, last = self._unknown(data, at), at
            else:
                return at, last, stop

    def _unknown(self, data: bytes, at: int) -> int:
        """A message of a channel that is not announced: once it is, its messages are taken natively."""
        _, length = HEAD.unpack_from(data, at)
        end: int = at + PREFIX + length
        start = at + PREFIX
        number = int.from_bytes(data[start : start + 2], "little")
        message = data[start + MESSAGE_HEADER : end]
        if self.channels.settle(number, message):
            return at
        self.recall()
        if self.channels.settle(number, message):
            return at
        self.unreadable(f"message of channel {number}: nothing says what it holds")
        return end

    def recall(self) -> None:
        """Definitions are lost: a file on disk repeats them at its end."""
        source = self._source
        if not (self._recalled or source.live or source.packing or source.name == "-"):
            self._recalled = True
            self.channels.take(summary.read(Path(source.name)), only_new=True)

    def chunk(self, name: str, chunk: Chunk, stored: bytes, *, unfinished: bool = False) -> Iterator[Piece]:
        """Takes the records of a chunk, none if it is damaged; if it is unfinished, those that are there."""
        if reason := chunk.refused():
            self.unreadable(f"{name}: {reason}, skipped")
            return
        data, wrong = chunk.beginning(stored) if unfinished else chunk.records(stored)
        if wrong:
            self.unreadable(f"{name}: {wrong}, skipped")
            # Later chunks do not repeat its definitions.
            self.recall()
            self.channels.take(definitions(data), only_new=True)
            return
        at = 0
        while True:
            at, _, stop = yield from self.messages(data, at)
            if stop == _END:
                return
            if (end := whole(data, at)) is not None:
                if data[at] in DEFINITIONS:
                    self.define(name, data[at], data[at + PREFIX : end])
                at = end
                continue
            if unfinished:
                return
            after, found = find(data, at + 1, self.channels.known, final=True)
            self.unreadable(f"{name}: no record at byte {at} of its data, {after - at} bytes skipped")
            if not found:
                return
            at = after

    def notes(self) -> list[str]:
        """What is to be said of the channels and of times."""
        return self.channels.summary(self.walk.header_times, self.walk.log_times, self.walk.absent_times)
