"""Which channels carry CAN frames: announced to the native walk with the layout that their schema describes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from mcap.records import Channel, Schema

from analyzer.sources.mcap import jsons, protobuf, ros, topics

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer._native import McapWalk

# Message encoding -> how the native walk reads it, what is in it, how a schema may describe it.
_ROS = {
    "cdr": ("cdr", "ros2", ("ros2msg", "ros2idl", "omgidl", "")),
    "ros1": ("ros1", "ros1", ("ros1msg", "")),
}
_FD = 8  # bit of the flags of a frame
_CAN = re.compile(r"(?<![a-z])can(?![a-z])|can_?(?:frame|fd|msg|message|raw)", re.IGNORECASE)


class Channels:
    """All schemas and channels so far.

    A channel that is announced to the walk is settled: as one with CAN frames, or as one to ignore. JSON is settled by
    its first message, a channel without its schema when that turns up.
    """

    def __init__(self, walk: McapWalk) -> None:
        self.known: dict[int, Channel] = {}
        self.notes: list[str] = []
        self._walk = walk
        self._schemas: dict[int, Schema] = {}
        self._settled: set[int] = set()
        self._ignored: set[str] = set()
        self._parsed: dict[int, Any] = {}
        self._names = topics.Names()
        self.headers = self.others = 0  # channels with a header.stamp, with a stamp of another name

    def schema(self, schema: Schema) -> None:
        """Takes a schema; the first of an ID counts."""
        self._schemas.setdefault(schema.id, schema)

    def channel(self, channel: Channel) -> None:
        """Takes a channel; repeated ones change nothing, the last one counts."""
        if self.known.get(channel.id) == channel:
            return
        self.known[channel.id] = channel
        self._settled.discard(channel.id)
        if channel.message_encoding != "json":
            self.settle(channel.id, b"")

    def take(self, definitions: Iterable[Schema | Channel], *, only_new: bool = False) -> None:
        """Takes what a chunk or a summary defines; `only_new` keeps what is known."""
        for one in definitions:
            if isinstance(one, Schema):
                self.schema(one)
            elif not (only_new and one.id in self.known):
                self.channel(one)

    def settle(self, number: int, message: bytes) -> bool:
        """Announces a channel, if that can be done now; `message` is its first one."""
        channel = self.known.get(number)
        if channel is None:
            return False
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            return False
        layout = self._layout(channel, schema, message)
        json = channel.message_encoding == "json" and len(message) <= jsons.LONGEST
        if layout is None and json and jsons.parsed(message) is None:
            return False  # a damaged message shows nothing of the others
        if layout is None:
            self._ignore(channel, schema)
        else:
            # Our own files say which bus it is, and keep apart CAN FD and frames without a time.
            bus = channel.metadata.get("bus") or self._names.bus(channel.topic)
            flags = topics.direction(channel.topic) | (_FD if channel.metadata.get("frames") == "CAN FD" else 0)
            self._walk.channel(number, bus, layout, flags, timed=channel.metadata.get("times") != "none")
        self._settled.add(number)
        return True

    def _layout(self, channel: Channel, schema: Schema | None, message: bytes) -> tuple[str, Any] | None:
        form = channel.message_encoding
        if form in _ROS and schema is not None:
            wire, flavour, encodings = _ROS[form]
            found = ros.layout_of(schema.name, schema.encoding, schema.data, flavour)
            if found and schema.encoding in encodings:
                self.headers += 1
                return wire, found
        elif form == "protobuf" and schema is not None:
            layout, lists = protobuf.layout_of(schema.name, schema.data)
            if lists:
                self._note(f"{_title(channel, schema)} holds lists of frames, which are not read")
            return self._timed(layout)
        elif form == "json":
            return self._json(schema, message)
        return None

    def _json(self, schema: Schema | None, message: bytes) -> tuple[str, Any] | None:
        described = None
        if schema is not None and schema.encoding == "jsonschema":
            described = self._parsed.setdefault(schema.id, jsons.parsed(schema.data))
        layout = jsons.layout_of(described, jsons.parsed(message))
        if layout and "extended" not in {role for role, _ in layout[1]}:
            self._note("JSON without a flag for extended frames: ids above 0x7FF are taken as extended")
        return self._timed(layout)

    def _timed(self, layout: tuple[str, Any] | None) -> tuple[str, Any] | None:
        """Counts a channel whose frames state their time, by the name of the field."""
        if layout and any(field[0].startswith(("stamp", "sec")) for field in layout[1]):
            self.others += 1
        return layout

    def _ignore(self, channel: Channel, schema: Schema | None) -> None:
        self._walk.ignore(channel.id)
        title = _title(channel, schema)
        self._ignored.add(title)
        if schema is not None and (_CAN.search(schema.name) or ros.can_name(schema.name)):
            self._note(f"{title} looks like CAN, its layout is not known")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def summary(self, header_times: int, log_times: int, absent_times: int) -> list[str]:
        """What is to be said of the channels and of the times of their frames, in short clauses."""
        if self._settled and not (header_times or log_times or absent_times) and not self.notes:
            return [f"no channel with CAN frames among {len(self._settled)}"]
        stamp = (
            "header.stamp" if not self.others else "the message's own" if not self.headers else "header.stamp or own"
        )
        if header_times and log_times:
            return [*self.notes, f"time is {stamp}, log_time for {log_times} messages"]
        if header_times or log_times:
            return [*self.notes, f"time is {stamp if header_times else 'log_time'}"]
        return self.notes


def _title(channel: Channel, schema: Schema | None) -> str:
    """Topic and type, short and printable."""
    name = f"{channel.topic} ({schema.name})" if schema and schema.name else channel.topic
    return ascii(name[:100])[1:-1]
