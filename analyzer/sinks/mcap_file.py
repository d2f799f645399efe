"""The structure of an MCAP file: schemas, channels, chunks with message indexes and checksums, and the summary.

Each chunk starts with the schemas and channels that are new in it. Records are those of the `mcap` package.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING, BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    # Message records; ID, message index record and number of messages of each channel; first and last time.
    Taken = tuple[bytes, list[tuple[int, bytes, int]], tuple[int, int]]

_MAGIC = b"\x89MCAP0\r\n"
# A third of the time of zstd's own default level, for files that are a seventh larger.
_LEVEL = 1
_FOOTER = 8 + 8 + 4


class McapFile:
    """Writes to a file that is open and need not be seekable. `compression` is none, lz4 or zstd."""

    def __init__(self, file: BinaryIO, compression: str = "zstd") -> None:
        self._file, self._place = file, 0
        self._compression = "" if compression == "none" else compression
        self._compress = _compressor(compression)
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._new: list[McapRecord] = []
        self._counts: dict[int, int] = {}
        # Index records of all chunks, packed: a recording of days has a million of them.
        self._indexes, self._pack = bytearray(), zlib.compressobj()
        self._chunks = 0
        self._span: tuple[int, int] | None = None
        self._metadata: list[MetadataIndex] = []
        self._put(_MAGIC)
        self._put(_records([Header(profile="ros2", library="tailbyte")]))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Return the ID of a schema, which goes into the next chunk if the name is new."""
        if name not in self._schemas:
            schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
            self._schemas[name] = schema
            self._new.append(schema)
        return self._schemas[name].id

    def channel(self, number: int, topic: str, encoding: str, schema: int, about: Mapping[str, str]) -> None:
        """Add a new channel, which goes into the next chunk."""
        channel = Channel(id=number, topic=topic, message_encoding=encoding, metadata=dict(about), schema_id=schema)
        self._channels.append(channel)
        self._new.append(channel)

    def head(self) -> bytes:
        """Return what the next chunk starts with."""
        return _records(self._new)

    def chunk(self, taken: Taken) -> None:
        """Write a chunk; its messages were made to stand behind `head()`."""
        messages, indexes, (first, last) = taken
        data = self.head() + messages
        self._new.clear()
        packed = self._compress(data)
        start = self._place
        self._put(_records([Chunk(self._compression, packed, last, first, zlib.crc32(data), len(data))]))
        length = self._place - start
        places: dict[int, int] = {}
        for channel, record, count in indexes:
            places[channel] = self._place
            self._counts[channel] = self._counts.get(channel, 0) + count
            self._put(record)
        index = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=start,
            compression=self._compression,
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=self._place - start - length,
            message_index_offsets=places,
            message_start_time=first,
            uncompressed_size=len(data),
        )
        self._indexes += self._pack.compress(_records([index]))
        self._chunks += 1
        earliest, latest = self._span or (first, last)
        self._span = min(earliest, first), max(latest, last)

    def metadata(self, name: str, about: Mapping[str, str]) -> None:
        """Write texts about the file."""
        data = _records([Metadata(name=name, metadata=dict(about))])
        self._metadata.append(MetadataIndex(offset=self._place, length=len(data), name=name))
        self._put(data)

    def flush(self) -> None:
        """Hand everything to the system."""
        self._file.flush()

    def close(self) -> None:
        """Write the summary, the end of the file. It stays open."""
        self._put(_records([DataEnd(data_section_crc=0)]))
        start = self._place
        groups: list[tuple[Opcode, bytes]] = [
            (Opcode.SCHEMA, _records(self._schemas.values())),
            (Opcode.CHANNEL, _records(self._channels)),
            (Opcode.STATISTICS, _records([self._statistics()])),
            (Opcode.CHUNK_INDEX, zlib.decompress(self._indexes + self._pack.flush())),
            (Opcode.METADATA_INDEX, _records(self._metadata)),
        ]
        summary, offsets = b"", list[McapRecord]()
        for opcode, data in groups:
            if data:
                offsets.append(
                    SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(data))
                )
            summary += data
        offset_start = start + len(summary)
        summary += _records(offsets)
        head = bytes([Opcode.FOOTER]) + b"".join(n.to_bytes(8, "little") for n in (_FOOTER, start, offset_start))
        footer = Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=zlib.crc32(summary + head))
        self._put(summary + _records([footer]) + _MAGIC)

    def _statistics(self) -> Statistics:
        first, last = self._span or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunks,
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._place += len(data)


def _records(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]  # says nothing of its type


def _compressor(compression: str) -> Callable[[bytes], bytes]:
    if compression == "zstd":
        import zstandard  # noqa: PLC0415 - only what is needed

        return zstandard.ZstdCompressor(level=_LEVEL).compress
    if compression == "lz4":
        import lz4.frame  # noqa: PLC0415

        compress: Callable[[bytes], bytes] = lz4.frame.compress
        return compress
    return bytes
