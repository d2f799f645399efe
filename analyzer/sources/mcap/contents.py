"""The records of an MCAP file: definitions, messages, and chunks of both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import Schema

from analyzer._native import McapWalk
from analyzer.sources.mcap import summary
from analyzer.sources.mcap.channels import Channels
from analyzer.sources.mcap.effort import Effort
from analyzer.sources.mcap.records import (
    DEFINITIONS,
    HEAD,
    MESSAGE_HEADER,
    PREFIX,
    definition,
    definitions,
    whole,
)
from analyzer.sources.mcap.search import Found, Result, find
from analyzer.sources.mcap.summary import Counts

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator

    from mcap.records import Channel

    from analyzer._native import FrameBatch
    from analyzer.sources import Source
    from analyzer.sources.mcap.chunks import Chunk

# Rows that make a batch.
_ROWS = 1 << 17
# Why the native walk stopped.
_END, _FULL, _UNKNOWN = 0, 4, 5
# Steps of an `Effort`: a record, a definition, a message of no known channel, a round of a search; bytes that one step
# searches, or reads of a schema, or of such a message.
_RECORD, _DEFINITION, _MESSAGE, _ROUND = 4, 16, 8, 16
_SEARCHED, _DESCRIBED, _SEEN = 64, 8, 64
_ABSURD = "more work than a file of this size is worth"


class Contents:
    """Rows of the messages, one record each; whatever is damaged is one record, too."""

    def __init__(self, source: Source) -> None:
        self.walk = McapWalk()
        self.channels = Channels(self.walk)
        # Whether anything was damaged.
        self.hurt = False
        self.effort = Effort()
        self._source = source
        self._recalled = False
        # Bytes of the schemas that no channel has yet.
        self._sizes: dict[int, int] = {}
        # Rows and other records that were taken, those of them that are no messages, chunks.
        self._records = self._extra = self._chunks = 0

    @property
    def ended(self) -> bool:
        """True once the reading was stopped on purpose, and what comes no longer matters."""
        return self._source.stopped and not self._source.live

    @property
    def counts(self) -> Counts:
        """The findings up to the last batch."""
        return Counts(self._records - self._extra, self._chunks)

    def unreadable(self, text: str) -> None:
        """Something damaged that is no message, in short words."""
        self.hurt = True
        self._extra += 1
        self.walk.unreadable(text)

    def take(self) -> FrameBatch:
        """All rows since the last batch."""
        batch = self.walk.take()
        self._records += batch.lines["lines"]
        return batch

    def define(self, name: str, opcode: int, body: bytes) -> None:
        """Take a schema or a channel."""
        if (found := definition(opcode, body)) is None:
            self.unreadable(f"{name}: damaged {'schema' if opcode == Opcode.SCHEMA else 'channel'}, skipped")
        elif not self._define([found]):
            self.unreadable(f"{name}: {_ABSURD}, skipped")

    def _define(self, found: Iterable[Schema | Channel], *, only_new: bool = False) -> bool:
        """Take definitions; false if they are more work than there may be.

        The first channel of a schema makes it be read.
        """
        for one in found:
            if isinstance(one, Schema):
                self._sizes.setdefault(one.id, len(one.data))
            elif self.channels.known.get(one.id) != one:
                size = self._sizes.pop(one.schema_id, 0)
                if not self.effort.spend(_DEFINITION + size // _DESCRIBED):
                    return False
            self.channels.take([one], only_new=only_new)
        return True

    def messages(
        self, data: bytes, at: int, *, limited: bool = False
    ) -> Generator[FrameBatch, None, tuple[int, int, int]]:
        """Take messages up to something else. Return where that stands, the last message, why it stopped.

        Where `limited`, a message of no known channel stops it when nothing more of the effort is left.
        """
        last = at
        while True:
            start = at
            at, stop = self.walk.walk(data, at, _ROWS)
            if at > start:
                last = self.walk.last
            if stop == _FULL:
                yield self.take()
            worth = stop == _UNKNOWN and not (limited and not self._worth(data, at))
            if self.ended or not (stop == _FULL or worth):
                return at, last, stop
            if worth:
                at, last = self._unknown(data, at), at

    def _unknown(self, data: bytes, at: int) -> int:
        """Announce the channel of a message if it is not yet: once it is, its messages are taken natively."""
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
        self.hurt = True
        self.walk.unreadable(f"message of channel {number}: {self.channels.refusal(number)}")
        return end

    def _worth(self, data: bytes, at: int) -> bool:
        return self.effort.spend(_MESSAGE + HEAD.unpack_from(data, at)[1] // _SEEN)

    def recall(self) -> None:
        """Definitions are lost: a file on disk repeats them at its end."""
        source = self._source
        if not (self._recalled or source.live or source.packing or not source.repeatable):
            self._recalled = True
            self._define(summary.read(source, self._goes_on), only_new=True)

    def _goes_on(self) -> bool:
        return not self.ended and self.effort.spend(_RECORD)

    def chunk(self, name: str, chunk: Chunk, stored: bytes, *, unfinished: bool = False) -> Iterator[FrameBatch]:
        """Take the records of a chunk, none if it is damaged; if it is unfinished, those that are there."""
        self._chunks += 1
        data, wrong = b"", chunk.refused()
        if not wrong and chunk.compression and not self.effort.unpack(chunk.size):
            wrong = "unpacks to absurdly much for a file of this size"
        if not wrong:
            data, wrong = (chunk.beginning if unfinished else chunk.records)(stored, lambda: self.ended)
        if not wrong:
            yield from self._inside(name, data, unfinished=unfinished)
        elif not self.ended:
            self.unreadable(f"{name}: {wrong}, skipped")
            # Later chunks do not repeat its definitions.
            self.recall()
            self._define(definitions(data, self._goes_on), only_new=True)

    def _inside(self, name: str, data: bytes, *, unfinished: bool) -> Iterator[FrameBatch]:
        """Take the records of a chunk that is unpacked."""
        at = 0
        while not self.ended:
            at, _, stop = yield from self.messages(data, at, limited=True)
            if stop == _END or self.ended:
                return
            if stop == _UNKNOWN or not self.effort.spend(_RECORD):
                self.unreadable(f"{name}: {_ABSURD}, skipped from byte {at} of its data on")
                return
            if (end := whole(data, at)) is not None:
                if data[at] in DEFINITIONS:
                    self.define(name, data[at], data[at + PREFIX : end])
                at = end
                continue
            if unfinished:
                return
            after, result, _ = self._search(data, at + 1)
            if self.ended:
                return
            some = ", not all of them searched" if result is Result.ONWARD else ""
            after = len(data) if some else after
            self.unreadable(f"{name}: no record at byte {at} of its data, {after - at} bytes skipped{some}")
            if result is not Result.FOUND:
                return
            at = after

    def _search(self, data: bytes, at: int) -> Found:
        """Return the next record in a chunk; `Result.ONWARD` if that was given up."""
        while True:
            found = find(data, at, self.channels.known, final=True)
            worth = self.effort.spend(_ROUND + found.places + (found.at - at) // _SEARCHED)
            if found.result is not Result.ONWARD or self.ended or not worth:
                return found
            at = found.at

    def notes(self) -> list[str]:
        """Return what is to be said of the channels and of times."""
        return self.channels.summary(self.walk.header_times, self.walk.log_times)
