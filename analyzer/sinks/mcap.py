"""CAN frames in MCAP as ROS 2 records them: a topic for each bus and direction. Messages are formatted natively.

Frames without a time have topics of their own, such as `/can0/untimed/can`, whose metadata says so: every message has a
log time, and a reader cannot tell one that was made up. What else messages cannot say stands in the metadata of their
channels, too, which then share a topic: the two flags of CAN FD, raw length codes, and that receive overflows count
lost frames. Comments are a log, as ROS 2 has it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, BinaryIO

from analyzer._native import Messages
from analyzer.sinks.mcap_file import McapFile
from analyzer.sinks.schemas import FD_FRAME, FRAME, LOG

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer._native import FrameBatch

# Bits of the flags of a frame, and where the length code begins.
FD, BRS, ESI, CODE = 8, 16, 32, 8
# Bytes of messages that fill a chunk.
CHUNK = 1 << 20
# Topics by direction: unknown, received, sent.
_TOPICS = ("can", "from_can_bus", "to_can_bus")
_COMMENTS = "/comments"
_LOST_COMMENTS = "comments on frames"


class McapSink:
    """Writes MCAP to a file that is open and need not be seekable. `compression` is none, lz4 or zstd."""

    def __init__(self, file: BinaryIO, compression: str = "zstd") -> None:
        self.container = McapFile(file, compression)
        self._messages = Messages()
        self._channels = self._comments = 0
        self._topics: dict[str, str] = {}

    @property
    def frames(self) -> int:
        """Frames written so far, those of the open chunk too."""
        return self._messages.frames

    @property
    def held(self) -> int:
        """Bytes of the open chunk, not compressed yet."""
        return self._messages.waiting

    @property
    def lost(self) -> dict[str, int]:
        """The rows that the format could not hold so far, in words, and how often."""
        beside = {_LOST_COMMENTS: self._comments} if self._comments else {}
        return self._messages.lost | beside

    def write(self, batch: FrameBatch, comments: Mapping[int, str] | None = None) -> None:
        """Write the rows of a batch; those of the last chunk wait until it is full."""
        self._comments += len(comments or ())
        row: int | None = 0
        while row is not None:
            row = self._messages.add(batch, row, CHUNK)
            if self._messages.waiting >= CHUNK:
                self.close_chunk()

    def flush(self) -> None:
        """Close the open chunk and hand everything to the system."""
        self.close_chunk()
        self.container.flush()

    def close(self) -> None:
        """Write the summary, the end of the file. It stays open."""
        self.close_chunk()
        self.container.close()

    def close_chunk(self) -> None:
        """Write the chunk that is open, if it holds anything."""
        self._add_channels()
        taken = self._messages.take(len(self.container.head()))
        if taken is not None:
            self.container.chunk(taken)

    def topic(self, bus: str) -> str:
        """Return the bus as a part of a topic: letters, digits and underscores, no digit first, no two alike."""
        if bus not in self._topics:
            part = re.sub(r"[^A-Za-z0-9_]", "_", bus) or "can"
            part = f"bus_{part}" if part[0].isdigit() else part
            taken, number, name = self._topics.values(), 1, part
            while name in taken:
                number += 1
                name = f"{part}_{number}"
            self._topics[bus] = name
        return self._topics[bus]

    def _add_channels(self) -> None:
        """Add schemas and channels that messages of the open chunk are the first to use."""
        for bus, direction, content, flags, timed in self._messages.channels(self._channels):
            definition = LOG if content == "comments" else FD_FRAME if flags & FD else FRAME
            schema = self.container.schema(definition.name, "ros2msg", definition.text.encode())
            self._channels += 1
            # Our reader believes no time of a channel that has none.
            about = {} if timed else {"times": "none"}
            topic = _COMMENTS
            if content != "comments":
                parts = [self.topic(bus), *([] if timed else ["untimed"]), _TOPICS[direction]]
                topic = f"/{'/'.join(parts)}{'_fd' if flags & FD else ''}"
                # A topic may not have the name as it is.
                about = {"bus": bus or "can"} | _marks(flags) | about
            if content != "frames":
                about["content"] = content
            self.container.channel(self._channels, topic, "cdr", schema, about)


def _marks(flags: int) -> dict[str, str]:
    """Return what all frames of a channel are, as its metadata say it; nothing of common classic frames."""
    if flags & FD:
        more = [word for bit, word in ((BRS, "bit rate switch"), (ESI, "error state")) if flags & bit]
        # Our reader takes it for a sign that classic frames are apart.
        return {"frames": "CAN FD"} | ({"flags": ", ".join(more)} if more else {})
    return {"length code": str(flags >> CODE)} if flags >> CODE else {}
