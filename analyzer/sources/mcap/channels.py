"""Which channels carry CAN frames: announced to the native walk with the layout that their schema describes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mcap.records import Channel, Schema

from analyzer.sources.mcap import jsons, marks, protobuf, ros, topics

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer._native import McapWalk

# Message encoding -> how the native walk reads it, what is in it, how a schema may describe it.
_ROS = {
    "cdr": ("cdr", "ros2", ("ros2msg", "ros2idl", "omgidl", "")),
    "ros1": ("ros1", "ros1", ("ros1msg", "")),
}
# Contents that our own files have beside frames, by the layouts of the native walk.
_REMARKS = {"comments": ("comments", ""), "drops": ("drops", "")}
# Messages that a channel of JSON without a description may have in front of the first frame.
_PATIENCE = 64
_ASSUMED = {
    "data": "data in text taken as hex, though it may be base64",
    "id": "identifiers in text taken as decimal, though they may be hex",
}


class Channels:
    """All schemas and channels so far.

    A channel that is announced to the walk is settled: as one with CAN frames, or as one to ignore. JSON is settled by
    its first messages, a channel without its schema when that turns up.
    """

    def __init__(self, walk: McapWalk) -> None:
        self.known: dict[int, Channel] = {}
        self.notes: list[str] = []
        self._walk = walk
        self._schemas: dict[int, Schema] = {}
        self._settled: set[int] = set()
        # Those with CAN frames.
        self._frames: set[int] = set()
        # Messages of those that are not settled yet, and what is to be said of them.
        self._passed: dict[int, int] = {}
        self._said: dict[int, str] = {}
        # Those of JSON whose schema alone does not tell the layout.
        self._vague: set[int] = set()
        self._parsed: dict[int, Any] = {}
        # A schema never changes, and many channels may use it.
        self._layouts: dict[tuple[int, str, bool], tuple[tuple[str, Any] | None, str]] = {}
        self._names = topics.TopicNames()
        self.headers = self.others = 0  # channels with a header.stamp, with a stamp of another name

    def schema(self, schema: Schema) -> None:
        """Take a schema; the first of an ID counts."""
        self._schemas.setdefault(schema.id, schema)

    def channel(self, channel: Channel) -> None:
        """Take a channel; repeated ones change nothing, the last one counts."""
        if self.known.get(channel.id) == channel:
            return
        self.known[channel.id] = channel
        self._settled.discard(channel.id)
        self._vague.discard(channel.id)
        if channel.message_encoding != "json":
            self.settle(channel.id, b"")

    def take(self, definitions: Iterable[Schema | Channel], *, only_new: bool = False) -> None:
        """Take what a chunk or a summary defines; `only_new` keeps what is known."""
        for one in definitions:
            if isinstance(one, Schema):
                self.schema(one)
            elif not (only_new and one.id in self.known):
                self.channel(one)

    def settle(self, number: int, message: bytes) -> bool:
        """Announces a channel, if that can be done now; `message` is its next one."""
        channel = self.known.get(number)
        if channel is None:
            return False
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            return False
        if channel.message_encoding == "json":
            return self._settle_json(channel, schema, message)
        layout, said = _REMARKS.get(channel.metadata.get("content", "")), ""
        if layout is None:
            layout, said = self._layout(channel, schema)
        self._announce(channel, schema, layout, said)
        return True

    def refusal(self, number: int) -> str:
        """Why a message of this channel was not taken, in words."""
        channel = self.known.get(number)
        described = channel and (channel.schema_id in self._schemas or not channel.schema_id)
        return "not JSON" if described else "nothing says what it holds"

    def _settle_json(self, channel: Channel, schema: Schema | None, message: bytes) -> bool:
        """By the schema and the message; without a schema, the first messages may be none of frames."""
        described, value, damaged = self._described(schema), None, False
        try:
            value = jsons.parsed(message)
        except ValueError:
            damaged = len(message) <= jsons.LONGEST
        if damaged and channel.id in self._vague:
            return False
        layout, said = jsons.layout_of(described, value, named=_named(channel, schema))
        if damaged and layout is None:
            self._vague.add(channel.id)  # the message shows nothing of the others
            return False
        passed = self._passed.get(channel.id, 0)
        if layout is not None:
            self._said.pop(channel.id, None)
            if passed:
                self._note(f"{self._title(channel)}: messages before the first frame left out: {passed}")
        elif passed < _PATIENCE and not jsons.describes(described):
            self._passed[channel.id] = passed + 1
            self._said[channel.id] = said or self._said.get(channel.id, "")
            self._walk.pass_one(channel.id)
            return True
        self._passed.pop(channel.id, None)
        self._announce(channel, schema, layout, said or self._said.pop(channel.id, ""))
        return True

    def _described(self, schema: Schema | None) -> Any:
        if schema is None or schema.encoding != "jsonschema":
            return None
        if schema.id not in self._parsed:
            try:
                self._parsed[schema.id] = jsons.parsed(schema.data)
            except ValueError:
                self._parsed[schema.id] = None
        return self._parsed[schema.id]

    def _layout(self, channel: Channel, schema: Schema | None) -> tuple[tuple[str, Any] | None, str]:
        """Return the layout, or what is to be said of a channel without."""
        if schema is None:
            return None, ""
        key = schema.id, channel.message_encoding, _named(channel, schema)
        if key not in self._layouts:
            self._layouts[key] = _layout(schema, *key[1:])
        return self._layouts[key]

    def _announce(self, channel: Channel, schema: Schema | None, layout: tuple[str, Any] | None, said: str) -> None:
        """Settles a channel: with its layout, else as one to ignore, of which something may be said."""
        self._settled.add(channel.id)
        if layout is not None:
            # Our own files say which bus it is, and keep apart what no message says.
            bus = channel.metadata.get("bus") or self._names.bus(channel.topic)
            flags = topics.direction(channel.topic) | marks.flags(channel.metadata)
            try:
                self._walk.channel(channel.id, bus, layout, flags, timed=channel.metadata.get("times") != "none")
            except ValueError:
                said = "cannot be read: its layout cannot be used"
            else:
                self._announced(channel, layout)
                return
        self._walk.ignore(channel.id)
        if said:
            self._note(f"{self._title(channel)} {said}")
        elif schema is not None and topics.says_can(schema.name):
            self._note(f"{self._title(channel)} looks like CAN, its layout is not known")

    def _announced(self, channel: Channel, layout: tuple[str, Any]) -> None:
        form, fields = layout
        if form in _REMARKS:
            return
        self._frames.add(channel.id)
        if form in _ROS:
            self.headers += 1
            return
        roles = {field[0] for field in fields}
        if any(role.startswith(("stamp", "sec")) for role in roles):
            self.others += 1
        if "extended" not in roles:
            name = "JSON" if form == "json" else form
            self._note(f"{name} without a flag for extended frames: ids above 0x7FF are taken as extended")

    def _title(self, channel: Channel) -> str:
        """Topic and type, short and printable."""
        schema = self._schemas.get(channel.schema_id)
        name = f"{channel.topic} ({schema.name})" if schema and schema.name else channel.topic
        return ascii(name[:100])[1:-1]

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def summary(self, header_times: int, log_times: int) -> list[str]:
        """Return what is to be said of the channels and of the times of their frames, in short clauses."""
        for number, said in self._said.items():
            if said:
                self._note(f"{self._title(self.known[number])} {said}")
        for number, what in self._walk.assumed:
            self._note(f"{self._title(self.known[number])}: {_ASSUMED[what]}")
        if (count := len(self._settled) + len(self._passed)) and not self._frames and not self.notes:
            return [f"no channel with CAN frames among {count}"]
        stamp = (
            "header.stamp" if not self.others else "the message's own" if not self.headers else "header.stamp or own"
        )
        if header_times and log_times:
            return [*self.notes, f"time is {stamp}, log_time for {log_times} messages"]
        if header_times or log_times:
            return [*self.notes, f"time is {stamp if header_times else 'log_time'}"]
        return self.notes


def _layout(schema: Schema, form: str, named: bool) -> tuple[tuple[str, Any] | None, str]:
    if form in _ROS:
        wire, flavour, encodings = _ROS[form]
        found = ros.layout_of(schema.name, schema.encoding, schema.data, flavour)
        if found and schema.encoding in encodings:
            return (wire, found), ""
    elif form == "protobuf":
        return protobuf.layout_of(schema.name, schema.data, named=named)
    return None, ""


def _named(channel: Channel, schema: Schema | None) -> bool:
    """Return whether the topic or the type says CAN."""
    return topics.says_can(channel.topic) or (schema is not None and topics.says_can(schema.name))
